"""What bodies in space share: a turn by a rotation vector, a step, a change of axes, a start at
rest.

The state of a body starts with its pose (x, y, z, qw, qx, qy, qz) [m, 1]; the vectors that follow
are given in the world or in the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D, relative
from scene_core.models.base import Lifted, Normalised, Redefined

POSE_SIZE = THREE_D.n


class Turned(NamedTuple):
    """q * q(theta) with its Jacobians by q (4, 4) and by theta (4, 3)."""

    q: Vec
    by_q: Mat
    by_theta: Mat


def turned(q: Vec, theta: Vec) -> Turned:
    """q turned by the rotation vector theta [rad] in the body; finite at theta = 0."""
    turn, dturn = quaternion.from_rotation_vector(theta)
    left = quaternion.left_matrix(q)
    return Turned(left @ turn, quaternion.right_matrix(turn), left @ dturn)


class Stepped(NamedTuple):
    """A pose (7,) with its Jacobians by the pose before (7, 7) and by the step (7, 6)."""

    xp: Vec
    by_xp: Mat
    by_step: Mat


def stepped(xp: Vec, step: Vec) -> Stepped:
    """(r + R(q) dr, q * q(a)): the pose xp after step = (dr, a) [m, rad] in the body, a a rotation
    vector."""
    turn, dturn = quaternion.from_rotation_vector(step[3:])
    moved = THREE_D.compose(xp, np.concatenate([step[:3], turn]))
    by_step = np.concatenate([moved.by_b[:, :3], moved.by_b[:, 3:] @ dturn], axis=1)
    return Stepped(moved.x, moved.by_a, by_step)


def straight_to(at: Vec, goal: Vec, speed: float, arrive: float, dt: float) -> Vec | None:
    """Velocity (3,) in the world of a body that goes straight from `at` to `goal` (3,) [m], at
    `speed` [m/s] but never past it within dt; None within the distance `arrive` [m]."""
    way = goal - at
    distance = float(np.linalg.norm(way))
    if distance <= arrive:
        return None
    return way / distance * min(speed, distance / dt)


def turn_to(xp: Vec, goal: Vec, rate: float, near: float, dt: float) -> Vec:
    """Rotation vector (3,) [rad] in the body: a turn about its own z, at most at `rate` [rad/s]
    over dt, that brings its x to where `goal` (3,) [m] is, above or below; none to a goal that is
    within `near` [m] of its z."""
    x, y, _ = quaternion.rotate_back(xp[3:POSE_SIZE], goal - xp[:3]).v
    angle = 0.0 if np.hypot(x, y) <= near else float(np.arctan2(y, x))
    return np.array([0.0, 0.0, np.clip(angle, -rate * dt, rate * dt)])


def redefine(xv: Vec, xpdef: Vec, in_world: Sequence[int] = ()) -> Redefined:
    """xv in axes whose origin is the pose xpdef (7,); `in_world` are the first rows of the vectors
    given in the world, all else belongs to the body."""
    n = len(xv)
    seen = relative(THREE_D, xpdef, xv[:POSE_SIZE])
    value, by_state, by_xpdef = xv.copy(), np.eye(n), np.zeros((n, POSE_SIZE))
    value[:POSE_SIZE] = seen.x
    by_state[:POSE_SIZE, :POSE_SIZE] = seen.by_b
    by_xpdef[:POSE_SIZE] = seen.by_a
    for start in in_world:
        rows = slice(start, start + 3)
        vector = quaternion.rotate_back(xpdef[3:], xv[rows])
        value[rows], by_state[rows, rows], by_xpdef[rows, 3:] = vector.v, vector.by_v, vector.by_q
    return Redefined(value, by_state, by_xpdef)


def normalise(xv: Vec) -> Normalised:
    """xv with a unit quaternion."""
    out, J = xv.copy(), np.eye(len(xv))
    out[3:POSE_SIZE], J[3:POSE_SIZE, 3:POSE_SIZE] = quaternion.normalise(xv[3:POSE_SIZE])
    return Normalised(out, J)


def at_rest(xp: Vec, sds: Sequence[float]) -> Lifted:
    """A body at the pose xp (7,) whose other components are zero with standard deviations `sds`."""
    n = POSE_SIZE + len(sds)
    P_rest = np.diag(np.concatenate([np.zeros(POSE_SIZE), np.square(sds)]))
    return Lifted(np.concatenate([xp, np.zeros(len(sds))]), np.eye(n)[:, :POSE_SIZE], P_rest)
