"""The unified model of central cameras: mirrors, and lenses beyond 90 degrees, by one number."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import Backprojection, Projection
from scene_core.models.camera import Camera, Lens, pixels, unpixels
from scene_core.params import param


@dataclass(frozen=True)
class Unified(Camera):
    """h = (u0 + f_u q_x, v0 + f_v q_y),  q = (x, y) / (z + xi d),  d = |(x, y, z)|

    A point is first put on the unit sphere and then seen from xi above its centre; h = (u, v) [px];
    k = (u0, v0, fu, fv, xi) [px, 1]. xi = 0: an ideal pinhole; 1: a parabolic mirror; between: a
    hyperbolic one. The inverse is closed,
        m = (g q, g - xi),  g = (xi + sqrt(1 + (1 - xi^2) |q|^2)) / (1 + |q|^2).
    Seen is what projects one to one: z > -xi d for xi <= 1, z > -d / xi beyond.

    Source: Geyer, Daniilidis, ECCV 2000; Mei, Rives, *Single view point omnidirectional camera
    calibration from planar grids*, ICRA 2007.
    """

    name = "unified"
    calib_labels = ("u0", "v0", "fu", "fv", "xi")
    calib_units = ("px", "px", "px", "px", "")

    xi: float = param(0.9, lo=0.0, hi=3.0, soft=(0.0, 2.0), label="xi")
    """How far above the sphere's centre it is seen from, in radii."""

    @property
    def calib0(self) -> Vec:
        return np.array([self.u0, self.v0, self.f_u, self.f_v, self.xi])

    def with_calib(self, k: Vec) -> Self:
        return dataclasses.replace(self._with_centre(k), xi=float(k[4]))

    def image(self, p: Vec, k: Vec) -> Lens:
        """Pixels of positions q = p on the plane above the sphere."""
        none = np.zeros((*p.shape, 0))
        lens = pixels(Lens(p, np.eye(2), none), k[2:4], k[:2])
        return lens._replace(by_k=np.concatenate([lens.by_k, np.zeros((*p.shape, 1))], axis=-1))

    def unimage(self, h: Vec, k: Vec) -> Lens:
        q = unpixels(h, k[2:4], k[:2])
        return q._replace(by_k=np.concatenate([q.by_k, np.zeros((*q.p.shape, 1))], axis=-1))

    def project(self, X: Vec, k: Vec) -> Projection:
        m, xi = X[..., :3], k[4]
        d = np.maximum(np.sqrt(np.vecdot(m, m)), 1e-9)
        s = np.maximum(m[..., 2] + xi * d, 1e-9 * d)
        q = m[..., :2] / s[..., None]
        ds = xi * m / d[..., None]
        ds[..., 2] += 1.0
        J = -q[..., :, None] * (ds / s[..., None])[..., None, :]
        J[..., 0, 0] += 1.0 / s
        J[..., 1, 1] += 1.0 / s
        lens = self.image(q, k)
        dh_by_dX = np.zeros((*q.shape, 4))
        dh_by_dX[..., :3] = lens.by_p @ J
        lens.by_k[..., 4] = -k[2:4] * q * (d / s)[..., None]
        return Projection(lens.p, dh_by_dX, lens.by_k)

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        lens, xi = self.unimage(z, k), k[4]
        q, r2 = lens.p, np.vecdot(lens.p, lens.p)
        root = np.sqrt(np.maximum(1.0 + (1.0 - xi * xi) * r2, 1e-12))
        g = (xi + root) / (1.0 + r2)
        X = np.concatenate([g[..., None] * q, (g - xi)[..., None], n], axis=-1)
        by_r2 = ((1.0 - xi * xi) / (2.0 * root) - g) / (1.0 + r2)
        dg = 2.0 * by_r2[..., None] * q
        J = np.empty((*q.shape[:-1], 3, 2))
        J[..., :2, :] = q[..., :, None] * dg[..., None, :]
        J[..., 0, 0] += g
        J[..., 1, 1] += g
        J[..., 2, :] = dg
        by_z, by_k = np.zeros((*X.shape, 2)), np.zeros((*X.shape, 5))
        by_z[..., :3, :], by_k[..., :3, :] = J @ lens.by_p, J @ lens.by_k
        by_xi = (1.0 - xi * r2 / root) / (1.0 + r2)
        by_k[..., :2, 4] = by_xi[..., None] * q
        by_k[..., 2, 4] = by_xi - 1.0
        by_n = np.zeros((4, 1))
        by_n[3, 0] = 1.0
        return Backprojection(X, by_z, by_n, by_k)

    def behind(self, X: Vec) -> np.ndarray:
        d = np.sqrt(np.vecdot(X[..., :3], X[..., :3]))
        return X[..., 2] <= -min(self.xi, 1.0 / max(self.xi, 1e-9)) * d
