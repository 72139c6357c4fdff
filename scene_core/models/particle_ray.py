"""Points on a ray whose place along it is carried by particles, until they agree.

y = (r, u): where the ray begins [m] and its direction, a unit vector of the world. The free
parameter is the depth lam [m], X = (r + lam u, 1), or the inverse depth rho [1/m],
X = (rho r + u, rho), which reaches infinity and is regular there.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.models.base import (
    FeatureModel,
    FreePrimitive,
    Glyphs,
    Initialised,
    Normalised,
    Particles,
    Primitive,
    Redefined,
    Settled,
)
from scene_core.models.euclidean import with_w
from scene_core.models.ordered import demand_order
from scene_core.models.ray_point import RayPoint, first_view
from scene_core.params import ParamError, param


@dataclass(frozen=True)
class ParticleRay(FeatureModel):
    """y = (r, u) with particles over the depth or the inverse depth; see the module.

    The particles start uniform: lam_i = min + (max - min) i / n, or rho_i from 1 / min to 0. When
    their standard deviation falls below `ratio` of their mean the point is (r, u, rho), Gaussian
    in rho = 1 / lam, and becomes p = r + u / rho when that is linear. As p from the start, as in
    SceneLib, it is over-confident: linear in p is only what is known to a tenth of its depth, and
    after that the circle in the cloister still has a NEES of 9.9 for 6 (20 seeds).

    Source: Davison, ICCV 2003, section 4; SceneLib 1.0's numbers (100 particles from 0.5 to 5 m).
    """

    unmeasured = ("rho",)

    uniform_in: Literal["depth", "inverse depth"] = param(
        "depth", choices=("depth", "inverse depth"), effect="on reset", label="Uniform in"
    )
    """depth: no point lies beyond the largest depth. inverse depth: from the smallest depth to
    infinity, more densely where parallax is large."""
    min_depth: float = param(
        0.5,
        unit="m",
        lo=1e-3,
        hi=1e4,
        soft=(0.1, 5.0),
        effect="next feature",
        label="Depth, min",
        below="max_depth",
    )
    """No point is nearer than this to its first view."""
    max_depth: float = param(
        5.0, unit="m", lo=1e-2, hi=1e6, soft=(1.0, 50.0), effect="next feature", label="Depth, max"
    )
    """Uniform in depth: no point is farther. Uniform in inverse depth: the ray is drawn so far."""
    particles: int = param(
        100, lo=10, hi=5000, soft=(20, 500), effect="next feature", label="Particles"
    )
    """How many a new feature starts with."""
    min_particles: int = param(
        20, lo=2, hi=1000, soft=(5, 100), label="Particles, min", below="particles"
    )
    """With fewer left it is given up: their spread would be that of the grid."""
    ratio: float = param(0.3, lo=1e-3, hi=1.0, soft=(0.05, 0.4), label="Spread, max")
    """Converted when the standard deviation of the particles is below this part of their mean."""

    def __post_init__(self) -> None:
        demand_order(self)
        mean, var = self.moments(self.particles0())
        spread = float(np.sqrt(var[0, 0]) / mean[0])
        if not self.ratio < spread:
            raise ParamError(
                f"'{self.name}': ratio = {self.ratio:g} is not below {spread:.3f}, the spread of "
                f"new particles, which would settle at once: give ratio from 0.001 to below "
                f"{spread:.3f}"
            )

    @abstractmethod
    def successor(self) -> RayPoint:
        """What it becomes."""

    @property
    def free_labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("lambda",) if self.uniform_in == "depth" else ("rho",)

    @property
    def free_units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("m",) if self.uniform_in == "depth" else ("1/m",)

    def prior(self) -> tuple[Vec, Mat]:
        return np.zeros(1), np.zeros((1, 1))

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        """y = (t, R m / |m|) for a sensor at t and X = (m, w)."""
        d = self.space.d
        seen = first_view(self.space, xws, X)
        y = np.empty((*X.shape[:-1], 2 * d))
        y[..., :d], y[..., d:] = self.space.position(xws), seen.u
        by_xws = np.zeros((*y.shape, len(xws)))
        by_xws[..., range(d), range(d)] = 1.0
        by_xws[..., d:, :] = seen.u_by_xws
        by_X = np.zeros((*y.shape, d + 1))
        by_X[..., d:, :] = seen.u_by_X
        return Initialised(y, by_xws, by_X)

    def primitive(self, y: Vec) -> Primitive:
        """The end of the ray: its point at infinity."""
        d = self.space.d
        X = np.concatenate([y[..., d:], np.zeros_like(y[..., :1])], axis=-1)
        by_y = np.zeros((d + 1, 2 * d))
        by_y[:d, d:] = np.eye(d)
        return Primitive(X, by_y)

    def point(self, y: Vec, lam: Vec) -> FreePrimitive:
        d = self.space.d
        r, u = y[..., :d], y[..., d:]
        # X = (a r + b u, a): (a, b) is (1, lam) or (rho, 1).
        one = np.ones_like(lam)
        a, b = (one, lam) if self.uniform_in == "depth" else (lam, one)
        a, b, r, u = np.broadcast_arrays(a, b, r, u)
        X = np.concatenate([a * r + b * u, a[..., :1]], axis=-1)
        by_y = np.zeros((*X.shape, 2 * d))
        by_y[..., range(d), range(d)] = a
        by_y[..., range(d), range(d, 2 * d)] = b
        by_lam = np.zeros((*X.shape, 1))
        by_lam[..., :d, 0] = u if self.uniform_in == "depth" else r
        by_lam[..., d, 0] = 0.0 if self.uniform_in == "depth" else 1.0
        return FreePrimitive(X, by_y, by_lam)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        d = self.space.d
        at = self.space.to_local(xpdef, with_w(y[..., :d], 1.0))
        ray = self.space.to_local(xpdef, with_w(y[..., d:], 0.0))
        value = np.concatenate([at.X[..., :d], ray.X[..., :d]], axis=-1)
        by_state = np.zeros((*y.shape, 2 * d))
        by_state[..., :d, :d] = at.by_X[..., :d, :d]
        by_state[..., d:, d:] = ray.by_X[..., :d, :d]
        by_xpdef = np.concatenate([at.by_xp[..., :d, :], ray.by_xp[..., :d, :]], axis=-2)
        return Redefined(value, by_state, by_xpdef)

    def normalise(self, y: Vec) -> Normalised:
        """u / |u|, with the Jacobian (I - u u') / |u|."""
        d = self.space.d
        length = np.linalg.norm(y[..., d:], axis=-1, keepdims=True)
        u = y[..., d:] / length
        J = np.zeros((*y.shape, 2 * d))
        J[..., range(d), range(d)] = 1.0
        across = np.eye(d) - u[..., :, None] * u[..., None, :]
        J[..., d:, d:] = across / length[..., None]
        return Normalised(np.concatenate([y[..., :d], u], axis=-1), J)

    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        """The ray between the smallest and the largest depth, its middle and how far off that may
        be: what is known before the particles say more."""
        d, near, far = self.space.d, self.min_depth, self.max_depth
        r, u = y[..., :d], y[..., d:]
        middle = 0.5 * (near + far)
        J = np.concatenate([np.eye(d), middle * np.eye(d)], axis=1)
        along = (far - near) ** 2 / 12.0 * u[..., :, None] * u[..., None, :]
        ends = np.stack([r + near * u, r + far * u], axis=-2)
        return Glyphs(r + middle * u, J @ Pyy @ J.T + along, ends)

    def particles0(self) -> Particles:
        n, near = self.particles, self.min_depth
        if self.uniform_in == "depth":
            lam = near + (self.max_depth - near) * np.arange(n) / n
        else:
            lam = np.linspace(1.0 / near, 0.0, n)
        return Particles(frozen(lam[:, None]), frozen(np.full(n, 1.0 / n)))

    def spent(self, particles: Particles) -> bool:
        return len(particles.w) < self.min_particles

    def settled(self, y: Vec, particles: Particles) -> bool:
        """Their spread is below `ratio` of their mean."""
        mean, var = self.moments(particles)
        return not self.spent(particles) and bool(np.sqrt(var[0, 0]) < self.ratio * mean[0])

    def settle(self, y: Vec, lam: Vec) -> Settled:
        """(r, c(u), rho): no more of an approximation than that lam becomes a Gaussian."""
        d, in_depth = self.space.d, self.uniform_in == "depth"
        y, lam = np.broadcast_arrays(y, lam[..., :1])
        c, by_u = self.successor().coordinates(y[..., d:])
        rho = 1.0 / lam[..., :1] if in_depth else lam[..., :1]
        value = np.concatenate([y[..., :d], c, rho], axis=-1)
        by_y = np.zeros((*value.shape, 2 * d))
        by_y[..., range(d), range(d)] = 1.0
        by_y[..., d:-1, d:] = by_u
        by_lam = np.zeros((*value.shape, 1))
        by_lam[..., -1, :] = -(rho**2) if in_depth else 1.0
        return Settled(value, by_y, by_lam)
