"""Zeroing the axes of a running session: relative errors, drawn pasts, and no bit that depends on
how one got there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene_core.filter.ports import Points
from scene_core.geometry.ellipses import chi2_band
from scene_core.geometry.spaces import ONE_D, THREE_D, TWO_D, relative
from scene_core.params import ParamError
from scene_core.session.alignment import umeyama
from scene_core.session.commands import InitialiseAt, Seek, SwapModel, Transport, ZeroAxes
from scene_core.session.edits import with_seed
from scene_core.session.landmarks import landmark_errors
from scene_core.session.presets import build
from scene_core.session.report import report
from scene_core.session.session import Session

POSES = {1: ONE_D, 3: TWO_D, 7: THREE_D}


def started(preset: str, frames: int, seed: int = 0) -> Session:
    session = Session(with_seed(build(preset), seed))
    for _ in range(frames):
        session.advance()
    return session


def robot_of(session: Session) -> str:
    return next(iter(session.world.robots))


def zero(session: Session) -> None:
    session.apply(ZeroAxes(robot_of(session)))


def true_pose(session: Session) -> np.ndarray:
    assert session.trace is not None and session.trace.frame.truth is not None
    return np.asarray(session.trace.frame.truth.xp[robot_of(session)])


@pytest.mark.parametrize(
    ("preset", "before", "after", "seeds"),
    [("line", 40, 30, 5), ("nomad", 150, 50, 2), ("cloister", 20, 30, 3), ("room", 20, 15, 1)],
)
def test_errors_are_relative_and_as_large_as_the_filter_says(
    preset: str, before: int, after: int, seeds: int
) -> None:
    means, dof = [], 0
    for seed in range(seeds):
        session = started(preset, before, seed)
        home = true_pose(session)
        zero(session)
        for _ in range(after):
            session.advance()
        track = session.metrics.robots[robot_of(session)]
        rows = len(session.metrics)
        # By hand: the estimate against the true motion since the axes were moved.
        expected = relative(track.space, home, true_pose(session)).x
        error = -track.space.difference(expected, session.world.xp(robot_of(session)))
        assert np.allclose(track.error.view(rows)[-1], error, atol=1e-12)
        nees = track.nees.view(rows)[before + 5 :]
        means.append(np.nanmean(nees))
        dof = track.space.tangent
    lo, hi = chi2_band(dof)
    # At its start the room's filter is cautious: it does not know yet how still the camera is held.
    assert (0.05 * lo if preset == "room" else lo) < np.mean(means) < hi


def test_the_robot_is_the_origin_at_once_and_the_sentence_says_so() -> None:
    session = started("cloister", 5)
    zero(session)
    assert np.abs(THREE_D.difference(session.world.xp("robot"), THREE_D.identity())).max() < 1e-12
    assert session.message.startswith("the axes are where robot 'robot' is")
    assert session.events[0].text == session.message
    assert session.log == ((4, ZeroAxes("robot")),)
    figures = report(session, 1.0)
    assert figures["pos_end_m"] == pytest.approx(0.0, abs=1e-12)


def state(session: Session) -> tuple[bytes, bytes]:
    return session.world.gauss.x.tobytes(), session.world.gauss.P.tobytes()


def test_redo_back_and_seek_change_no_bit() -> None:
    session = started("cloister", 4)
    old = state(session)
    zero(session)
    new = state(session)
    for _ in range(3):
        session.advance()
    end = state(session)
    nees = session.metrics.robots["robot"].nees.view(7).tobytes()
    for command in (Transport("redo"), Seek(2), Seek(6), Seek(3), Transport("back"), Seek(6)):
        session.apply(command)
        if session.frame < 3:
            assert session.world.axes is None
            assert session.metrics.series().robots["robot"].position[0] == pytest.approx(
                session.metrics.robots["robot"].position.view(1)[0]
            )
        if session.frame == 3:
            assert state(session) == new
    assert state(session) == end
    assert session.metrics.robots["robot"].nees.view(7).tobytes() == nees
    session.apply(Transport("step phase"))
    session.apply(Transport("back"))
    assert state(session) == end
    whole = started("cloister", 4)
    assert state(whole) == old


def test_going_back_before_it_and_editing_there_undoes_it() -> None:
    session = started("cloister", 4)
    expected = started("cloister", 6)
    zero(session)
    session.advance()
    session.apply(Seek(2))
    session.apply(SwapModel("estimator.policies.landmark", "homogeneous point"))
    session.apply(SwapModel("estimator.policies.landmark", "inverse depth"))
    assert all(not isinstance(command, ZeroAxes) for _, command in session.log)
    while session.frame < 5:
        session.advance()
    assert session.world.axes is None
    assert session.world.xp("robot") == pytest.approx(expected.world.xp("robot"), abs=0.05)


def test_within_a_frame_it_waits_for_the_end() -> None:
    session, direct = started("cloister", 3), started("cloister", 4)
    session.step_phase()
    zero(session)
    assert session.message == "the axes are moved when this frame is complete"
    assert session.world.axes is None
    session.advance()
    zero(direct)
    assert state(session) == state(direct)
    assert session.message == direct.message


def test_the_past_is_drawn_in_the_new_axes() -> None:
    """Also after several changes: the estimate from where it is believed, the truth from where it
    is true."""
    session = started("nomad", 10)
    zero(session)
    for _ in range(8):
        session.advance()
    zero(session)
    xp, true = session.world.axes, true_pose(session)
    series = session.metrics.series().robots["nomad"]
    plain = started("nomad", 18).metrics
    track = plain.robots["nomad"]
    assert xp is not None and series.true_position is not None
    for drawn, kept, origin in (
        (series.true_position, track.true_position.view(18), true),
        (series.position[:10], track.position.view(18)[:10], None),
    ):
        assert drawn[-1] == pytest.approx(np.zeros(3), abs=1e-9) or origin is None
        steps, before = np.diff(drawn, axis=0), np.diff(kept, axis=0)
        assert np.linalg.norm(steps, axis=1) == pytest.approx(np.linalg.norm(before, axis=1))
    first = relative(TWO_D, true, track.true_xp.view(18)[0]).x
    assert series.true_position[0] == pytest.approx(
        [first[1], 0.0, first[0]] if session.world.up == "y" else [first[0], first[1], 0.0]
    )


def test_landmarks_are_judged_in_the_new_axes() -> None:
    session = started("cloister", 60)
    assert session.trace is not None
    truth = session.trace.frame.truth
    before = landmark_errors(session.world, truth)
    zero(session)
    after = landmark_errors(session.world, truth)
    assert len(before) == len(after) > 5
    # The robot's own error no longer moves all of them together.
    assert 0.0 < np.median(after) < 3.0 * np.median(before) + 0.05


def test_a_feature_started_after_it_stands_in_the_new_axes() -> None:
    session = started("cloister", 10)
    zero(session)
    assert session.trace is not None
    mount, raw = next(iter(session.trace.frame.raw.items()))
    assert isinstance(raw, Points)
    kept = len(session.world.features)
    session.apply(InitialiseAt(mount, tuple(raw.z[-1].tolist()), session.frame))
    replayed = session.world
    session.apply(Transport("redo"))
    assert len(session.world.features) >= kept
    assert np.array_equal(session.world.gauss.x, replayed.gauss.x)


def test_without_a_frame_or_a_robot_it_is_refused() -> None:
    session = Session(build("line"))
    with pytest.raises(ParamError, match="no frame yet"):
        zero(session)
    session.advance()
    with pytest.raises(ParamError, match="no robot 'x': choose one of robot"):
        session.apply(ZeroAxes("x"))
    assert session.log == () and session.world.axes is None


def test_a_model_that_needs_what_was_lost_can_not_come_back() -> None:
    session = started("cloister", 5)
    zero(session)
    with pytest.raises(ParamError, match=r"'inertial.*' relies on gravity, .* in frame 4"):
        session.apply(SwapModel("estimator.robots.robot.motion", "inertial"))
    session.apply(Seek(2))
    session.apply(SwapModel("estimator.robots.robot.motion", "inertial"))
    session.advance()
    with pytest.raises(ParamError, match="relies on gravity, and the up axis would tilt"):
        zero(session)


def test_an_aligned_run_stays_aligned() -> None:
    """Where the axes are says nothing about how far apart estimate and reference are."""
    aligned = replace(build("cloister"), align="se3")
    plain, session = Session(aligned), Session(aligned)
    for _ in range(30):
        plain.advance()
        session.advance()
        if session.frame == 14:
            zero(session)
    track, was = session.metrics.robots["robot"], plain.metrics.robots["robot"]
    xp, true_xp = track.xp.view(30), track.true_xp.view(30)
    assert np.array_equal(true_xp, was.true_xp.view(30))
    assert np.allclose(xp[:15], was.xp.view(15), atol=1e-12)
    # Later the frame the axes were put into is no longer corrected, by as much as it was wrong.
    assert np.linalg.norm(xp[:, :3] - was.xp.view(30)[:, :3], axis=1).max() < 0.05
    fit = umeyama(THREE_D, true_xp, xp, "se3")
    assert fit is not None
    apart = np.linalg.norm(fit.points(true_xp[:, :3]) - xp[:, :3], axis=1)
    series = session.metrics.series().robots["robot"]
    assert series.true_position is not None
    drawn = np.linalg.norm(series.true_position - series.position, axis=1)
    assert drawn == pytest.approx(apart, abs=1e-9)
    assert np.abs(series.position[14]).max() < 1e-9
    assert report(session, 1.0)["pos_rmse_m"] == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-6)
