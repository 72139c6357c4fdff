"""A line as an anchor and its Plücker coordinates seen from there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models import plucker
from scene_core.models.base import (
    Converted,
    FeatureModel,
    Initialised,
    Normalised,
    Primitive,
    Redefined,
)
from scene_core.models.euclidean import with_w
from scene_core.models.features.plucker_line import PluckerLine
from scene_core.models.ray_point import linearity_index
from scene_core.models.straight_line import StraightLine
from scene_core.params import param


@dataclass(frozen=True)
class AnchoredPluckerLine(StraightLine):
    """An anchor, the normal of the plane through it and the line, and the line's direction:
    y = (x0, n, v)

    y = (x0, y0, z0, nx, ny, nz, vx, vy, vz) [m, 1, 1/m], n = (p - x0) x v for every point p of the
    line, |n| = 1, n . v = 0; both are imposed again after every update, by what v must give, since
    n is what the first view measured. |v| is the inverse distance from the anchor. From a view
    r1, r2 of both ends in a sensor at (R, t) x0 = t, n = R (r1 x r2), v = R (rho1 r2 - rho2 r1),
    both divided by |r1 x r2|. Linear in rho, which a first view leaves to the prior
    N(rho_mean, rho_sd^2). t is the angle at the anchor from the line's nearest point.

    As consistent as an "inverse depth line": NEES 7.3 round the house (5 seeds, 400 frames; the
    toolbox 30) for 6.9. It takes the constraint, with its exact Jacobian (15 without, 2 seeds), and
    ends that are looked for where they were seen last: in metres along a line of unknown distance
    they left the image, and the line was found again too late (NIS 6.1 for 2.0, 3 lines lost in a
    run).

    Source: Solà, Vidal-Calleja, Civera, Montiel, *Impact of landmark parametrization on monocular
    EKF-SLAM with points and lines*, IJCV 2012, "APL"; the toolbox's landmark "aplLin".
    """

    name = "anchored Plücker line"
    state_labels = ("x0", "y0", "z0", "nx", "ny", "nz", "vx", "vy", "vz")
    state_units = ("m", "m", "m", "", "", "", "1/m", "1/m", "1/m")
    shown = (-0.5, 0.5)

    linearity: float = param(0.0, lo=0.0, hi=10.0, soft=(0.0, 0.5), label="Linearity")
    """Converted to a Plücker line below this linearity index. 0: never."""

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        in_sensor, by_X = plucker.join(X)
        scaled, by_L = plucker.unit_normal(in_sensor)
        here = np.concatenate([np.zeros(3), xws[3:]])
        turned = plucker.to_world(here, scaled)
        y = np.empty((*X.shape[:-1], 9))
        y[..., :3], y[..., 3:] = xws[:3], turned.L
        by_xws, dy_by_dX = np.zeros((*y.shape, 7)), np.zeros((*y.shape, 8))
        by_xws[..., :3, :3] = np.eye(3)
        by_xws[..., 3:, 3:] = turned.by_xp[..., 3:]
        dy_by_dX[..., 3:, :] = turned.by_L @ by_L @ by_X
        return Initialised(y, by_xws, dy_by_dX)

    def primitive(self, y: Vec) -> Primitive:
        L, scaled = plucker.unit_normal(y[..., 3:])
        X, by_L = plucker.pair(L)
        by_L = by_L @ scaled
        by_y = np.zeros((*X.shape, 9))
        by_y[..., 3:] = by_L
        for at, w in ((slice(0, 3), 3), (slice(4, 7), 7)):
            by_y[..., at, :3] = X[..., w, None, None] * np.eye(3)
            by_y[..., at, 3:] += y[..., :3, None] * by_L[..., w, None, :]
        return Primitive(_from_anchor(X, y[..., :3]), by_y)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        place = self.space.to_local(xpdef, with_w(y[..., :3], 1.0))
        turn = plucker.to_local(np.concatenate([np.zeros(3), xpdef[3:]]), y[..., 3:])
        by_state, by_xpdef = np.zeros((*y.shape, 9)), np.zeros((*y.shape, 7))
        by_state[..., :3, :3], by_state[..., 3:, 3:] = place.by_X[..., :3, :3], turn.by_L
        by_xpdef[..., :3, :] = place.by_xp[..., :3, :]
        by_xpdef[..., 3:, 3:] = turn.by_xp[..., 3:]
        value = np.concatenate([place.X[..., :3], turn.L], axis=-1)
        return Redefined(value, by_state, by_xpdef)

    def normalise(self, y: Vec) -> Normalised:
        value, J = y.copy(), np.zeros((*y.shape, 9))
        J[..., :3, :3] = np.eye(3)
        value[..., 3:], J[..., 3:, 3:] = plucker.unit_normal(y[..., 3:])
        return Normalised(value, J)

    def ends(self, y: Vec, t: Vec) -> Vec:
        return _from_anchor(plucker.ends(y[..., 3:], t), y[..., :3])

    def along(self, y: Vec, origin: Vec, rays: Vec) -> Vec:
        return plucker.angles(y[..., None, 3:], origin - y[..., None, :3], rays)

    def successor(self) -> FeatureModel | None:
        if not self.linearity:
            return None
        return PluckerLine(rho_mean=self.rho_mean, rho_sd=self.rho_sd, far=self.far)

    def ready(self, y: Vec, Pyy: Mat, xws: Vec) -> np.ndarray:
        X = plucker.ends(y[..., 3:], np.zeros((*y.shape[:-1], 2)))
        m, rho = X[..., :3], X[..., 3]
        variance = np.trace(Pyy[..., 6:, 6:], axis1=-2, axis2=-1)
        p = y[..., :3] + m / np.maximum(rho, 1e-9)[..., None]
        return linearity_index(m, rho, variance, p - self.space.position(xws)) < self.linearity

    def convert(self, y: Vec) -> Converted:
        """(n + x0 x v, v)."""
        x0, v = y[..., :3], y[..., 6:]
        J = np.zeros((*y.shape[:-1], 6, 9))
        J[..., :3, :3], J[..., :3, 6:] = -plucker.cross_matrix(v), plucker.cross_matrix(x0)
        J[..., range(6), range(3, 9)] = 1.0
        return Converted(np.concatenate([y[..., 3:6] + np.cross(x0, v), v], axis=-1), J)


def _from_anchor(X: Vec, x0: Vec) -> Vec:
    """Two points X (..., 8) seen from x0, in the axes of the world."""
    out = X.copy()
    out[..., :3] += X[..., 3:4] * x0
    out[..., 4:7] += X[..., 7:8] * x0
    return out
