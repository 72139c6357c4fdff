"""A point in a plane on a ray, for sensors that measure its bearing alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import TWO_D, wrap
from scene_core.models.base import FeatureModel, Normalised
from scene_core.models.features.point_2d import Point2D
from scene_core.models.ray_point import RayPoint

_IDENTITY = np.eye(4)


@dataclass(frozen=True)
class PlanarInverseDepth(RayPoint):
    """An anchor, a bearing and an inverse distance in the plane: X = (rho x0 + m(phi), rho)

    y = (z0, x0, phi, rho) [m, m, rad, 1/m]; m = (cos phi, sin phi), phi from z towards x. A first
    view leaves rho to the prior N(rho_mean, rho_sd^2). Converted to a 2-D point p = x0 + m / rho
    once, seen from c, 4 sigma_rho / rho^2 / |p - c| |cos(m, p - c)| < linearity.

    Source: Civera, Davison, Montiel, TRO 2008, in the plane of Davison, *Models and State
    Representation in Scene*, section 4.2.
    """

    name = "planar inverse depth"
    space = TWO_D
    state_labels = ("z0", "x0", "phi", "rho")
    state_units = ("m", "m", "rad", "1/m")

    def successor(self) -> FeatureModel:
        return Point2D()

    def direction(self, y: Vec) -> tuple[Vec, Mat]:
        """m (..., 2) and dm/dphi (..., 2, 1)."""
        c, s = np.cos(y[..., 2]), np.sin(y[..., 2])
        return np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)[..., None]

    def coordinates(self, m: Vec) -> tuple[Vec, Mat]:
        """phi (..., 1) of directions of any length."""
        z, x = m[..., 0], m[..., 1]
        J = np.stack([-x, z], axis=-1) / (z * z + x * x)[..., None]
        return np.arctan2(x, z)[..., None], J[..., None, :]

    def normalise(self, y: Vec) -> Normalised:
        """phi in (-pi, pi], and a negative rho raised to rho_min; the Jacobian is the identity."""
        value = y.copy()
        value[..., 2] = wrap(y[..., 2])
        value[..., 3] = self.in_front(y[..., 3])
        return Normalised(value, _IDENTITY)
