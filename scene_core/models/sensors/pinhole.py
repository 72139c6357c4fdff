"""A pinhole camera with radial distortion of any order."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from scene_core.arrays import Vec
from scene_core.models import radial
from scene_core.models.camera import Camera, Lens, pixels, unpixels
from scene_core.params import param


@dataclass(frozen=True)
class Pinhole(Camera):
    """h = (u0 + f_u q_x, v0 + f_v q_y),  q = p (1 + d2 r^2 + d4 r^4 + ...),  p = (x/z, y/z)

    r = |p|; h = (u, v) [px]; k = (u0, v0, fu, fv, d2, d4, ...) [px, 1].
    Inverse by Newton's method with the Jacobian of the implicit function.

    Seen is what lies within the radius at which the polynomial folds.

    Source: Solà, *An EKF-SLAM toolbox in Matlab*, sensor "pinHole", whose inverse is a second
    polynomial fitted to the first, and whose lines know of no distortion; OpenCV's k1, k2, k3 are
    d2, d4, d6.
    """

    name = "pinhole"

    distortion: tuple[float, ...] = param((), lo=-100.0, hi=100.0, soft=(-1.0, 1.0))
    """Coefficients d2, d4, ... of the radial distortion, as many as there are; none: an ideal
    pinhole."""

    @property
    def calib_labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As many d as the lens has coefficients."""
        return ("u0", "v0", "fu", "fv", *(f"d{2 * i + 2}" for i in range(len(self.distortion))))

    @property
    def calib_units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("px",) * 4 + ("",) * len(self.distortion)

    @property
    def calib0(self) -> Vec:
        return np.array([self.u0, self.v0, self.f_u, self.f_v, *self.distortion])

    def with_calib(self, k: Vec) -> Self:
        return dataclasses.replace(self._with_centre(k), distortion=tuple(float(d) for d in k[4:]))

    def image(self, p: Vec, k: Vec) -> Lens:
        return pixels(Lens(*radial.distort(p, k[4:])), k[2:4], k[:2])

    def unimage(self, h: Vec, k: Vec) -> Lens:
        flat = unpixels(h, k[2:4], k[:2])
        p = radial.undistort(flat.p, k[4:])
        by_k = np.concatenate([p.by_p @ flat.by_k, p.by_d], axis=-1)
        return Lens(p.p, p.by_p @ flat.by_p, by_k)

    def in_domain(self, X: Vec) -> np.ndarray | bool:
        fold = radial.fold_radius(self.distortion)
        if fold == np.inf:
            return True
        return np.vecdot(X[..., :2], X[..., :2]) < (fold * X[..., 2]) ** 2
