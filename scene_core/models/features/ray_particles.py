"""A point on a ray with particles over its depth."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.geometry.spaces import THREE_D
from scene_core.models.features.anchored_homogeneous import AnchoredHomogeneous
from scene_core.models.particle_ray import ParticleRay
from scene_core.models.ray_point import RayPoint


@dataclass(frozen=True)
class RayWithParticles(ParticleRay):
    """Davison's partially initialised feature: X = (r + lam u, 1), or (rho r + u, rho)

    y = (rx, ry, rz, ux, uy, uz) [m, 1], |u| = 1; particles carry lam [m] or rho [1/m] until it is
    an anchored homogeneous point (r, u, rho).

    Source: Davison, *Real-Time Simultaneous Localisation and Mapping with a Single Camera*, ICCV
    2003, section 4.
    """

    name = "ray with particles"
    space = THREE_D
    state_labels = ("rx", "ry", "rz", "ux", "uy", "uz")
    state_units = ("m", "m", "m", "", "", "")

    def successor(self) -> RayPoint:
        return AnchoredHomogeneous()
