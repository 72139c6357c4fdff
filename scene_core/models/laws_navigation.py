"""What a motion model that steers must obey: it comes to a goal, and it comes to rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import MotionModel
from scene_core.models.judge import DT, first, not_shaped

TRIES = 40
"""Random controls that may lead to a goal, each component of a size of its own."""
SIZES = (-2.5, 0.0)
"""Powers of ten between which these sizes are."""
PUSHED = 150
"""Steps for each metre of the way, for which they are held at most."""
FAR = (0.8, 8.0)
"""[m] A goal is about this far away, if the controls lead so far; the farther one is for a model
that counts the nearer as reached before it has come nearer."""
STILL = 1e-3
"""[m] Controls that lead no farther do not move the place: an arm may turn on the spot."""
PATIENCE = 2000
"""Steps to a goal."""
REST = 600
"""Steps to rest."""


def not_navigating(model: MotionModel, poses: Sequence[Vec], rng: np.random.Generator) -> str:
    """How it fails to bring a robot from these poses to a place its own controls lead to, without
    noise, or to say when it is there; or nothing."""
    if not model.navigates:
        return ""
    return first([_not_coming(model, model.lift(xp).xv, rng) for xp in poses])


def not_resting(model: MotionModel, states: Sequence[Vec]) -> str:
    """How it moves on from these states in spite of `stay`, without noise; or nothing."""
    if not model.navigates:
        return ""
    return first([_not_halting(model, xv) for xv in states])


def _place(model: MotionModel, xv: Vec) -> Vec:
    return np.asarray(model.space.position(model.xp(xv).xp))


def _moved(model: MotionModel, xv: Vec, u: Vec) -> Vec:
    return model.normalise(model.f(xv, u, DT, np.asarray(model.calib0)).fv).value


def _goal(model: MotionModel, xv: Vec, rng: np.random.Generator, far: float) -> Vec:
    """A place that it passes with controls that are held: a robot that can not fly, or an arm, is
    asked for nothing it can not reach. The farthest of a few, since some go round in circles."""
    here, best = _place(model, xv), _place(model, xv)
    for _ in range(TRIES):
        n, x = len(model.control_labels), xv
        u = rng.standard_normal(n) * 10.0 ** rng.uniform(*SIZES, n)
        for _ in range(round(PUSHED * far)):
            x = _moved(model, x, u)
            place = _place(model, x)
            if np.linalg.norm(place - here) > np.linalg.norm(best - here):
                best = place
            if np.linalg.norm(best - here) >= far:
                return best
    return best


def _not_coming(model: MotionModel, xv: Vec, rng: np.random.Generator) -> str:
    """Tried from one state, with goals that are farther and farther."""
    way = _Way(False)
    for far in FAR:
        goal = _goal(model, xv, rng, far)
        if np.linalg.norm(goal - _place(model, xv)) < STILL:
            return ""
        way = _way(model, xv, goal)
        if not (way.arrived and way.wrong):
            break
    return way.wrong


class _Way(NamedTuple):
    arrived: bool
    """Whether the model says so."""
    wrong: str = ""


def _way(model: MotionModel, xv: Vec, goal: Vec) -> _Way:
    away = [float(np.linalg.norm(_place(model, xv) - goal))]
    for _ in range(PATIENCE):
        u = model.navigate(xv, goal, DT)
        if u is None:
            there = away[-1] < 0.7 * away[0]
            return _Way(True, "" if there else f"arrived, it says, and is {_words(away)}")
        wrong = not_shaped("navigate", u, (len(model.control_labels),))
        if wrong:
            return _Way(False, wrong)
        xv = _moved(model, xv, u)
        away.append(float(np.linalg.norm(_place(model, xv) - goal)))
    if _is_slow(away) or away[-1] < 0.25 * away[0]:
        return _Way(False)
    best = f"{min(away):.3g} m at best"
    return _Way(False, f"after {PATIENCE * DT:g} s it is {_words(away)}, {best}")


def _is_slow(away: Sequence[float]) -> bool:
    """Whether it is still on its way: it came nearer in the second half of the time, too."""
    nearest = np.minimum.accumulate(away)
    early, late = -np.diff(nearest[[0, PATIENCE // 2, PATIENCE]])
    return bool(late > 0.5 * early > 0.0)


def _words(away: Sequence[float]) -> str:
    return f"{away[-1]:.3g} m from a goal that was {away[0]:.3g} m away"


def _not_halting(model: MotionModel, xv: Vec) -> str:
    """A second of it in the end against one at the start."""
    second, ways = round(1.0 / DT), [_place(model, xv)]
    for _ in range(REST):
        u = model.stay(xv, DT)
        wrong = not_shaped("stay", u, (len(model.control_labels),))
        if wrong:
            return wrong
        xv = _moved(model, xv, u)
        ways.append(_place(model, xv))
    early, late = (float(np.linalg.norm(ways[i + second] - ways[i])) for i in (0, REST - second))
    if late <= 0.05 * early + 1e-3:
        return ""
    return f"with what stay says it still moves at {late:.3g} m/s after {REST * DT:g} s"
