"""Whether a feature is seen from too different a place than at first to be recognised."""

from __future__ import annotations

import math

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import Fault


def faults(xws: Vec, pose0: Vec, y_X: Vec, max_scale: float, max_angle: float) -> np.ndarray:
    """SCALE and ANGLE flags (...,) of points y_X (..., 4) of the world seen from xws (7,), first
    seen from pose0 (..., 7).

    SCALE: the distance changed by more than the factor `max_scale`; ANGLE: the direction by more
    than `max_angle` [rad]. 0: no limit. A point at infinity never changes.

    Source: Davison, Reid, Molton, Stasse, *MonoSLAM*, PAMI 2007, section 3.5.
    """
    fault = np.zeros(y_X.shape[:-1], dtype=int)
    if not (max_scale or max_angle):
        return fault
    # m - w t is the ray from t to the point, whether w is zero or not.
    w = y_X[..., 3:]
    now, first = y_X[..., :3] - w * xws[..., :3], y_X[..., :3] - w * pose0[..., :3]
    d2, d02 = np.vecdot(now, now), np.vecdot(first, first)
    if max_scale:
        limit2 = max_scale**2
        fault = fault | ((d2 > limit2 * d02) | (d02 > limit2 * d2)) * int(Fault.SCALE)
    if max_angle:
        cos_limit = math.cos(max_angle) * np.sqrt(d2 * d02)
        fault = fault | (np.vecdot(now, first) < cos_limit) * int(Fault.ANGLE)
    return fault
