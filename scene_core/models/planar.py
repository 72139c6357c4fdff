"""What planar robots share: arcs, a change of axes, and the way to a waypoint.

A planar state starts with the position (z, x) [m]; directions in the plane are angles from z
towards x [rad]; whatever else it holds does not depend on the axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry.spaces import wrap
from scene_core.models.base import Normalised, Redefined


class Arc(NamedTuple):
    """A displacement (dz, dx) [m] and its derivatives, (2,) each."""

    step: Vec
    by_phi: Vec
    by_way: Vec
    by_turn: Vec


def arc(phi: float, way: float, turn: float) -> Arc:
    """Displacement along a circular arc of length `way` [m] that turns by `turn` [rad].

    With S = sin(turn)/turn, C = (1 - cos(turn))/turn and phi the heading at its start:
    dz = way (S cos(phi) - C sin(phi));  dx = way (S sin(phi) + C cos(phi))

    Source: Thrun, Burgard, Fox, *Probabilistic Robotics*, section 5.3.
    """
    c, s = np.cos(phi), np.sin(phi)
    S, C, dS, dC = _sine_terms(float(turn))
    unit = np.array([S * c - C * s, S * s + C * c])
    step = way * unit
    by_turn = way * np.array([dS * c - dC * s, dS * s + dC * c])
    return Arc(step, np.array([-step[1], step[0]]), unit, by_turn)


def _sine_terms(a: float) -> tuple[float, float, float, float]:
    """S = sin(a)/a and C = (1 - cos(a))/a with dS/da and dC/da, finite at a = 0."""
    if abs(a) < 1e-2:
        a2 = a * a
        return (
            1.0 - a2 / 6 + a2 * a2 / 120,
            a * (0.5 - a2 / 24 + a2 * a2 / 720),
            a * (-1 / 3 + a2 / 30 - a2 * a2 / 840),
            0.5 - a2 / 8 + a2 * a2 / 144,
        )
    sin, cos = np.sin(a), np.cos(a)
    S, C = sin / a, 2.0 * np.sin(0.5 * a) ** 2 / a
    return S, C, (cos - S) / a, (sin - C) / a


def redefine(xv: Vec, xpdef: Vec, directions: Sequence[int]) -> Redefined:
    """xv in axes whose origin is xpdef = (z, x, phi); `directions` are the rows that are angles in
    the plane."""
    rows = list(directions)
    c, s = np.cos(xpdef[2]), np.sin(xpdef[2])
    dz, dx = xv[0] - xpdef[0], xv[1] - xpdef[1]
    value = xv.copy()
    value[:2] = c * dz + s * dx, c * dx - s * dz
    value[rows] = wrap(xv[rows] - xpdef[2])
    by_state = np.eye(len(xv))
    by_state[:2, :2] = [[c, s], [-s, c]]
    by_xpdef = np.zeros((len(xv), 3))
    by_xpdef[:2, :2] = -by_state[:2, :2]
    by_xpdef[:2, 2] = value[1], -value[0]
    by_xpdef[rows, 2] = -1.0
    return Redefined(value, by_state, by_xpdef)


def normalise(xv: Vec, directions: Sequence[int]) -> Normalised:
    """xv with the rows `directions` in (-pi, pi]."""
    rows, out = list(directions), xv.copy()
    out[rows] = wrap(out[rows])
    return Normalised(out, np.eye(len(xv)))


class Goal(NamedTuple):
    """Where a waypoint lies: its distance [m] and its bearing off the heading [rad]."""

    distance: float
    bearing: float


def goal_from(at: Vec, heading: float, goal: Vec, arrive: float) -> Goal | None:
    """`goal` (z, x) [m] seen from `at` (z, x) [m]; None within the distance `arrive`."""
    dz, dx = float(goal[0] - at[0]), float(goal[1] - at[1])
    distance = float(np.hypot(dz, dx))
    if distance <= arrive:
        return None
    return Goal(distance, float(wrap(np.arctan2(dx, dz) - heading)))


def cruising(goal: Goal, turn: float, cruise: float, dt: float) -> float:
    """Speed [m/s] towards a goal after a turn by `turn` [rad]: `cruise`, slower while it is not
    ahead, and never past it within dt."""
    return min(cruise, goal.distance / dt) * max(0.0, np.cos(goal.bearing - turn).item())


def limited(angle: float, rate: float, dt: float) -> float:
    """As much of a turn by `angle` [rad] as `rate` [rad/s] allows in dt."""
    return float(np.clip(angle, -rate * dt, rate * dt))
