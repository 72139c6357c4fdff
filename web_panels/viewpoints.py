"""From where all of the map is seen."""

from __future__ import annotations

import math

import numpy as np

from scene_core.arrays import Vec
from web_panels.map_geometry import Bounds

FOV = math.radians(43.0)
"""Vertical field of view of browsers' cameras."""


def directions(up: str) -> dict[str, Vec]:
    """Unit-like vectors from the middle of the map towards the camera."""
    if up == "z":
        return {
            "perspective": np.array([-0.62, -0.66, 0.52]),
            "top": np.array([0.0, -0.02, 1.0]),
            "side": np.array([0.0, -1.0, 0.12]),
        }
    return {
        "perspective": np.array([-0.52, 0.5, -0.7]),
        "top": np.array([0.0, 1.0, -0.02]),
        "side": np.array([-1.0, 0.12, 0.0]),
    }


def all_in_sight(bounds: Bounds, d: Vec, up: Vec, aspect: float) -> float:
    """How far from the middle, in the direction d (3,), all corners of a box are in the picture.

    A corner that is x beside, y above and s beyond the middle is in it from a distance t if
    |y| <= (t + s) tan(FOV/2) and |x| <= (t + s) aspect tan(FOV/2).
    """
    right = np.cross(up, d)
    right /= np.linalg.norm(right)
    corners = np.stack(np.meshgrid(*np.stack([bounds.lo, bounds.hi], 1), indexing="ij"), -1)
    away = corners.reshape(-1, 3) - bounds.centre
    tangent = math.tan(0.5 * FOV)
    x, y, s = away @ right, away @ np.cross(d, right), -away @ d
    return float(np.max([np.abs(y) / tangent - s, np.abs(x) / (aspect * tangent) - s]))
