"""Rays by their angle to the optical axis, for lenses that see to 90 degrees and beyond.

p = theta (x, y) / r,  r = |(x, y)|,  theta = atan2(r, z) in [0, pi]

is regular everywhere but straight behind, where the plane p = (x, y) / z ends at 90 degrees. A
camera that maps p to pixels gets its projection and backprojection here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import Backprojection, Projection
from scene_core.models.camera import Lens


def angle(X: Vec) -> Vec:
    """theta (...,) [rad] of points X (..., 4); pi for the camera itself, which is not seen."""
    r = np.sqrt(np.vecdot(X[..., :2], X[..., :2]))
    return np.where((r > 0.0) | (X[..., 2] > 0.0), np.arctan2(r, X[..., 2]), np.pi)


def flat(X: Vec) -> tuple[Vec, Mat]:
    """p (..., 2) [rad] and dp/d(x, y, z) (..., 2, 3) of points X (..., 4), bounded straight behind.

    With g = theta / r and n^2 = r^2 + z^2: dp = g dx + (z / n^2 - g) / r^2 x x' dx - x / n^2 dz.
    """
    x, z = X[..., :2], X[..., 2]
    r2 = np.vecdot(x, x)
    n2 = np.maximum(r2 + z * z, 1e-24)
    near = (r2 < 1e-6 * n2) & (z > 0.0)
    r = np.sqrt(np.maximum(np.where(near, 1.0, r2), 1e-18 * n2))
    iz = 1.0 / np.where(near, z, 1.0)
    t2 = np.where(near, r2, 0.0) * iz * iz
    # On the axis both quotients are their series in (r / z)^2.
    g = np.where(near, iz * (1.0 - t2 / 3.0 + t2 * t2 / 5.0), np.arctan2(r, z) / r)
    bend = np.where(near, iz**3 * (-2.0 / 3.0 + 0.8 * t2), (z / n2 - g) / (r * r))
    J = np.empty((*x.shape, 3))
    J[..., :2] = (bend[..., None] * x)[..., :, None] * x[..., None, :]
    J[..., 0, 0] += g
    J[..., 1, 1] += g
    J[..., 2] = -x / n2[..., None]
    return g[..., None] * x, J


def ray(p: Vec) -> tuple[Vec, Mat]:
    """Unit rays m = (S p, cos theta), S = sin(theta) / theta, theta = |p|; dm/dp (..., 3, 2)."""
    t2 = np.vecdot(p, p)
    small = t2 < 1e-4
    theta = np.sqrt(np.where(small, 1.0, t2))
    s2 = np.where(small, t2, 0.0)
    cos = np.where(small, 1.0 - s2 / 2.0 + s2 * s2 / 24.0, np.cos(theta))
    S = np.where(small, 1.0 - s2 / 6.0 + s2 * s2 / 120.0, np.sin(theta) / theta)
    bend = np.where(small, -1.0 / 3.0 + s2 / 30.0, (cos - S) / theta**2)
    m = np.empty((*p.shape[:-1], 3))
    m[..., :2], m[..., 2] = S[..., None] * p, cos
    J = np.empty((*m.shape, 2))
    J[..., :2, :] = (bend[..., None] * p)[..., :, None] * p[..., None, :]
    J[..., 0, 0] += S
    J[..., 1, 1] += S
    J[..., 2, :] = -S[..., None] * p
    return m, J


def project(image: Callable[[Vec, Vec], Lens], X: Vec, k: Vec) -> Projection:
    """h of points X (..., 4) through the lens `image` from p to pixels."""
    p, J = flat(X)
    lens = image(p, k)
    dh_by_dX = np.zeros((*p.shape, 4))
    dh_by_dX[..., :3] = lens.by_p @ J
    return Projection(lens.p, dh_by_dX, lens.by_k)


def backproject(unimage: Callable[[Vec, Vec], Lens], z: Vec, n: Vec, k: Vec) -> Backprojection:
    """Unit rays and w = n (..., 1) [1/m] of pixels z (..., 2), through `unimage` from them to p."""
    lens = unimage(z, k)
    m, J = ray(lens.p)
    X = np.concatenate([m, n], axis=-1)
    by_z, by_k = np.zeros((*X.shape, 2)), np.zeros((*X.shape, lens.by_k.shape[-1]))
    by_z[..., :3, :] = J @ lens.by_p
    by_k[..., :3, :] = J @ lens.by_k
    by_n = np.zeros((4, 1))
    by_n[3, 0] = 1.0
    return Backprojection(X, by_z, by_n, by_k)
