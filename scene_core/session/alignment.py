"""Bringing an estimated trajectory into the axes of its reference before comparing the two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import Space, wrap

Alignment = Literal["none", "se2", "se3", "sim3"]
ALIGNMENTS: tuple[Alignment, ...] = get_args(Alignment)


@dataclass(frozen=True)
class Similarity:
    """p -> s R p + t."""

    s: float
    R: Mat
    t: Vec

    def points(self, p: Vec) -> Vec:
        """Positions (..., d) in the other axes."""
        return self.s * p @ self.R.T + self.t


def umeyama(space: Space, source: Vec, target: Vec, align: Alignment) -> Similarity | None:
    """The motion that brings positions of poses `source` (T, n) nearest to those of `target`.

    Rows with NaN are left out; None when too few are left. se2 and se3 keep the scale; a rotation
    that the positions do not determine (all on a line) is the smallest one in least squares.
    Source: S. Umeyama, IEEE PAMI 13(4), 1991, equations 34 to 43.
    """
    if align == "none":
        return Similarity(1.0, np.eye(space.d), np.zeros(space.d))
    good = np.isfinite(source).all(axis=1) & np.isfinite(target).all(axis=1)
    if good.sum() < 2:
        return None
    a, b = space.position(source[good]), space.position(target[good])
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    U, D, Vt = np.linalg.svd((b - mean_b).T @ (a - mean_a) / len(a))
    signs = np.ones(space.d)
    if np.linalg.det(U) * np.linalg.det(Vt) < 0:
        signs[-1] = -1.0
    R = U @ np.diag(signs) @ Vt
    variance = float(((a - mean_a) ** 2).sum() / len(a))
    s = float(D @ signs) / variance if align == "sim3" and variance > 0 else 1.0
    return Similarity(s, R, mean_b - s * R @ mean_a)


def aligned_poses(space: Space, by: Similarity, xp: Vec) -> Vec:
    """Poses (T, n) moved by a similarity: positions with the scale, orientations without."""
    out = np.array(xp)
    out[:, : space.d] = by.points(space.position(xp))
    if space.d == 2:
        # Rows of R act on (z, x); phi runs from z towards x.
        turn = np.arctan2(by.R[1, 0], by.R[0, 0])
        out[:, 2] = wrap(xp[:, 2] + turn)
    elif space.d == 3:
        out[:, 3:] = quaternion.product(quaternion.from_matrix(by.R), xp[:, 3:])
    return out
