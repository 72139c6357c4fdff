"""A feature whose depth is open, in a sensor's picture: ellipses along its ray."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.records import Predictions
from scene_core.filter.world import Feature, World

STRING_MAX = 7
"""At most this many ellipses along the ray of a partially initialised feature."""


@dataclass(frozen=True)
class String:
    """A partially initialised feature as ellipses along its ray: h and S given the free part."""

    h: Vec
    """(K, m)"""
    S: Mat
    """(m, m), the same for all."""


def string_along_ray(world: World, p: Predictions, i: int, feature: Feature) -> String | None:
    """h and S of a feature given its unmeasured component s, at values of s within +-2 sigma.

    From the joint covariance, c = cov(h, s) = H P[:, s]:  h(s) = h + c / P_ss (s - s0) and
    S(s) = S - c c' / P_ss. None when one ellipse says it all.
    """
    name = feature.model.unmeasured[0]
    if name not in feature.model.state_labels:
        return None
    block = world.gauss.layout[feature.block]
    at = block.start + feature.model.state_labels.index(name)
    P, mean = world.gauss.P, world.gauss.x[at]
    variance = P[at, at]
    if not variance > 0.0:
        return None
    c = np.zeros(p.h.shape[1])
    for role, H in p.H.items():
        rows = block.slice if role == "feature" else world.gauss.layout[role].slice
        c = c + H[i] @ P[rows, at]
    sd = np.sqrt(variance)
    S = p.E[i] + p.R[i] - np.outer(c, c) / variance
    low, high = max(-2.0, -mean / sd), 2.0
    axis = np.sqrt(max(np.linalg.eigvalsh(S)[0], 1e-12))
    length = float(np.linalg.norm(c) / sd * (high - low))
    count = min(STRING_MAX, 1 + int(length / (1.5 * axis)))
    if count < 3:
        return None
    s = np.linspace(low, high, count)
    return String(p.h[i] + s[:, None] * (c / sd), S)
