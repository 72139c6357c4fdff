"""A point in a plane on a ray with particles over its depth."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.geometry.spaces import TWO_D
from scene_core.models.features.inverse_depth_2d import PlanarInverseDepth
from scene_core.models.particle_ray import ParticleRay
from scene_core.models.ray_point import RayPoint


@dataclass(frozen=True)
class PlanarRayWithParticles(ParticleRay):
    """A bearing-only landmark of the plane: X = (r + lam u, 1), or (rho r + u, rho)

    y = (rz, rx, uz, ux) [m, 1], |u| = 1; particles carry lam [m] or rho [1/m] until it is a
    point in planar inverse depth (r, phi, rho).

    Source: Davison, ICCV 2003, section 4, in the plane; Bailey, *Constrained Initialisation for
    Bearing-Only SLAM*, ICRA 2003.
    """

    name = "planar ray with particles"
    space = TWO_D
    state_labels = ("rz", "rx", "uz", "ux")
    state_units = ("m", "m", "", "")

    def successor(self) -> RayPoint:
        return PlanarInverseDepth()
