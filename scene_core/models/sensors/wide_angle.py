"""Davison's wide-angle camera."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.camera import Camera, Lens, unpixels
from scene_core.params import param


@dataclass(frozen=True)
class WideAngle(Camera):
    """h = c + g / sqrt(1 + 2 kd1 |g|^2),  g = (f_u x/z, f_v y/z)

    h = (u, v) [px]; k = (u0, v0, fu, fv, kd1) [px, 1/px^2]; the inverse is closed,
    g = (h - c) / sqrt(1 - 2 kd1 |h - c|^2), and ends at the radius 1/sqrt(2 kd1).
    R = sd_px^2 I, times (1 + |h - c|/|c|)^2 when it grows to the corner.

    Source: Davison, Reid, Molton, Stasse, *MonoSLAM*, PAMI 2007, section 3.3.
    """

    name = "wide-angle"
    calib_labels = ("u0", "v0", "fu", "fv", "kd1")
    calib_units = ("px", "px", "px", "px", "1/px²")

    border: float = param(20.0, unit="px", lo=0.0, hi=1000.0, soft=(0.0, 60.0), label="Border")
    """No feature is measured nearer than this to the border of the image."""
    kd1: float = param(9e-6, unit="1/px²", lo=-1e-3, hi=1e-3, soft=(0.0, 2e-5), label="kd1")
    """Strength of the barrel distortion; 0: an ideal pinhole."""
    sd_grows_to_corner: bool = param(True, label="Noise grows outwards")
    """Whether the noise doubles from the centre to the corner (MonoSLAM), or is the same
    everywhere."""

    @property
    def calib0(self) -> Vec:
        return np.array([self.u0, self.v0, self.f_u, self.f_v, self.kd1])

    def with_calib(self, k: Vec) -> Self:
        return dataclasses.replace(self._with_centre(k), kd1=float(k[4]))

    def image(self, p: Vec, k: Vec) -> Lens:
        g = k[2:4] * p
        t, by_g, by_kd1 = _bent(g, k[4])
        by_k = np.zeros((*p.shape, 5))
        by_k[..., 0, 0] = by_k[..., 1, 1] = 1.0
        by_k[..., 2:4] = by_g * p[..., None, :]
        by_k[..., 4] = by_kd1
        return Lens(k[:2] + t, by_g * k[2:4], by_k)

    def unimage(self, h: Vec, k: Vec) -> Lens:
        g, by_hc, by_kd1 = _bent(h - k[:2], -k[4])
        flat = unpixels(g, k[2:4], np.zeros(2))
        by_k = np.empty((*h.shape, 5))
        by_k[..., :2] = -(flat.by_p @ by_hc)
        by_k[..., 2:4] = flat.by_k[..., 2:]
        by_k[..., 4] = -by_kd1 / k[2:4]
        return Lens(flat.p, flat.by_p @ by_hc, by_k)

    def in_domain(self, X: Vec) -> np.ndarray | bool:
        if self.kd1 >= 0.0:
            return True
        g = X[..., :2] * (self.f_u, self.f_v)
        return X[..., 2] ** 2 + 2.0 * self.kd1 * np.vecdot(g, g) > 0.0

    def R(self, h: Vec) -> Mat:
        if not self.sd_grows_to_corner:
            return super().R(h)
        c = np.array([self.u0, self.v0])
        offset = h - c
        growth = 1.0 + np.sqrt(np.vecdot(offset, offset) / (c @ c))
        return ((self.sd_px * growth) ** 2)[..., None, None] * np.eye(2)


def _bent(g: Vec, kd1: float) -> tuple[Vec, Mat, Vec]:
    """t = g / sqrt(1 + 2 kd1 |g|^2), dt/dg and dt/dkd1; the inverse is the same with -kd1.

    Where the root has no real value (no ray belongs to that pixel) it is taken at the edge.
    """
    g2 = np.vecdot(g, g)
    a = np.maximum(1.0 + 2.0 * kd1 * g2, 1e-3)
    s = 1.0 / np.sqrt(a)
    s3 = s / a
    by_g = (-2.0 * kd1 * s3)[..., None, None] * (g[..., :, None] * g[..., None, :])
    by_g[..., 0, 0] += s
    by_g[..., 1, 1] += s
    return s[..., None] * g, by_g, -(s3 * g2)[..., None] * g
