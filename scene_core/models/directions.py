"""Directions in space as two angles, about any axis of the frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec

Axes = tuple[int, int, int]
"""Which components of a vector point ahead, aside and up: azimuth turns from the first towards the
second, elevation towards the third."""
FLU: Axes = (0, 1, 2)
"""x forward, y left, z up."""
SCENE: Axes = (2, 0, 1)
"""Scene's axes: z forward, x left, y up."""


class Angles(NamedTuple):
    """(azimuth, elevation) (..., 2) [rad] and the Jacobian (..., 2, 3) by the vector."""

    value: Vec
    by_m: Mat


class Direction(NamedTuple):
    """A unit vector (..., 3) and its Jacobian (..., 3, 2) by (azimuth, elevation)."""

    m: Vec
    by_angles: Mat


def angles(m: Vec, axes: Axes) -> Angles:
    """a = atan2(m_aside, m_ahead), e = atan2(m_up, |(m_ahead, m_aside)|) of m (..., 3), any length.

    Straight up the azimuth is free; its derivative is bounded, not infinite. Zero for m = 0.
    """
    ahead, aside, up = (m[..., i] for i in axes)
    flat2 = np.maximum(ahead * ahead + aside * aside, 1e-18 * np.vecdot(m, m) + 1e-24)
    flat, length2 = np.sqrt(flat2), flat2 + up * up
    J = np.zeros((*m.shape[:-1], 2, 3))
    i, j, k = axes
    J[..., 0, i], J[..., 0, j] = -aside / flat2, ahead / flat2
    J[..., 1, i] = -up * ahead / (flat * length2)
    J[..., 1, j] = -up * aside / (flat * length2)
    J[..., 1, k] = flat / length2
    return Angles(np.stack([np.arctan2(aside, ahead), np.arctan2(up, flat)], axis=-1), J)


def direction(azimuth: Vec, elevation: Vec, axes: Axes) -> Direction:
    """m = (cos e cos a, cos e sin a, sin e) along (ahead, aside, up)."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    m, dm = np.empty((*np.shape(ca), 3)), np.zeros((*np.shape(ca), 3, 2))
    i, j, k = axes
    m[..., i], m[..., j], m[..., k] = ce * ca, ce * sa, se
    dm[..., i, 0], dm[..., j, 0] = -ce * sa, ce * ca
    dm[..., i, 1], dm[..., j, 1], dm[..., k, 1] = -se * ca, -se * sa, ce
    return Direction(m, dm)
