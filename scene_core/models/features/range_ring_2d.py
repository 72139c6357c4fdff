"""A point in a plane of which only the distance is known: a ring of particles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.geometry.spaces import TWO_D, wrap
from scene_core.models.base import (
    FeatureModel,
    FreePrimitive,
    Glyphs,
    Initialised,
    Particles,
    Primitive,
    Redefined,
    Settled,
)
from scene_core.models.features.point_2d import Point2D
from scene_core.models.ordered import demand_order
from scene_core.params import param

_CENTRE = np.diag([1.0, 1.0, 0.0])


@dataclass(frozen=True)
class PlanarRangeRing(FeatureModel):
    """A circle around the place of the first view: X = (z0 + r cos b, x0 + r sin b, 1)

    y = (z0, x0, r) [m]; particles carry the bearing b [rad] in the world, from z towards x. Driven
    past in a straight line two of them fit, on either side of it; a turn tells them apart. Once
    what is left is one arc of a standard deviation below `ratio` radians, all of it on one side, it
    is a 2-D point.

    Source: Blanco, Fernandez-Madrigal, Gonzalez, *Efficient Probabilistic Range-Only SLAM*, IROS
    2008; Davison, ICCV 2003, section 4, for the particles.
    """

    name = "planar range ring"
    space = TWO_D
    state_labels = ("z0", "x0", "r")
    state_units = ("m", "m", "m")
    free_labels = ("bearing",)
    free_units = ("rad",)
    unmeasured = ("bearing",)
    # A right mirror image falls so low by chance in at most one match of 50,000: of those of eight
    # rings that wait for 200 matches each 3 % at most are lost; at 0.05 all would be.
    prune = 1e-4

    particles: int = param(
        720, lo=8, hi=5000, soft=(36, 1440), effect="next feature", label="Particles"
    )
    """How many places on the ring a new feature starts with."""
    min_particles: int = param(
        3, lo=1, hi=1000, soft=(2, 30), label="Particles, min", below="particles"
    )
    """With fewer left it is given up: their spread would be that of the grid."""
    ratio: float = param(0.1, lo=1e-3, hi=1.0, soft=(0.02, 0.5), label="Spread, max")
    """Converted when the place is known to this part of the range. An arc is no ellipse: at 0.3, as
    for rays, its ends lie off the tangent by more than a range is known to."""

    def __post_init__(self) -> None:
        demand_order(self)

    def successor(self) -> FeatureModel:
        return Point2D()

    def prior(self) -> tuple[Vec, Mat]:
        return np.zeros(1), np.zeros((1, 1))

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        """y = (t, |m| / w) for a sensor at t and X = (m, w).

        Raises ValueError where w <= 0: there is no ring at infinity.
        """
        m, w = X[..., :2], X[..., 2:]
        if not (w > 0.0).all():
            raise ValueError("a point at infinity has no range: it takes a sensor that measures it")
        length = np.linalg.norm(m, axis=-1, keepdims=True)
        t = np.broadcast_to(self.space.position(xws), m.shape)
        y = np.concatenate([t, length / w], axis=-1)
        by_X = np.zeros((*y.shape, 3))
        by_X[..., 2, :2] = m / (length * w)
        by_X[..., 2, 2:] = -length / w**2
        return Initialised(y, _CENTRE, by_X)

    def primitive(self, y: Vec) -> Primitive:
        """The centre of the ring."""
        X = np.ones_like(y)
        X[..., :2] = y[..., :2]
        return Primitive(X, _CENTRE)

    def point(self, y: Vec, lam: Vec) -> FreePrimitive:
        y, b = np.broadcast_arrays(y, lam[..., :1])
        at, by_y, by_b = _on_ring(y, b[..., 0])
        X = np.concatenate([at, np.ones_like(at[..., :1])], axis=-1)
        flat = np.zeros((*X.shape[:-1], 1, 3))
        by_lam = np.concatenate([by_b, np.zeros_like(by_b[..., :1])], axis=-1)[..., None]
        return FreePrimitive(X, np.concatenate([by_y, flat], axis=-2), by_lam)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        seen = self.space.to_local(xpdef, self.primitive(y).X)
        value = np.concatenate([seen.X[..., :2], y[..., 2:]], axis=-1)
        by_state = np.zeros((*y.shape, 3))
        by_state[..., :2, :2] = seen.by_X[..., :2, :2]
        by_state[..., 2, 2] = 1.0
        by_xpdef = np.zeros((*y.shape, 3))
        by_xpdef[..., :2, :] = seen.by_xp[..., :2, :]
        return Redefined(value, by_state, by_xpdef)

    def redefine_free(self, lam: Vec, xpdef: Vec) -> Vec:
        return wrap(lam - xpdef[2])

    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        """The disc of the ring: what is known before the particles say more."""
        r2 = (y[..., 2] ** 2)[..., None, None]
        return Glyphs(y[..., :2], Pyy[..., :2, :2] + 0.5 * r2 * np.eye(2))

    def particles0(self) -> Particles:
        n = self.particles
        b = wrap(2.0 * np.pi * np.arange(1, n + 1) / n)
        return Particles(frozen(np.sort(b)[:, None]), frozen(np.full(n, 1.0 / n)))

    def moments(self, particles: Particles) -> tuple[Vec, Mat]:
        """Circular mean (1,), and the mean square (1, 1) of the angles off it."""
        b, w = particles.lam[:, 0], particles.w
        mean = np.arctan2(w @ np.sin(b), w @ np.cos(b))
        off = wrap(b - mean)
        return np.array([mean]), np.array([[w @ off**2]])

    def spent(self, particles: Particles) -> bool:
        return len(particles.w) < self.min_particles

    def settled(self, y: Vec, particles: Particles) -> bool:
        """One arc, no wider than `ratio`: the particles left are neighbours on the ring."""
        if self.spent(particles) or self.moments(particles)[1][0, 0] >= self.ratio**2:
            return False
        b = np.sort(particles.lam[:, 0])
        gaps = np.diff(b, append=b[0] + 2.0 * np.pi)
        return int(np.count_nonzero(gaps > 3.0 * np.pi / self.particles)) <= 1

    def settle(self, y: Vec, lam: Vec) -> Settled:
        y, b = np.broadcast_arrays(y, lam[..., :1])
        at, by_y, by_b = _on_ring(y, b[..., 0])
        return Settled(at, by_y, by_b[..., None])


def _on_ring(y: Vec, b: Vec) -> tuple[Vec, Mat, Vec]:
    """The place (..., 2) at the bearing b (...,), its Jacobians by y (..., 2, 3) and by b."""
    c, s = np.cos(b), np.sin(b)
    unit, r = np.stack([c, s], axis=-1), y[..., 2:]
    by_y = np.zeros((*unit.shape, 3))
    by_y[..., (0, 1), (0, 1)] = 1.0
    by_y[..., 2] = unit
    return y[..., :2] + r * unit, by_y, r * np.stack([-s, c], axis=-1)
