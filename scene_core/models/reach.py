"""How the hand of an arm of turning joints comes to a place, in the frame of the arm's foot.

The hand's place p(q) = sum_i R1(q1) ... Ri(qi) (li, 0, 0), Ri a turn about the joint's own axis;
dp/dqi = a_i x (p - p_i) with the joint's axis a_i and its place p_i.

Steps of damped least squares, dq = J' (J J' + c^2 I)^-1 (goal - p), lead the hand straight to a
goal, or let the arm fold over itself on the way to one behind it, where J' (goal - p) = 0: a local
minimum of the distance. No goal that can be reached is one for every start, so the least distance
is looked for from many.

Source: Siciliano et al., *Robotics*, 3.1 and 3.5; Levenberg-Marquardt as in Nocedal, Wright,
*Numerical Optimization*, 10.3.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.geometry.spaces import wrap

Axes = tuple[str, ...]
Lengths = tuple[float, ...]

DAMPING = 0.05
"""[m] Keeps the steps small where the arm is stretched."""
LONGEST = 0.15
"""[rad] A joint turns no farther in one step of those that are tried out."""
SHORTEST = 1e-3
"""[rad] Where no joint is to turn farther, the hand is at its goal or does not get there."""
STEPS = 80
"""So many are tried."""
STARTS = 64
"""Angles that the nearest place is looked for from, always the same."""
ROUNDS = 60
"""Steps of each of these searches."""
CLOSE = 1e-4
"""Part of the arm's length: nearer than this is the same place."""


def hand(axes: Axes, lengths: Lengths, q: Vec) -> tuple[Vec, Mat]:
    """p (..., 3) and dp/dq (..., 3, n) at the angles q (..., n)."""
    R, p = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3)), np.zeros((*q.shape[:-1], 3))
    turns, places = [], []
    for i, (axis, length) in enumerate(zip(axes, lengths, strict=True)):
        turns.append(R[..., "xyz".index(axis)])
        places.append(p)
        R = R @ _turn(axis, q[..., i])
        p = p + length * R[..., 0]
    J = np.cross(np.stack(turns, axis=-2), p[..., None, :] - np.stack(places, axis=-2))
    return p, np.swapaxes(J, -1, -2)


def step(J: Mat, error: Vec, damping: Vec | float = DAMPING) -> Vec:
    """dq (..., n) of damped least squares; `damping` [m] (...)."""
    c2 = np.asarray(damping)[..., None, None] ** 2
    y = np.linalg.solve(J @ np.swapaxes(J, -1, -2) + c2 * np.eye(3), error[..., None])
    return (np.swapaxes(J, -1, -2) @ y)[..., 0]


def straight(axes: Axes, lengths: Lengths, q: Vec, goal: Vec, arrive: float) -> float:
    """How far [rad] the joints turn, the one that turns most at every step, while steps of least
    squares lead the hand from the angles q (n,) to within `arrive` of a goal; infinite when they do
    not lead there. From farther on it is less by what has been turned."""
    turned = 0.0
    for _ in range(STEPS):
        p, J = hand(axes, lengths, q)
        if np.linalg.norm(goal - p) <= arrive:
            return turned
        dq = step(J, goal - p)
        size = float(np.abs(dq).max())
        if size < SHORTEST:
            break
        q = q + dq * min(1.0, LONGEST / size)
        turned += min(size, LONGEST)
    return np.inf


def nearest(axes: Axes, lengths: Lengths, goal: Vec, tolerance: float) -> tuple[Mat, float]:
    """Angles (K, n) that bring the hand as near to a goal as it comes, to a tolerance [m], and how
    near that is [m]."""
    return _nearest(axes, lengths, tuple(np.round(goal, 6).tolist()), tolerance)


@lru_cache(maxsize=64)
def _nearest(
    axes: Axes, lengths: Lengths, goal: tuple[float, ...], tolerance: float
) -> tuple[Mat, float]:
    """By Levenberg-Marquardt from all starts at once."""
    g, size = np.array(goal), max(sum(lengths), 1e-3)
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (STARTS, len(axes)))
    damping = np.full(STARTS, 0.1 * size)
    p, J = hand(axes, lengths, q)
    away = np.linalg.norm(g - p, axis=-1)
    for _ in range(ROUNDS):
        tried = q + step(J, g - p, damping)
        p_tried, J_tried = hand(axes, lengths, tried)
        away_tried = np.linalg.norm(g - p_tried, axis=-1)
        better = away_tried < away
        q, p = np.where(better[:, None], tried, q), np.where(better[:, None], p_tried, p)
        J = np.where(better[:, None, None], J_tried, J)
        away = np.where(better, away_tried, away)
        most = 1e3 * (size + away)
        damping = np.clip(np.where(better, damping / 3.0, damping * 4.0), 1e-4 * size, most)
    best = float(away.min())
    return frozen(wrap(q[away <= best + tolerance])), best


def _turn(axis: str, angle: Vec) -> Mat:
    """R (..., 3, 3) of a turn about an axis."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    R = np.zeros((*np.shape(angle), 3, 3))
    R[..., i, i] = 1.0
    R[..., j, j] = R[..., k, k] = np.cos(angle)
    R[..., k, j] = np.sin(angle)
    R[..., j, k] = -R[..., k, j]
    return R
