"""The camera of the inverse-depth papers, calibrated by photogrammetry."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from scene_core.arrays import Vec
from scene_core.models import radial
from scene_core.models.camera import Camera, Lens
from scene_core.params import param


@dataclass(frozen=True)
class Civera(Camera):
    """a = b (1 + k1 |b|^2 + k2 |b|^4),  a = (dx f_u x/z, dy f_v y/z),  h = c + (b_x/dx, b_y/dy)

    a and b are the ideal and the distorted position on the sensor [mm], dx and dy the size of a
    pixel [mm]. h = (u, v) [px]; k = (u0, v0, fu, fv, k1, k2) [px, 1/mm^2, 1/mm^4]. Here the inverse
    is the polynomial; the projection takes Newton's method with the implicit Jacobian.

    Source: Civera, Davison, Montiel, *Inverse Depth Parametrization for Monocular SLAM*, TRO 2008,
    section III-C, after Mikhail, Bethel, McGlone, *Introduction to Modern Photogrammetry*.
    """

    name = "Civera"
    calib_labels = ("u0", "v0", "fu", "fv", "k1", "k2")
    calib_units = ("px", "px", "px", "px", "1/mm²", "1/mm⁴")

    k1: float = param(0.06, unit="1/mm²", lo=-10.0, hi=10.0, soft=(-0.1, 0.1), label="k1")
    """First coefficient of the radial distortion, radii in mm on the sensor."""
    k2: float = param(0.013, unit="1/mm⁴", lo=-10.0, hi=10.0, soft=(-0.02, 0.02), label="k2")
    """Second coefficient of the radial distortion."""
    dx_mm: float = param(0.0112, unit="mm", lo=1e-5, hi=1.0, effect="on reset", label="Pixel width")
    """Width of a pixel on the sensor."""
    dy_mm: float = param(
        0.0112, unit="mm", lo=1e-5, hi=1.0, effect="on reset", label="Pixel height"
    )
    """Height of a pixel on the sensor."""

    @property
    def calib0(self) -> Vec:
        return np.array([self.u0, self.v0, self.f_u, self.f_v, self.k1, self.k2])

    def with_calib(self, k: Vec) -> Self:
        return dataclasses.replace(self._with_centre(k), k1=float(k[4]), k2=float(k[5]))

    @property
    def _mm(self) -> Vec:
        return np.array([self.dx_mm, self.dy_mm])

    def image(self, p: Vec, k: Vec) -> Lens:
        mm = self._mm
        b = radial.undistort(mm * k[2:4] * p, k[4:])
        h_by_a = b.by_p * (mm / mm[:, None])
        by_k = np.zeros((*p.shape, 6))
        by_k[..., 0, 0] = by_k[..., 1, 1] = 1.0
        by_k[..., 2:4] = h_by_a * p[..., None, :]
        by_k[..., 4:] = b.by_d / mm[:, None]
        return Lens(k[:2] + b.p / mm, h_by_a * k[2:4], by_k)

    def unimage(self, h: Vec, k: Vec) -> Lens:
        mm = self._mm
        a = radial.distort((h - k[:2]) * mm, k[4:])
        scale = 1.0 / (mm * k[2:4])
        p = a.p * scale
        by_h = scale[:, None] * a.by_p * mm
        by_k = np.zeros((*h.shape, 6))
        by_k[..., :2] = -by_h
        by_k[..., 0, 2], by_k[..., 1, 3] = -p[..., 0] / k[2], -p[..., 1] / k[3]
        by_k[..., 4:] = scale[:, None] * a.by_d
        return Lens(p, by_h, by_k)

    def in_domain(self, X: Vec) -> np.ndarray | bool:
        fold = radial.fold_radius((self.k1, self.k2))
        if fold == np.inf:
            return True
        a = X[..., :2] * (self.dx_mm * self.f_u, self.dy_mm * self.f_v)
        most = fold * (1.0 + self.k1 * fold**2 + self.k2 * fold**4)
        return np.vecdot(a, a) < (most * X[..., 2]) ** 2
