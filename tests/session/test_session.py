"""A session's numbers depend on settings, seed and commands; on nothing else, bit for bit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from scene_core import params
from scene_core.filter.ports import EndOfData
from scene_core.params import ParamError
from scene_core.session import presets
from scene_core.session.commands import (
    DeleteFeature,
    InitialiseAt,
    Redo,
    ResetParams,
    Select,
    SetParam,
    SetParams,
    SwapModel,
    Transport,
    Undo,
)
from scene_core.session.session import Session

SD = "estimator.robots.nomad.motion.sd_v"
TRUE_SD = "source.robots.nomad.motion.sd_v"


def fingerprint(session: Session) -> bytes:
    world = session.world
    features = repr([(f.label, f.attempts, f.updates, f.born) for f in world.features.values()])
    return world.gauss.x.tobytes() + world.gauss.P.tobytes() + features.encode()


def run(name: str = "nomad", frames: int = 30, **kwargs: int) -> Session:
    session = Session(presets.build(name), **kwargs)
    for _ in range(frames):
        session.advance()
    return session


@pytest.fixture(scope="module")
def straight() -> bytes:
    """Thirty frames without interruption."""
    return fingerprint(run())


def test_phase_steps_change_nothing(straight: bytes) -> None:
    session = Session(presets.build("nomad"))
    while session.frame < 29 or session.half_stepped:
        session.step_phase()
    assert fingerprint(session) == straight


def test_a_frame_is_complete_after_its_last_phase() -> None:
    session = Session(presets.build("nomad"))
    phases = [session.step_phase().phase for _ in range(7)]
    assert phases == ["predict", "internal", "select", "search", "associate", "update", "manage"]
    assert not session.half_stepped
    assert session.trace is not None and session.trace.complete


def test_back_and_redo_change_nothing(straight: bytes) -> None:
    session = run(frames=20)
    for _ in range(7):
        session.back()
    session.step_phase()
    session.step_phase()
    session.redo()
    session.redo()
    while session.frame < 29:
        session.advance()
    assert fingerprint(session) == straight


def test_a_frame_that_is_stepped_through_again_is_in_no_book_before_it_is_complete() -> None:
    session = run("cloister", frames=3)
    session.apply(DeleteFeature(min(session.world.features)))
    told = session.events
    session.back()
    before = session.events
    assert len(before) < len(told)
    session.step_phase()
    assert session.events == before and len(session.metrics) == 2
    session.apply(SetParam("estimator.policies.selection.budget", 7))
    assert session.events == before and len(session.metrics) == 2
    session.advance()
    assert session.events == told


@pytest.mark.parametrize("history_bytes", [1, 100_000, 2**28])
def test_seek_recomputes_what_was_forgotten(straight: bytes, history_bytes: int) -> None:
    session = run(history_bytes=history_bytes)
    session.seek(3)
    assert session.frame == 3 and session.trace is not None and session.trace.complete
    session.seek(29)
    assert fingerprint(session) == straight
    assert len(session.metrics) == 30


def test_back_at_the_start_says_so() -> None:
    session = run(frames=1)
    session.back()
    assert session.frame == -1 and session.trace is None
    session.back()
    assert "start" in session.message


def test_an_edit_waits_for_the_next_frame() -> None:
    session = run(frames=2)
    session.step_phase()
    session.apply(SetParam(SD, 0.5))
    assert params.get(session.experiment, SD) == 0.14
    assert session.pending is not None and params.get(session.pending, SD) == 0.5
    session.advance()
    assert params.get(session.experiment, SD) == 0.14
    session.advance()
    assert params.get(session.experiment, SD) == 0.5 and session.pending is None
    assert session.world.robots["nomad"].motion.sd_v == 0.5  # type: ignore[attr-defined]


def test_redo_uses_the_edited_settings() -> None:
    edited_before = run(frames=9)
    edited_before.apply(SetParam(SD, 0.5))
    edited_before.advance()
    session = run(frames=10)
    session.apply(SetParam(SD, 0.5))
    session.redo()
    assert session.frame == 9 and session.pending is None
    assert fingerprint(session) == fingerprint(edited_before)


def test_edits_are_played_again_after_stepping_back() -> None:
    session = run(frames=10)
    session.apply(SetParam(SD, 0.5))
    session.apply(SetParam(TRUE_SD, 0.3))
    session.advance()
    session.apply(SwapModel("estimator.policies.update.kind", "sequential"))
    for _ in range(9):
        session.advance()
    there = fingerprint(session)
    session.seek(5)
    assert params.get(session.experiment, SD) == 0.14 and session.pending is None
    while session.frame < 19:
        session.advance()
    assert fingerprint(session) == there
    assert params.get(session.experiment, "estimator.policies.update.kind") == "sequential"


def test_a_new_edit_in_the_past_discards_the_logged_future() -> None:
    session = run(frames=10)
    session.apply(SetParam(SD, 0.5))
    for _ in range(5):
        session.advance()
    session.seek(4)
    session.apply(SetParam(SD, 0.2))
    assert session.last_frame == 4
    while session.frame < 14:
        session.advance()
    assert params.get(session.experiment, SD) == 0.2
    assert [frame for frame, _ in session.log] == [5]


def test_a_clicked_feature_is_part_of_the_log() -> None:
    session = Session(presets.build("line"))
    session.apply(SetParam("estimator.policies.management.keep_visible", 0))
    session.advance()
    session.advance()
    assert len(session.world.features) == 0
    raw = session.trace.frame.raw["range"]  # type: ignore[union-attr]
    click = InitialiseAt("range", (float(raw.z[0, 0]),), session.frame)  # type: ignore[union-attr]
    session.apply(click)
    assert len(session.world.features) == 1
    assert session.metrics.totals()["initialised"] == 1
    for _ in range(3):
        session.advance()
    there = fingerprint(session)
    session.seek(0)
    assert len(session.world.features) == 0
    while session.frame < 4:
        session.advance()
    assert fingerprint(session) == there
    with pytest.raises(ParamError, match="frame 1, but this is frame 4"):
        session.apply(click)


def test_a_click_before_the_first_frame_is_refused() -> None:
    with pytest.raises(ParamError, match="no frame yet to point into: step to the first one"):
        run(frames=0).apply(InitialiseAt("scanner", (1.0, 0.0), -1))


def test_a_click_is_refused_in_a_frame_in_which_the_sensor_measured_nothing() -> None:
    session = Session(presets.build("line"))
    session.apply(SetParam("source.mounts.range.every", 2))
    session.advance()
    for step in (session.step_phase, session.advance):
        step()
        assert session.trace is not None and not session.trace.frame.raw
        with pytest.raises(ParamError, match="'range' measured nothing in this frame"):
            session.apply(InitialiseAt("range", (1.0,), session.frame))


def test_a_click_in_a_half_stepped_frame_is_done_when_it_is_complete() -> None:
    session = Session(presets.build("line"))
    session.apply(SetParam("estimator.policies.management.keep_visible", 0))
    session.step_phase()
    raw = session.trace.frame.raw["range"]  # type: ignore[union-attr]
    session.apply(InitialiseAt("range", (float(raw.z[0, 0]),), 0))  # type: ignore[union-attr]
    assert len(session.world.features) == 0
    session.advance()
    assert len(session.world.features) == 1


def test_a_click_is_replayed_only_into_a_sensor_that_measures_as_much() -> None:
    session = Session(presets.build("points_and_lines"))
    for _ in range(3):
        session.advance()
    session.apply(SwapModel("estimator.mounts.camera.sensor", "stereo"))
    session.advance()
    session.apply(InitialiseAt("camera", (300.0, 200.0, 290.0, 200.0), session.frame))
    session.apply(ResetParams())
    session.redo()
    assert session.frame == 3 and "'camera' has up to 2 coordinates" in session.events[0].text
    session.advance()


def test_a_feature_is_deleted_by_hand_and_deleted_again_when_it_is_played_again() -> None:
    session = run(frames=10)
    label = min(session.world.features)
    kept = tuple(session.world.features)
    session.apply(DeleteFeature(label))
    assert session.message == f"{label} deleted: by hand" and session.events[0].kind == "deleted"
    assert tuple(session.world.features) == kept[1:]
    assert f"feature:{label}" not in session.world.gauss.layout
    assert session.metrics.totals()["deleted"] == 1
    for _ in range(4):
        session.advance()
    there = fingerprint(session)
    session.seek(8)
    assert label in session.world.features
    while session.frame < 13:
        session.advance()
    assert fingerprint(session) == there
    with pytest.raises(ParamError, match=f"there is no feature {label} to delete"):
        session.apply(DeleteFeature(label))


def test_an_edit_in_a_frame_before_keeps_a_feature_that_was_deleted_by_hand() -> None:
    session = run(frames=10)
    label = min(session.world.features)
    session.apply(DeleteFeature(label))
    session.apply(Transport("back"))
    session.apply(SetParam(SD, 0.2))
    session.advance()
    assert label in session.world.features


def test_a_feature_is_deleted_when_a_half_stepped_frame_is_complete() -> None:
    session = run(frames=10)
    label = min(session.world.features)
    session.step_phase()
    session.apply(DeleteFeature(label))
    assert session.message == f"feature {label} is deleted when this frame is complete"
    assert label in session.world.features
    session.advance()
    assert label not in session.world.features and session.message == f"{label} deleted: by hand"


def test_what_can_not_be_deleted_is_said() -> None:
    session = Session(presets.build("cooperation"))
    (marker,) = [f.label for f in session.world.features.values() if f.carrier]
    with pytest.raises(ParamError, match="no frame yet to delete a feature in"):
        session.apply(DeleteFeature(marker))
    session.advance()
    with pytest.raises(ParamError, match=f"feature {marker} is a marker on robot"):
        session.apply(DeleteFeature(marker))


def test_repeated_edits_coalesce() -> None:
    session = run(frames=3)
    for value in (0.2, 0.3, 0.4):
        session.apply(SetParam(SD, value))
    assert len(session.log) == 1
    session.apply(Undo())
    assert session.pending is None


def test_a_drag_while_playing_is_one_step_for_undo() -> None:
    session = run(frames=3)
    for value in (0.2, 0.3, 0.4):
        session.apply(SetParam(SD, value), playing=True)
        session.advance()
    session.apply(Undo())
    assert params.get(session.settings.experiment, SD) == 0.14


def test_undo_and_redo_are_inverse() -> None:
    session = run(frames=2)
    values = [0.14]
    for value in (0.2, 0.3):
        session.apply(SetParam(SD, value))
        session.advance()
        values.append(value)
    for value in (0.2, 0.14):
        session.apply(Undo())
        assert params.get(session.settings.experiment, SD) == value
    with pytest.raises(ParamError, match="nothing to undo"):
        session.apply(Undo())
    for value in (0.2, 0.3):
        session.apply(Redo())
        assert params.get(session.settings.experiment, SD) == value
    with pytest.raises(ParamError, match="nothing to redo"):
        session.apply(Redo())
    session.apply(ResetParams())
    assert session.settings.experiment == session.base


def test_two_limits_move_together_beyond_where_each_of_them_was() -> None:
    session = Session(presets.build("nomad"))
    at = "estimator.mounts.scanner.sensor"
    before = params.get(session.experiment, at)
    near, far = before.reach_max + 1.0, before.reach_max + 2.0
    for path, value in ((f"{at}.reach_min", near), (f"{at}.reach_max", 0.5 * before.reach_min)):
        with pytest.raises(ParamError, match="is not below reach_max"):
            session.apply(SetParam(path, value))
    pair = ((f"{at}.reach_min", near), (f"{at}.reach_max", far))
    session.apply(SetParams(pair))
    session.advance()
    after = session.world.mounts["scanner"].sensor
    assert after == dataclasses.replace(before, reach_min=near, reach_max=far)  # type: ignore
    session.apply(SetParams(pair))
    assert session.message.count("is already") == 2 and session.pending is None
    with pytest.raises(ParamError, match=r"reach_min = -1 m is outside"):
        session.apply(SetParams(((f"{at}.reach_max", 99.0), (f"{at}.reach_min", -1.0))))
    assert session.pending is None and [c for _, c in session.log] == [SetParams(pair)]
    session.apply(Undo())
    session.advance()
    assert session.world.mounts["scanner"].sensor == before, "one step for undo"


def test_a_pair_that_is_dragged_is_one_edit() -> None:
    session = Session(presets.build("nomad"))
    at = "estimator.mounts.scanner.sensor"
    for far in (5.0, 6.0, 7.0):
        session.apply(SetParams(((f"{at}.reach_min", far - 4.0), (f"{at}.reach_max", far))))
        session.apply(SetParams(((f"{at}.reach_max", far + 0.5), (f"{at}.reach_min", far - 4.0))))
    assert len(session.log) == 1 and len(session.settings.past) == 1


def test_a_selection_is_not_logged() -> None:
    session = run(frames=3)
    session.apply(Select(2))
    assert session.selected == 2 and session.log == ()


def test_a_refused_edit_changes_nothing() -> None:
    session = run(frames=3)
    before = session.settings
    for command in (
        SetParam(SD, -1.0),
        SetParam(SD, float("nan")),
        SetParam("estimator.robots.nomad.motion.sd", 1.0),
        SetParam("name", "x"),
        SwapModel("estimator.robots.nomad.motion", "impulse"),
        SwapModel("estimator.robots.cat.motion", "impulse"),
        Transport("play"),
    ):
        with pytest.raises(ParamError):
            session.apply(command)
        assert session.settings is before


def test_reset_starts_again_with_the_edited_settings() -> None:
    session = run(frames=5)
    session.apply(SetParam(SD, 0.5))
    runs = session.run
    session.reset()
    assert session.frame == -1 and session.run == runs + 1
    assert params.get(session.experiment, SD) == 0.5
    assert session.last_frame == -1 and len(session.metrics) == 0


def test_the_frame_limit_ends_the_run() -> None:
    session = Session(dataclasses.replace(presets.build("line"), frames=3))
    for _ in range(3):
        session.advance()
    with pytest.raises(EndOfData):
        session.advance()
    assert session.frame == 2 and not session.half_stepped


def test_an_exception_in_a_frame_leaves_the_last_good_one() -> None:
    session = run(frames=3)
    good = fingerprint(session)
    motion = session.experiment.estimator.robots["nomad"].motion

    class Broken(type(motion)):  # type: ignore[misc]
        def f(self, xv, u, dt, k):  # type: ignore[no-untyped-def]
            raise ZeroDivisionError("on purpose")

    broken = params.put(session.experiment, "estimator.robots.nomad.motion", Broken(**vars(motion)))
    live = session._live
    robot = dataclasses.replace(session.world.robots["nomad"], motion=Broken(**vars(motion)))
    live._at = dataclasses.replace(
        live._at,
        settings=session.settings.edited(broken),
        world=dataclasses.replace(session.world, robots={"nomad": robot}),
    )
    with pytest.raises(ZeroDivisionError):
        session.advance()
    assert fingerprint(session) == good and session.frame == 2 and not session.half_stepped


def test_the_kept_past_is_bounded() -> None:
    session = run("cloister", frames=60, history_bytes=2_000_000)
    assert session._live.past.history.bytes < 2_500_000
    assert session.first_frame == 0 and session.last_frame == 59
    session.seek(17)
    assert session.frame == 17 and len(session.metrics) == 18


def test_an_edit_of_the_landmark_acts_on_mapped_features_where_it_may() -> None:
    session = run("cloister", frames=3)
    session.apply(SetParam("estimator.policies.landmark.linearity", 0.0))
    session.apply(SetParam("estimator.policies.landmark.rho_mean", 0.2))
    session.advance()
    models = {f.label: f.model for f in session.world.features.values()}
    mapped, new = models[1], models[max(models)]
    assert mapped.linearity == 0.0 and mapped.rho_mean == 0.01  # type: ignore[attr-defined]
    assert new.linearity == 0.0 and new.rho_mean == 0.2  # type: ignore[attr-defined]


def test_views_of_the_series_never_change() -> None:
    session = run(frames=10)
    before = session.metrics.series()
    kept = {name: (r.position.copy(), r.sd.copy()) for name, r in before.robots.items()}
    session.apply(SetParam(SD, 0.5))
    session.seek(4)
    session.apply(SetParam(SD, 0.9))
    for _ in range(20):
        session.advance()
    for name, (position, sd) in kept.items():
        np.testing.assert_array_equal(before.robots[name].position, position)
        np.testing.assert_array_equal(before.robots[name].sd, sd)
    assert len(before.times) == 10


def test_what_acts_on_reset_waits_for_it() -> None:
    session = run("cloister", frames=2)
    width, dt = "source.mounts.camera.sensor.width", "source.dt"
    session.apply(SetParam(width, 320))
    assert session.message == "takes effect on reset"
    session.apply(SetParam(dt, 0.2))
    session.apply(SetParam("source.mounts.camera.sensor.sd_px", 2.0))
    assert session.message == ""
    session.advance()
    assert params.get(session.experiment, width) == 320
    assert params.get(session.running, width) == 640
    assert params.get(session.running, "source.mounts.camera.sensor.sd_px") == 2.0
    assert session.trace is not None and session.trace.frame.dt == pytest.approx(0.1)
    session.reset()
    session.advance()
    session.advance()
    assert params.get(session.running, width) == 320
    assert session.trace.frame.dt == pytest.approx(0.2)
