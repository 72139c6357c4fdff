"""A gesture, such as keys from the first press until all are let go, is one step for undo."""

from __future__ import annotations

from dataclasses import replace

import pytest

from scene_core import params
from scene_core.session.commands import (
    Command,
    DeleteFeature,
    Redo,
    ResetParams,
    SetParam,
    SwapModel,
    Transport,
    Undo,
)
from scene_core.session.presets import build
from scene_core.session.session import Session
from scene_core.sources.manual import Manual
from scene_core.sources.simulated import Simulation

HAND = "source.robots.nomad.driver"
SD = "estimator.robots.nomad.motion.sd_v"
STEP = Transport("step frame")
DELETE = DeleteFeature(1)
TURN = SetParam(f"{HAND}.turn", 0.6, "drive 1")
NO_TURN = SetParam(f"{HAND}.turn", 0.0, "drive 1")


def forward(speed: float, gesture: int = 1) -> SetParam:
    return SetParam(f"{HAND}.forward", speed, f"drive {gesture}")


def driven(at_first: float = 0.0) -> Session:
    """A run of a robot that is driven by hand."""
    e = build("nomad")
    assert isinstance(e.source, Simulation)
    by_hand = Manual(forward=at_first)
    robots = {name: replace(r, driver=by_hand) for name, r in e.source.robots.items()}
    session = Session(replace(e, source=replace(e.source, robots=robots)))
    obey(session, STEP, STEP)
    return session


def obey(session: Session, *commands: Command) -> None:
    for command in commands:
        session.apply(command, playing=True)


def speed(session: Session) -> float:
    return params.get(session.settings.experiment, f"{HAND}.forward")


def long_ago(session: Session) -> None:
    """So that edits of the same parameter are steps of their own."""
    obey(session, *[STEP] * 40)


def test_undo_goes_back_to_before_the_press() -> None:
    session = driven(at_first=0.2)
    session.apply(forward(0.5))
    long_ago(session)
    obey(session, TURN)
    long_ago(session)
    obey(session, forward(0.0), STEP, NO_TURN, STEP, Undo())
    assert session.settings.experiment == session.base and speed(session) == 0.2
    assert session.settings.undoes is None
    session.apply(Redo())
    assert speed(session) == 0.0


def test_what_ends_where_it_began_is_nothing_to_undo() -> None:
    session = driven()
    obey(session, SetParam(SD, 0.3), STEP)
    before = session.settings
    for gesture in (1, 2):
        obey(session, forward(0.5, gesture), STEP, forward(0.0, gesture), STEP)
    assert session.settings.experiment == before.experiment
    assert session.settings.past == before.past
    session.apply(Undo())
    assert session.settings.experiment == session.base and speed(session) == 0.0


@pytest.mark.parametrize(
    "meanwhile",
    [
        (SetParam(SD, 0.3),),
        (SetParam(SD, 0.3, "sd 1"), STEP, SetParam(SD, 0.4, "sd 1")),
        (SetParam(SD, 0.3), DELETE),
        (DELETE,),
        (ResetParams(),),
        (SetParam(SD, 0.3), Undo()),
        (Undo(),),
        (SwapModel(HAND, "waypoints"), Undo()),
        (SwapModel(HAND, "waypoints"), SwapModel(HAND, "manual")),
    ],
    ids=lambda commands: " ".join(type(c).__name__ for c in commands),
)
def test_whatever_is_done_meanwhile_no_undo_or_redo_leaves_a_key_down(
    meanwhile: tuple[Command, ...],
) -> None:
    session = driven()
    obey(session, forward(0.5), STEP, *meanwhile, STEP, forward(0.0), STEP)
    assert speed(session) == 0.0
    for again in (Undo(), Redo()):
        while session.settings.undoes if again == Undo() else session.settings.redoes:
            session.apply(again)
            driver = params.get(session.settings.experiment, HAND)
            assert not isinstance(driver, Manual) or driver.forward == 0.0
    assert session.world.gauss.x.size


def test_a_slider_that_moves_before_and_after_a_press_leaves_no_key_down() -> None:
    session = driven()
    obey(session, SetParam(SD, 0.3, "sd 1"), STEP, forward(0.5), STEP)
    obey(session, SetParam(SD, 0.4, "sd 1"), STEP, forward(0.0), STEP)
    assert speed(session) == 0.0 and params.get(session.settings.experiment, SD) == 0.4
    session.apply(Undo())
    assert session.settings.experiment == session.base and session.settings.undoes is None


def test_a_gesture_in_which_something_else_was_edited_takes_back_no_more_than_itself() -> None:
    session = driven(at_first=0.2)
    obey(session, forward(0.5), STEP, SetParam(SD, 0.3), STEP, forward(0.0), STEP)
    session.apply(Undo())
    assert speed(session) == 0.0 and params.get(session.settings.experiment, SD) != 0.3
    session.apply(Undo())
    assert session.settings.experiment == session.base


def test_a_slow_drag_at_any_speed_is_one_step() -> None:
    session = driven()
    for value in (0.3, 0.4, 0.5):
        session.apply(SetParam(SD, value, "sd 1"), playing=True)
        long_ago(session)
    session.apply(Undo())
    assert session.settings.experiment == session.base
