"""A point on a ray, kept so that a single view of it is enough."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D, wrap
from scene_core.models.base import FeatureModel, Normalised
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.ray_point import RayPoint
from scene_core.params import param

# World axes that play (a, b, c) in m = cos(p) cos(w) a + cos(p) sin(w) b + sin(p) c.
_AXES = {"z": (0, 1, 2), "y": (2, 0, 1)}
_IDENTITY = np.eye(6)


@dataclass(frozen=True)
class InverseDepth(RayPoint):
    """An anchor, a direction and an inverse distance: X = (rho x0 + m(pitch, yaw), rho)

    y = (x0, y0, z0, pitch, yaw, rho) [m, rad, 1/m]. With the pole along z
    m = (cp cy, cp sy, sp); along y, cyclically, m_z = cp cy, m_x = cp sy, m_y = sp.
    rho is inverse *distance*; a first view leaves it to the prior N(rho_mean, rho_sd^2).
    Converted to a Euclidean point p = x0 + m / rho once, seen from c,
    4 sigma_rho / rho^2 / |p - c| |cos(m, p - c)| < linearity.

    Source: Civera, Davison, Montiel, TRO 2008; Solà, *An EKF-SLAM toolbox in Matlab*, landmark
    "idpPnt" and its linearity test.
    """

    name = "inverse depth"
    space = THREE_D
    state_labels = ("x0", "y0", "z0", "pitch", "yaw", "rho")
    state_units = ("m", "m", "m", "rad", "rad", "1/m")

    pole: Literal["z", "y"] = param("z", choices=("z", "y"), effect="on reset", label="Pole")
    """World axis the pitch is measured towards: the vertical, so that level rays are regular."""

    def successor(self) -> FeatureModel:
        return EuclideanPoint()

    def direction(self, y: Vec) -> tuple[Vec, Mat]:
        """m (..., 3) and dm/d(pitch, yaw) (..., 3, 2)."""
        a, b, c = _AXES[self.pole]
        cp, sp = np.cos(y[..., 3]), np.sin(y[..., 3])
        cy, sy = np.cos(y[..., 4]), np.sin(y[..., 4])
        m, dm = np.empty((*cp.shape, 3)), np.zeros((*cp.shape, 3, 2))
        m[..., a], m[..., b], m[..., c] = cp * cy, cp * sy, sp
        dm[..., a, 0], dm[..., b, 0], dm[..., c, 0] = -sp * cy, -sp * sy, cp
        dm[..., a, 1], dm[..., b, 1] = -m[..., b], m[..., a]
        return m, dm

    def coordinates(self, m: Vec) -> tuple[Vec, Mat]:
        """(pitch, yaw) (..., 2) of directions of any length.

        Straight towards the pole the yaw is free; its derivative is bounded, not infinite.
        """
        a, b, c = _AXES[self.pole]
        va, vb, vc = m[..., a], m[..., b], m[..., c]
        flat2 = np.maximum(va * va + vb * vb, 1e-18 * (m * m).sum(-1))
        flat, length2 = np.sqrt(flat2), flat2 + vc * vc
        J = np.zeros((*m.shape[:-1], 2, 3))
        J[..., 0, a], J[..., 0, b] = -vc * va / (flat * length2), -vc * vb / (flat * length2)
        J[..., 0, c] = flat / length2
        J[..., 1, a], J[..., 1, b] = -vb / flat2, va / flat2
        return np.stack([np.arctan2(vc, flat), np.arctan2(vb, va)], axis=-1), J

    def normalise(self, y: Vec) -> Normalised:
        """yaw in (-pi, pi], and a negative rho raised to rho_min; the Jacobian is the identity."""
        value = y.copy()
        value[..., 4] = wrap(y[..., 4])
        value[..., 5] = self.in_front(y[..., 5])
        return Normalised(value, _IDENTITY)
