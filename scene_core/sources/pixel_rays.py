"""The pixels of any camera as rays."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from scene_core.models.base import Sensor

_DARKEST = 1.2
"""Radians off the axis beyond which the image gets no darker; a wide lens spreads its fall-off so
that its last ray is here."""


class Rays(NamedTuple):
    """The pixels of a camera as rays."""

    d: np.ndarray
    """Unit rays (3, height, width), float32, in the camera's frame."""
    log_size: np.ndarray
    """log2 of the angle of a pixel [rad] (height, width), float32."""
    shade: np.ndarray
    """What the lens lets through (height, width), float32."""
    focal: float
    """Pixels per radian in the middle of the image."""


@lru_cache(maxsize=4)
def rays_of(sensor: Sensor, calib: tuple[float, ...]) -> Rays:
    """Rays through the centres of all pixels of a camera; the centre of the first is (0, 0)."""
    (_, width), (_, height) = sensor.limits
    v, u = np.mgrid[-1 : height + 1, -1 : width + 1]
    z = np.stack([u, v], axis=-1).reshape(-1, 2)
    X = sensor.backproject(z, np.zeros((len(z), 1)), np.array(calib)).X
    reached = np.abs(sensor.project(X, np.array(calib)).h - z).max(axis=1) < 0.5
    d = X[:, :3].reshape(*u.shape, 3)
    du = 0.5 * (d[1:-1, 2:] - d[1:-1, :-2])
    dv = 0.5 * (d[2:, 1:-1] - d[:-2, 1:-1])
    size = np.sqrt(np.linalg.norm(np.cross(du, dv), axis=-1))
    inner = d[1:-1, 1:-1]
    return Rays(
        d=np.ascontiguousarray(np.moveaxis(inner, -1, 0), dtype=np.float32),
        log_size=np.log2(np.maximum(size, 1e-9)).astype(np.float32),
        shade=_shade(inner[..., 2], reached.reshape(u.shape)[1:-1, 1:-1]).astype(np.float32),
        focal=float(1.0 / size[size.shape[0] // 2, size.shape[1] // 2]),
    )


def _shade(cos: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """cos^1.5 of the angle to the axis, as with a flat image; nothing where no ray arrives."""
    last = np.arccos(cos[reached].min(initial=1.0).clip(-1.0, 1.0))
    if last > _DARKEST:
        cos = np.cos(np.arccos(cos.clip(-1.0, 1.0)) * (_DARKEST / last))
    return np.clip(cos, 0.0, 1.0) ** 1.5 * reached
