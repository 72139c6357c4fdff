"""A point on a ray with particles over its depth."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.geometry.spaces import THREE_D
from scene_core.models.base import FeatureModel
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.particle_ray import ParticleRay


@dataclass(frozen=True)
class RayWithParticles(ParticleRay):
    """Davison's partially initialised feature: X = (r + lam u, 1), or (rho r + u, rho)

    y = (rx, ry, rz, ux, uy, uz) [m, 1], |u| = 1; particles carry lam [m] or rho [1/m] until it is
    a Euclidean point.

    Source: Davison, *Real-Time Simultaneous Localisation and Mapping with a Single Camera*, ICCV
    2003, section 4.
    """

    name = "ray with particles"
    space = THREE_D
    state_labels = ("rx", "ry", "rz", "ux", "uy", "uz")
    state_units = ("m", "m", "m", "", "", "")

    def successor(self) -> FeatureModel:
        return EuclideanPoint()
