"""A point as an anchor and a homogeneous point seen from there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D
from scene_core.models.base import Converted, FeatureModel, Normalised
from scene_core.models.features.homogeneous import HomogeneousPoint
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.ray_point import RayPoint
from scene_core.params import param


@dataclass(frozen=True)
class AnchoredHomogeneous(RayPoint):
    """An anchor, a vector and an inverse scale: X = (rho x0 + v, rho)

    y = (x0, y0, z0, vx, vy, vz, rho) [m, 1, 1/m]; v is a unit vector, so that rho is an inverse
    distance: after an update (v, rho) are divided by |v|, which leaves the point where it is. No
    direction is singular. A first view leaves rho to the prior N(rho_mean, rho_sd^2). Converted to
    a Euclidean point p = x0 + v / rho, or to a homogeneous one (rho x0 + v, rho), once, seen from
    c, 4 sigma_rho / rho^2 / |p - c| |cos(v, p - c)| < linearity.

    Source: Solà, Vidal-Calleja, Civera, Montiel, *Impact of landmark parametrization on monocular
    EKF-SLAM with points and lines*, IJCV 2012, "AHP"; the toolbox's landmark "ahmPnt", which lets
    |v| drift.
    """

    name = "anchored homogeneous"
    space = THREE_D
    state_labels = ("x0", "y0", "z0", "vx", "vy", "vz", "rho")
    state_units = ("m", "m", "m", "", "", "", "1/m")

    becomes: Literal["Euclidean point", "homogeneous point"] = param(
        "Euclidean point", choices=("Euclidean point", "homogeneous point"), label="Becomes"
    )
    """What it is converted to."""

    def successor(self) -> FeatureModel:
        return EuclideanPoint() if self.becomes == "Euclidean point" else HomogeneousPoint()

    def convert(self, y: Vec) -> Converted:
        if self.becomes == "Euclidean point":
            return Converted(*self.place(y))
        return Converted(*self.primitive(y))

    def direction(self, y: Vec) -> tuple[Vec, Mat]:
        return y[..., 3:6], np.eye(3)

    def coordinates(self, m: Vec) -> tuple[Vec, Mat]:
        return m, np.eye(3)

    def normalise(self, y: Vec) -> Normalised:
        """(v, rho) / |v| with the exact Jacobian, and a negative rho raised to rho_min.

        d(v/|v|) = (I - u u') / |v| dv,  d(rho/|v|) = (drho - rho/|v| u' dv) / |v|,  u = v/|v|.
        """
        v, rho = y[..., 3:6], y[..., 6]
        length = np.sqrt(np.vecdot(v, v))
        u, scaled = v / length[..., None], rho / length
        value = np.concatenate([y[..., :3], u, self.in_front(scaled)[..., None]], axis=-1)
        J = np.zeros((*y.shape, 7))
        J[..., (0, 1, 2), (0, 1, 2)] = 1.0
        along = np.eye(3) - u[..., :, None] * u[..., None, :]
        J[..., 3:6, 3:6] = along / length[..., None, None]
        J[..., 6, 3:6] = -(scaled / length)[..., None] * u
        J[..., 6, 6] = 1.0 / length
        return Normalised(value, J)
