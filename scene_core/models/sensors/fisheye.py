"""A fisheye lens, as OpenCV calibrates it; it may see behind itself."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from scene_core.arrays import Vec
from scene_core.models import equidistant, radial
from scene_core.models.base import Backprojection, Projection
from scene_core.models.camera import Camera, Lens, pixels, unpixels
from scene_core.params import param


@dataclass(frozen=True)
class Fisheye(Camera):
    """h = (u0 + f_u q_x, v0 + f_v q_y),  q = p (1 + k1 theta^2 + k2 theta^4 + ...),
    p = theta (x, y) / r,  theta = atan2(r, z),  r = |(x, y)|

    theta is the angle to the optical axis [rad], beyond pi/2 behind the lens; h = (u, v) [px];
    k = (u0, v0, fu, fv, k1, k2, k3, k4) [px, 1]. Inverse by Newton's method with the Jacobian of
    the implicit function. Seen is what lies within `theta_max` and within the angle at which the
    polynomial folds.

    Source: Kannala, Brandt, *A generic camera model and calibration method for conventional,
    wide-angle, and fish-eye lenses*, PAMI 2006, in OpenCV's form (`cv::fisheye`).
    """

    name = "fisheye"
    calib_labels = ("u0", "v0", "fu", "fv", "k1", "k2", "k3", "k4")
    calib_units = ("px", "px", "px", "px", "", "", "", "")

    k1: float = param(0.0, lo=-100.0, hi=100.0, soft=(-0.2, 0.2), label="k1")
    """Distortion with the third power of the angle; all zero: an equidistant lens."""
    k2: float = param(0.0, lo=-100.0, hi=100.0, soft=(-0.1, 0.1), label="k2")
    """Distortion with its fifth power."""
    k3: float = param(0.0, lo=-100.0, hi=100.0, soft=(-0.1, 0.1), label="k3")
    """Distortion with its seventh power."""
    k4: float = param(0.0, lo=-100.0, hi=100.0, soft=(-0.1, 0.1), label="k4")
    """Distortion with its ninth power."""
    theta_max: float = param(
        1.92, unit="rad", lo=0.1, hi=3.1, soft=(0.8, 2.6), label="Half angle of view"
    )
    """Largest angle to the optical axis that the lens shows; 90 degrees: nothing behind it."""

    @property
    def calib0(self) -> Vec:
        centre = (self.u0, self.v0, self.f_u, self.f_v)
        return np.array([*centre, self.k1, self.k2, self.k3, self.k4])

    def with_calib(self, k: Vec) -> Self:
        k1, k2, k3, k4 = (float(x) for x in k[4:])
        return dataclasses.replace(self._with_centre(k), k1=k1, k2=k2, k3=k3, k4=k4)

    def image(self, p: Vec, k: Vec) -> Lens:
        return pixels(Lens(*radial.distort(p, k[4:])), k[2:4], k[:2])

    def unimage(self, h: Vec, k: Vec) -> Lens:
        q = unpixels(h, k[2:4], k[:2])
        p = radial.undistort(q.p, k[4:])
        by_k = np.concatenate([p.by_p @ q.by_k, p.by_d], axis=-1)
        return Lens(p.p, p.by_p @ q.by_p, by_k)

    def project(self, X: Vec, k: Vec) -> Projection:
        return equidistant.project(self.image, X, k)

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        return equidistant.backproject(self.unimage, z, n, k)

    def behind(self, X: Vec) -> np.ndarray:
        fold = radial.fold_radius((self.k1, self.k2, self.k3, self.k4))
        return equidistant.angle(X) >= min(self.theta_max, fold)
