"""What a sensor pane draws of line landmarks, in the measurement space of a camera.

A straight line is seen as the arc in which its plane cuts the unit sphere about the sensor; through
the lens it is as curved as the lens makes it. Between two measured ends the arc is the same curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.records import Predictions
from scene_core.geometry.ellipses import sigma
from scene_core.models import segments
from scene_core.models.base import Sensor

SAMPLES = 17
"""Places along a drawn curve."""
WIDEST = 0.5
"""A band reaches no farther than this to either side, rad."""


@dataclass(frozen=True)
class LineShape:
    """One line in one pane."""

    curve: Vec
    """(K, 2) between the expected ends."""
    band: Vec
    """(2 K, 2) where a measured line may be and pass the gate."""
    seen: Vec | None = None
    """(K, 2) between the measured ends."""
    true: Vec | None = None
    """(K, 2) where it really is, as far as somebody knows."""


def rays(sensor: Sensor, k: Vec, z: Vec) -> Vec:
    """Unit rays (..., 3) of pixels z (..., 2)."""
    return sensor.backproject(z, np.zeros((*z.shape[:-1], 1)), k).X[..., :3]


def seen_at(sensor: Sensor, k: Vec, directions: Vec) -> Vec:
    """Pixels (..., 2) of directions (..., 3)."""
    X = np.concatenate([directions, np.zeros_like(directions[..., :1])], axis=-1)
    return sensor.project(X, k).h


def arcs(sensor: Sensor, k: Vec, ends: Vec) -> Vec:
    """Rays (N, SAMPLES, 3) between those of both ends (N, 4)."""
    first, last = rays(sensor, k, ends[:, None, :2]), rays(sensor, k, ends[:, None, 2:])
    t = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    between = (1.0 - t) * first + t * last
    return between / np.maximum(np.linalg.norm(between, axis=-1, keepdims=True), 1e-12)


def curves(sensor: Sensor, k: Vec, ends: Vec) -> Vec:
    """Pixels (N, SAMPLES, 2) along the lines between both ends (N, 4)."""
    return seen_at(sensor, k, arcs(sensor, k, ends))


def flattened(r: Vec, normals: Vec) -> Vec:
    """The rays (N, K, 3) turned into the planes with the normals (N, 3): of a line whose distance
    is open the expected ends are those last measured, beside the line itself."""
    n = normals[:, None]
    r = r - np.vecdot(r, n)[..., None] * n
    return r / np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), 1e-12)


def bands(sensor: Sensor, k: Vec, ends: Vec, normals: Vec, sds: Vec, half_width: float) -> Vec:
    """Outlines (N, 2 SAMPLES, 2) at half_width standard deviations sds (N, 2), in rad at either
    end, to both sides of the planes with the normals (N, 3)."""
    r = flattened(arcs(sensor, k, ends), normals)
    t = np.linspace(0.0, 1.0, SAMPLES)
    a = np.minimum(half_width * ((1.0 - t) * sds[:, :1] + t * sds[:, 1:]), WIDEST)[..., None]
    n = normals[:, None]
    sides = [seen_at(sensor, k, np.cos(a) * r + s * np.sin(a) * n) for s in (1.0, -1.0)]
    return np.concatenate([sides[0], sides[1][:, ::-1]], axis=1)


def shapes(
    sensor: Sensor,
    k: Vec,
    p: Predictions,
    S: Mat,
    found: Sequence[tuple[Vec | None, Vec | None]],
    confidence: float,
) -> list[LineShape | None]:
    """Every line of a group of predictions: S (N, 2, 2) of the distances of its ends, what was
    measured and what is true; None where it can not be drawn."""
    assert p.ends is not None
    sds = np.sqrt(np.maximum(np.diagonal(S, axis1=1, axis2=2), 0.0))
    predicted = seen_at(sensor, k, flattened(arcs(sensor, k, p.ends), p.h))
    around = bands(sensor, k, p.ends, p.h, sds, sigma(2, confidence))
    seen, true = (_known(sensor, k, [each[i] for each in found]) for i in (0, 1))
    both = np.concatenate([predicted, around], axis=1)
    whole = np.array(np.isfinite(both).all(axis=(1, 2)))
    return [
        LineShape(predicted[i], around[i], seen[i], true[i]) if whole[i] else None
        for i in range(len(p.labels))
    ]


def _known(sensor: Sensor, k: Vec, ends: Sequence[Vec | None]) -> list[Vec | None]:
    """Curves of those that are there."""
    out: list[Vec | None] = [None] * len(ends)
    rows = [i for i, z in enumerate(ends) if z is not None]
    if rows:
        drawn = curves(sensor, k, np.array([ends[i] for i in rows]))
        for i, curve in zip(rows, drawn, strict=True):
            out[i] = curve if np.isfinite(curve).all() else None
    return out


def pixels_per_radian(sensor: Sensor, k: Vec, z: Vec, n: Vec) -> Vec:
    """How many pixels a small turn towards n (3,) moves the ends z (4,): (2,)."""
    r, small = rays(sensor, k, z.reshape(2, 2)), 1e-4
    moved = seen_at(sensor, k, r + small * n) - seen_at(sensor, k, r - small * n)
    return np.linalg.norm(moved, axis=-1) / (2.0 * small)


def drawable(sensor: Sensor) -> bool:
    """Whether lines can be seen in this sensor's pane."""
    return sensor.pane == "image" and segments.seen_by(sensor) is None
