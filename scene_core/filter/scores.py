"""Selection scores: how much is to be gained by measuring a feature now.

    trace         the sensor's own score, by default trace E   (SceneLib)
    determinant   det E                                        (the toolbox)
    volume        4/3 pi sqrt(det S)                           (Scene's search volume, 1 sigma)
    information   1/2 log2 det(S R^-1) [bit]                   (Davison, ICCV 2005)

E = H P H', S = E + R. Only the last one has no unit, and compares points with lines.
"""

from __future__ import annotations

import math

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import Sensor


def score(sensor: Sensor, how: str, E: Mat, R: Mat) -> Vec:
    """Scores (N,) from E (N, m, m) and R (N, m, m)."""
    match how:
        case "trace":
            return sensor.selection_score(E)
        case "determinant":
            return np.linalg.det(E)
        case "volume":
            return 4.0 / 3.0 * math.pi * np.sqrt(np.maximum(np.linalg.det(E + R), 0.0))
        case "information":
            return 0.5 * np.log2(np.linalg.det(E + R) / np.linalg.det(R))
    raise ValueError(f"no selection score '{how}'")
