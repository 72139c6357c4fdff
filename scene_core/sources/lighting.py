"""The light in the room, computed once and painted into the textures.

Two lamps (a ceiling lamp and the window), each a patch of points, fall on a surface by Lambert's
law and are kept off by furniture; corners are darker because less of the room shines into them.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from scene_core.arrays import Vec
from scene_core.sources.canvas import Canvas

Box = tuple[Vec, Vec]

_COARSE = 0.06
"""Light is computed on a grid of about this step, m."""
_AMBIENT = 0.62


def lit(
    canvas: Canvas, corner: Vec, right: Vec, down: Vec, size: Vec, furniture: Sequence[Box]
) -> np.ndarray:
    """The canvas under the room's light: uint8 (rows, columns, 3), read-only."""
    rows, columns = canvas.pixels.shape[:2]
    n, m = (max(4, round(v / _COARSE)) for v in (canvas.height, canvas.width))
    v, u = ((np.arange(k) + 0.5) / k for k in (n, m))
    at = (
        corner
        + (u[None, :, None] * canvas.width) * right
        + (v[:, None, None] * canvas.height) * down
    )
    normal = -np.cross(right, down)
    light = _AMBIENT * _openness(at, normal, size, furniture)
    for lamp, strength, facing in _lamps(size):
        light += strength * _received(at + 1e-3 * normal, normal, lamp, facing, furniture)
    smooth = cv2.GaussianBlur(light.astype(np.float32), (0, 0), 0.8)
    wide = cv2.resize(smooth, (columns, rows), interpolation=cv2.INTER_CUBIC)
    wide = np.maximum(wide, canvas.glow)
    out = np.clip(np.rint(canvas.pixels * wide[..., None]), 0, 255).astype(np.uint8)
    out.flags.writeable = False
    return out


def _lamps(size: Vec) -> list[tuple[Vec, float, Vec]]:
    """Points (k, 3) of each lamp, its strength, and where it faces."""
    a = np.linspace(-0.3, 0.3, 3)
    ceiling = np.array([(x, y, size[2] - 0.12) for x in a for y in a])
    b = np.linspace(-0.5, 0.5, 3)
    window = np.array([(-size[0] / 2 + 0.02, y, 1.4 + 0.7 * z) for y in b for z in b])
    return [
        (ceiling, 2.6, np.array([0.0, 0.0, -1.0])),
        (window, 5.0, np.array([1.0, 0.0, 0.0])),
    ]


def _received(at: Vec, normal: Vec, lamp: Vec, facing: Vec, furniture: Sequence[Box]) -> Vec:
    """Lambert's law at places (n, m, 3): mean over the lamp's points of cos cos' / (d^2 + .8)."""
    total = np.zeros(at.shape[:2])
    for point in lamp:
        way = point - at
        d2 = (way**2).sum(-1)
        cosine = np.maximum(way @ normal, 0.0) * (
            0.25 + 0.75 * np.maximum(-(way @ facing), 0.0) / np.sqrt(d2)
        )
        light = cosine / np.sqrt(d2) / (d2 + 0.8)
        for low, high in furniture:
            light *= ~_blocked(at, way, low, high)
        total += light
    return total / len(lamp)


def _blocked(at: Vec, way: Vec, low: Vec, high: Vec) -> np.ndarray:
    """Whether a box lies between places (n, m, 3) and at + way (the slab test)."""
    safe = np.where(np.abs(way) < 1e-9, 1e-9, way)
    t0, t1 = (low - at) / safe, (high - at) / safe
    enter = np.minimum(t0, t1).max(-1)
    leave = np.maximum(t0, t1).min(-1)
    return (enter < leave) & (leave > 1e-6) & (enter < 1.0)


def _openness(at: Vec, normal: Vec, size: Vec, furniture: Sequence[Box]) -> Vec:
    """How much of the room shines onto places (n, m, 3): less in corners and beside furniture."""
    low = np.array([-size[0] / 2, -size[1] / 2, 0.0])
    gaps = np.concatenate([at - low, low + size - at], axis=-1)
    along = np.abs(np.concatenate([normal, normal])) < 0.5
    open_ = np.prod(1.0 - 0.3 * np.exp(-np.maximum(gaps[..., along], 0.0) / 0.35), axis=-1)
    for a, b in furniture:
        nearest = np.clip(at, a, b)
        gap = np.linalg.norm(at - nearest, axis=-1)
        open_ *= 1.0 - 0.35 * np.exp(-gap / 0.14) * (gap > 1e-6)
    return open_
