"""What is done at the end of a frame can be undone, and then the run is as if it had never been."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from scene_core.params import ParamError
from scene_core.session.commands import (
    Command,
    DeleteFeature,
    InitialiseAt,
    Redo,
    Seek,
    SetParam,
    SwapModel,
    Transport,
    Undo,
    ZeroAxes,
)
from scene_core.session.edits import UNDO_STEPS
from scene_core.session.presets import build
from scene_core.session.run import FRAMES_AGAIN
from scene_core.session.session import Session

SD = "estimator.robots.nomad.motion.sd_v"
KEEP = "estimator.policies.management.keep_visible"
BACK = Transport("back")


def started(preset: str = "nomad", frames: int = 8) -> Session:
    session = Session(build(preset))
    if preset == "line":
        session.apply(SetParam(KEEP, 1))
    for _ in range(frames):
        session.advance()
    return session


def obey(session: Session, *commands: Command) -> None:
    for command in commands:
        session.apply(command)


def go_on(session: Session, last: int) -> None:
    while session.frame < last or session.half_stepped:
        session.advance()


def state(session: Session) -> tuple[object, ...]:
    """Everything a page shows of the run, but for how long it took."""
    world, series = session.world, session.metrics.series()
    tracks = [(t.position.tobytes(), t.sd.tobytes()) for t in series.robots.values()]
    assert session.trace is not None
    return (
        session.frame,
        session.half_stepped,
        world.gauss.x.tobytes(),
        world.gauss.P.tobytes(),
        repr([(f.label, f.attempts, f.updates, f.born) for f in world.features.values()]),
        repr(world.axes),
        tracks,
        session.metrics.totals(),
        session.events,
        session.log,
        session.settings.experiment,
        [r.phase for r in session.trace.records],
    )


def delete(session: Session) -> Command:
    return DeleteFeature(min(session.world.features))


def zero(session: Session) -> Command:
    return ZeroAxes(next(iter(session.world.robots)))


def click(session: Session) -> Command:
    assert session.trace is not None
    known = {f.appearance for f in session.world.features.values()}
    raw = session.trace.frame.raw["range"]
    row = next(i for i, who in enumerate(raw.ids) if who not in known)  # type: ignore[union-attr]
    return InitialiseAt("range", (float(raw.z[row, 0]),), session.frame)  # type: ignore[union-attr]


DEEDS = pytest.mark.parametrize(
    ("preset", "deed"), [("nomad", delete), ("nomad", zero), ("line", click), ("line", delete)]
)


@DEEDS
@pytest.mark.parametrize("later", [0, 5])
def test_undone_it_was_never_done(
    preset: str, deed: Callable[[Session], Command], later: int
) -> None:
    never, session = started(preset), started(preset)
    session.apply(deed(session))
    assert state(session) != state(never)
    go_on(session, 7 + later)
    session.apply(Undo())
    go_on(never, 7 + later)
    assert session.message.startswith("undone: the ")
    assert state(session) == state(never)
    go_on(session, 27)
    go_on(never, 27)
    assert state(session) == state(never)
    obey(session, Seek(3), Seek(27))
    assert state(session) == state(never)


@DEEDS
@pytest.mark.parametrize("later", [0, 5])
def test_done_again_it_was_never_undone(
    preset: str, deed: Callable[[Session], Command], later: int
) -> None:
    kept, session = started(preset), started(preset)
    command = deed(session)
    obey(kept, command)
    obey(session, command, Undo())
    go_on(session, 7 + later)
    session.apply(Redo())
    assert session.message.startswith("done again: the ")
    go_on(kept, 7 + later)
    assert state(session) == state(kept)
    obey(session, Undo(), Redo())
    go_on(session, 27)
    go_on(kept, 27)
    assert state(session) == state(kept)


@DEEDS
def test_within_a_frame_nothing_is_waiting_any_more(
    preset: str, deed: Callable[[Session], Command]
) -> None:
    never, session = started(preset), started(preset)
    command = deed(session)
    for one in (never, session):
        if isinstance(command, InitialiseAt):
            one.apply(BACK)
        for _ in range(3):
            one.step_phase()
    session.apply(command)
    session.apply(Undo())
    assert state(session) == state(never) and session.half_stepped
    go_on(session, 10)
    go_on(never, 10)
    assert state(session) == state(never)


def test_undo_in_the_middle_of_a_later_frame_stays_there() -> None:
    never, session = started(), started()
    session.apply(delete(session))
    for one in (never, session):
        go_on(one, 10)
        for _ in range(4):
            one.step_phase()
    session.apply(Undo())
    assert state(session) == state(never)
    assert session.message == "undone: the deletion of feature 1; frames 7 to 11 computed again"


def test_the_last_thing_done_is_undone_first_whatever_it_was() -> None:
    session = started()
    states = [state(session)]
    first, second = sorted(session.world.features)[:2]
    for command in (
        DeleteFeature(first),
        SetParam(SD, 0.3),
        zero(session),
        SwapModel("estimator.policies.update.kind", "sequential"),
        DeleteFeature(second),
    ):
        session.apply(command)
        states.append(state(session))
    worlds = [s[2:6] for s in states]
    for world in reversed(worlds[:-1]):
        session.apply(Undo())
        assert state(session)[2:6] == world
    assert session.settings.experiment == session.base
    with pytest.raises(ParamError, match="nothing to undo"):
        session.apply(Undo())
    for world in worlds[1:]:
        session.apply(Redo())
        assert state(session)[2:6] == world
    with pytest.raises(ParamError, match="nothing to redo"):
        session.apply(Redo())


def test_paused_stepped_and_sought_in_between_it_is_undone_all_the_same() -> None:
    never, session = started(), started()
    session.apply(delete(session))
    go_on(session, 12)
    obey(session, BACK, BACK, Transport("step phase"), Transport("redo"), Seek(3), Seek(9))
    session.apply(Undo())
    go_on(never, 9)
    assert state(session) == state(never)
    assert session.last_frame == 9, "what was computed later is void, as after an edit"


def test_before_the_frame_in_which_it_was_done_there_is_nothing_to_undo() -> None:
    session = started()
    session.apply(delete(session))
    there = state(session)
    session.apply(BACK)
    assert not session.settings.past
    session.advance()
    assert state(session) == there
    obey(session, Undo(), BACK)
    assert not session.settings.future
    session.advance()
    session.apply(Redo())
    assert state(session) == there


def test_done_again_later_it_is_undone_also_where_it_was_done() -> None:
    session = started()
    first, second = sorted(session.world.features)[:2]
    obey(session, DeleteFeature(first), DeleteFeature(second), Undo())
    there = state(session)
    go_on(session, 10)
    obey(session, Redo(), Seek(7))
    assert second not in session.world.features
    session.apply(Undo())
    assert state(session) == there


def test_many_edits_forget_no_deed() -> None:
    session = started(frames=4)
    label = min(session.world.features)
    session.apply(DeleteFeature(label))
    values = [0.2 + 0.001 * i for i in range(UNDO_STEPS + 20)]
    for value in values:
        obey(session, SetParam(SD, value), SwapModel("estimator.policies.update.kind", "stacked"))
    for _ in range(UNDO_STEPS):
        session.apply(Undo())
    assert label not in session.world.features
    session.apply(Undo())
    assert label in session.world.features and session.settings.undoes is None


def test_a_frame_done_over_with_an_edit_keeps_what_was_done_at_its_end_undoable() -> None:
    expected, session = started(frames=7), started()
    expected.apply(SetParam(SD, 0.3))
    expected.advance()
    obey(session, delete(session), SetParam(SD, 0.3), Transport("redo"), Undo())
    assert session.settings.experiment == session.base, "the edit was the last"
    session.apply(Undo())
    assert state(session)[2:6] == state(expected)[2:6]
    session.apply(BACK)
    assert not any(s for s in session.settings.past if s is not session.base)


def test_something_new_forgets_what_could_be_done_again() -> None:
    session = started()
    first, second = sorted(session.world.features)[:2]
    obey(session, DeleteFeature(first), Undo(), DeleteFeature(second))
    with pytest.raises(ParamError, match="nothing to redo"):
        session.apply(Redo())
    obey(session, Undo(), SetParam(SD, 0.3), Undo())
    assert set(session.world.features) >= {first, second}
    session.apply(Redo())
    assert session.settings.redoes is None


def test_what_was_refused_is_nothing_to_undo() -> None:
    session = started("cloister", 5)
    session.apply(SwapModel("estimator.robots.robot.motion", "inertial"))
    session.advance()
    settings, log = session.settings, session.log
    with pytest.raises(ParamError, match="relies on gravity"):
        session.apply(zero(session))
    assert session.settings is settings and session.log == log
    session.apply(Undo())
    assert session.settings.experiment == session.base and not session.settings.past


@pytest.mark.parametrize("later", [0, 3])
def test_what_came_to_nothing_is_nothing_to_undo(later: int) -> None:
    """The second click finds the feature of the first one; it starts none when that is undone."""
    never, session = started("line", 7), started("line", 7)
    for one in (never, session):
        one.step_phase()
    first = click(session)
    assert isinstance(first, InitialiseAt)
    obey(session, first, InitialiseAt("range", (first.z[0] + 1e-3,), session.frame))
    go_on(session, 7)
    if later:
        go_on(session, 7 + later)
        session.apply(InitialiseAt("range", first.z, session.frame))
    assert "is feature" in session.message
    assert len(session.settings.past) == 2, "an edit, a click"
    session.apply(Undo())
    go_on(never, 7 + later)
    go_on(session, 7 + later)
    assert state(session) == state(never)


def test_what_is_waiting_is_not_asked_for_twice() -> None:
    session = started()
    session.step_phase()
    session.apply(delete(session))
    settings, log = session.settings, session.log
    with pytest.raises(ParamError, match=r"feature 1 is deleted when .*, as was asked for before"):
        session.apply(delete(session))
    assert (session.settings, session.log) == (settings, log)


def test_a_click_on_what_is_in_the_map_keeps_what_could_be_done_again() -> None:
    session = started("line")
    obey(session, delete(session), Undo())
    assert session.trace is not None
    raw = session.trace.frame.raw["range"]
    known = {f.appearance for f in session.world.features.values()}
    row = next(i for i, who in enumerate(raw.ids) if who in known)  # type: ignore[union-attr]
    at = (float(raw.z[row, 0]),)  # type: ignore[union-attr]
    session.apply(InitialiseAt("range", at, session.frame))
    assert "is feature" in session.message
    session.apply(Redo())
    assert session.message.startswith("done again: the deletion")


def test_an_edit_that_is_void_leaves_no_curve() -> None:
    never, session = started("cloister", 4), started("cloister", 4)
    session.apply(SetParam("estimator.mounts.camera.calib_sd.u0", 1.0))
    session.advance()
    assert session.metrics.series().calibrations.keys() > never.metrics.series().calibrations.keys()
    obey(session, BACK, Undo(), SetParam("estimator.policies.selection.budget", 7))
    assert (
        session.metrics.series().calibrations.keys() == never.metrics.series().calibrations.keys()
    )


def test_a_new_start_has_nothing_of_the_old_run_to_undo() -> None:
    session = started()
    obey(session, SetParam(SD, 0.3), delete(session), Transport("reset"))
    go_on(session, 9)
    session.apply(Undo())
    assert session.settings.experiment == session.base and not session.settings.past


def test_what_is_too_long_ago_is_undone_where_it_was() -> None:
    session, never = started("line"), started("line")
    session.apply(delete(session))
    there = state(session)
    go_on(session, 8 + FRAMES_AGAIN)
    with pytest.raises(ParamError, match=r"at the end of frame 7, more than .* go to that frame"):
        session.apply(Undo())
    session.apply(Seek(7))
    assert state(session) == there
    session.apply(Undo())
    assert state(session) == state(never)
