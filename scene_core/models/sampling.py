"""Draws from the models' own noise, for simulation only."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.ellipses import roots
from scene_core.models.base import MotionModel


def gaussian(P: Mat, rng: np.random.Generator) -> Vec:
    """A draw (n,) from N(0, P), P (n, n) positive semi-definite."""
    return roots(P) @ rng.standard_normal(len(P))


def noisy_process(
    model: MotionModel, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator
) -> Vec:
    """xv after f with controls drawn from N(u, U) and process noise from N(0, Q), normalised."""
    moved = model.f(xv, u + gaussian(model.U(u, dt), rng), dt, k).fv
    q = gaussian(model.Q(xv, u, dt, k), rng)
    return model.normalise(moved + q).value
