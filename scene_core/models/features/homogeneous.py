"""A point as a homogeneous point of the world, without an anchor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D
from scene_core.models.base import Glyphs, Initialised, Primitive, Redefined
from scene_core.models.rho_prior import RhoPrior


@dataclass(frozen=True)
class HomogeneousPoint(RhoPrior):
    """A point of projective space: X = y = (h, rho), p = h / rho

    y = (hx, hy, hz, rho) [1, 1/m]. The scale is that of the first view, from t along the unit ray
    m: h = m + rho t, so rho is the inverse distance from there. A first view leaves rho to the
    prior N(rho_mean, rho_sd^2). Never converted. rho may fall below zero, beyond infinity, where
    its image is still right: to raise it alone would turn the ray (NIS 9.4 for 2.0).

    Over-confident from a first view: h = m + rho t is linearised there, at the prior's rho, so h
    hardly depends on the error of t. When rho grows from .01 to its true .3 that dependence stays
    forgotten, and the landmark passes for a fixed point of the world: NEES 48 in the cloister (4
    seeds, 400 frames; inverse depth 6.0, the toolbox 264) with a NIS of 2.0. No scale of (h, rho)
    brings it back, nor another prior mean (.25: 66), the second moment of rho t (47) or conversion
    to Euclidean coordinates (58). An anchor until rho is known does: "anchored homogeneous" that
    becomes homogeneous at linearity .1 has 6.0, at .5 8.4, at 2 13.9. So does an update that
    carries the axes along (`Update.invariant`), for it tells that dependence anew: 5.1 (5 seeds).

    Source: Solà, Vidal-Calleja, Civera, Montiel, *Impact of landmark parametrization on monocular
    EKF-SLAM with points and lines*, IJCV 2012, "HP"; the toolbox's landmark "hmgPnt".
    """

    name = "homogeneous point"
    space = THREE_D
    state_labels = ("hx", "hy", "hz", "rho")
    state_units = ("", "", "", "1/m")

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        """X seen from xws, in the world."""
        return Initialised(*self.space.to_world(xws, X))

    def primitive(self, y: Vec) -> Primitive:
        return Primitive(y, np.eye(4))

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        seen = self.space.to_local(xpdef, y)
        return Redefined(seen.X, seen.by_X, seen.by_xp)

    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        """First-order Euclidean ellipsoid of p = h / rho; far away for a rho near zero or below."""
        rho = np.maximum(y[..., 3:], 1e-3)
        p = y[..., :3] / rho
        J = np.zeros((*p.shape, 4))
        J[..., (0, 1, 2), (0, 1, 2)] = 1.0 / rho
        J[..., 3] = -p / rho
        return Glyphs(p, J @ Pyy @ np.swapaxes(J, -1, -2))
