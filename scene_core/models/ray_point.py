"""Points kept as a ray and an inverse distance along it, so that a single view is enough.

y = (x0, c, rho): the anchor x0 [m], c the coordinates of a direction m, and the inverse *distance*
rho [1/m]; the point is X = (rho x0 + m, rho), p = x0 + m / rho. A landmark of this kind says what
its c are, and everything else is here.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import Space
from scene_core.models.base import (
    Converted,
    Glyphs,
    Initialised,
    Primitive,
    Redefined,
)
from scene_core.models.euclidean import with_w
from scene_core.models.rho_prior import RhoPrior
from scene_core.params import param


class Ray(NamedTuple):
    """Anchor x0 (..., d) and direction m (..., d) of y, with Jacobians by y (..., d, n)."""

    x0: Vec
    m: Vec
    x0_by_y: Mat
    m_by_y: Mat


class FirstView(NamedTuple):
    """Unit direction u (..., d) in the world and rho (...,) of a point seen for the first time."""

    u: Vec
    rho: Vec
    u_by_xws: Mat
    """(..., d, size of a pose)"""
    u_by_X: Mat
    """(..., d, d+1)"""
    rho_by_X: Vec
    """(..., d+1)"""


@dataclass(frozen=True)
class RayPoint(RhoPrior):
    """X = (rho x0 + m(c), rho), converted to its coordinates p = x0 + m / rho once

        Ld = 4 sigma_rho / rho^2 / |p - c| |cos(m, p - c)| < linearity,

    c the place of the sensor. A first view leaves rho to the prior N(rho_mean, rho_sd^2).

    Source: Civera, Davison, Montiel, TRO 2008, section V; Solà, *An EKF-SLAM toolbox in Matlab*,
    `linearTest`.
    """

    linearity: float = param(0.1, lo=0.0, hi=10.0, soft=(0.0, 0.5), label="Linearity")
    """Converted to Euclidean coordinates below this linearity index. 0: never."""
    rho_min: float = param(0.001, unit="1/m", lo=1e-9, hi=1.0, soft=(1e-4, 0.1))
    """An update that puts the point behind its own ray leaves it at this inverse distance."""
    far: float = param(20.0, unit="m", lo=0.1, hi=1e5, soft=(2.0, 100.0), label="Rays drawn to")
    """The uncertain depth is drawn no farther than this."""

    @abstractmethod
    def direction(self, y: Vec) -> tuple[Vec, Mat]:
        """m (..., d) and dm/dc (..., d, nc)."""

    @abstractmethod
    def coordinates(self, m: Vec) -> tuple[Vec, Mat]:
        """c (..., nc) of directions m (..., d), and dc/dm (..., nc, d)."""

    def ray(self, y: Vec) -> Ray:
        """The ray with its Jacobians by all of y."""
        d = self.space.d
        m, by_c = self.direction(y)
        x0_by_y, m_by_y = np.eye(d, y.shape[-1]), np.zeros((*m.shape, y.shape[-1]))
        m_by_y[..., d:-1] = by_c
        return Ray(y[..., :d], m, x0_by_y, m_by_y)

    def first_view(self, xws: Vec, X: Vec) -> FirstView:
        return first_view(self.space, xws, X)

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        """y = (t, c(R m), w / |m|) for a sensor at t and X = (m, w)."""
        d = self.space.d
        seen = self.first_view(xws, X)
        c, by_u = self.coordinates(seen.u)
        y = np.empty((*X.shape[:-1], self.state_size))
        y[..., :d], y[..., d:-1], y[..., -1] = self.space.position(xws), c, seen.rho
        by_xws = np.zeros((*y.shape, len(xws)))
        by_xws[..., range(d), range(d)] = 1.0
        by_xws[..., d:-1, :] = by_u @ seen.u_by_xws
        by_X = np.zeros((*y.shape, d + 1))
        by_X[..., d:-1, :] = by_u @ seen.u_by_X
        by_X[..., -1, :] = seen.rho_by_X
        return Initialised(y, by_xws, by_X)

    def primitive(self, y: Vec) -> Primitive:
        x0, m, x0_by_y, m_by_y = self.ray(y)
        d, rho = self.space.d, y[..., -1:]
        X = np.concatenate([rho * x0 + m, rho], axis=-1)
        by_y = np.zeros((*X.shape, y.shape[-1]))
        by_y[..., :d, :] = rho[..., None] * x0_by_y + m_by_y
        by_y[..., :d, -1] += x0
        by_y[..., d, -1] = 1.0
        return Primitive(X, by_y)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        d = self.space.d
        m, by_c = self.direction(y)
        anchor = self.space.to_local(xpdef, with_w(y[..., :d], 1.0))
        ray = self.space.to_local(xpdef, with_w(m, 0.0))
        c, by_m = self.coordinates(ray.X[..., :d])
        value = np.concatenate([anchor.X[..., :d], c, y[..., -1:]], axis=-1)
        by_state = np.zeros((*y.shape, y.shape[-1]))
        by_state[..., :d, :d] = anchor.by_X[..., :d, :d]
        by_state[..., d:-1, d:-1] = by_m @ ray.by_X[..., :d, :d] @ by_c
        by_state[..., -1, -1] = 1.0
        by_xpdef = np.zeros((*y.shape, len(xpdef)))
        by_xpdef[..., :d, :] = anchor.by_xp[..., :d, :]
        by_xpdef[..., d:-1, :] = by_m @ ray.by_xp[..., :d, :]
        return Redefined(value, by_state, by_xpdef)

    def in_front(self, rho: Vec) -> Vec:
        """A negative rho raised to rho_min. The covariance is left as it is: the update said only
        that the point is far, which its spread goes on saying."""
        return np.where(rho < 0.0, self.rho_min, rho)

    def place(self, y: Vec) -> tuple[Vec, Mat]:
        """p = x0 + m / rho (..., d) and dp/dy (..., d, n)."""
        x0, m, x0_by_y, m_by_y = self.ray(y)
        distance = 1.0 / np.maximum(y[..., -1:], 1e-9)
        J = x0_by_y + distance[..., None] * m_by_y
        J[..., -1] -= distance**2 * m
        return x0 + distance * m, J

    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        """First-order Euclidean ellipsoid, and the ray between rho +- 2 sigma cut at `far`."""
        p, J = self.place(y)
        x0, m, *_ = self.ray(y)
        two_sigma = 2.0 * np.sqrt(np.maximum(Pyy[..., -1, -1], 0.0))
        rho = y[..., -1, None] + two_sigma[..., None] * (1.0, -1.0)
        distance = 1.0 / np.maximum(rho, 1.0 / self.far)
        ends = x0[..., None, :] + distance[..., None] * m[..., None, :]
        return Glyphs(p, J @ Pyy @ np.swapaxes(J, -1, -2), ends)

    def ready(self, y: Vec, Pyy: Mat, xws: Vec) -> np.ndarray:
        x0, m, *_ = self.ray(y)
        p = x0 + m / np.maximum(y[..., -1:], 1e-9)
        Ld = linearity_index(m, y[..., -1], Pyy[..., -1, -1], p - self.space.position(xws))
        return (Ld < self.linearity) & (y[..., -1] > 0.0)

    def convert(self, y: Vec) -> Converted:
        return Converted(*self.place(y))


def first_view(space: Space, xws: Vec, X: Vec) -> FirstView:
    """u = R m / |m| and rho = w / |m| for the sensor pose xws (n,) and X = (m, w)."""
    d = space.d
    seen = space.to_world(xws, X)
    m, w = X[..., :d], X[..., d]
    length = np.sqrt(np.vecdot(m, m))
    R = seen.by_X[..., :d, :d]
    u = (seen.X[..., :d] - w[..., None] * space.position(xws)) / length[..., None]
    u_by_xws = np.zeros((*u.shape, len(xws)))
    u_by_xws[..., d:] = seen.by_xp[..., :d, d:] / length[..., None, None]
    u_by_X = np.zeros((*u.shape, d + 1))
    own = m / length[..., None]
    along = np.eye(d) - own[..., :, None] * own[..., None, :]
    u_by_X[..., :d] = R @ along / length[..., None, None]
    rho_by_X = np.empty((*length.shape, d + 1))
    rho_by_X[..., :d] = -(w / length**3)[..., None] * m
    rho_by_X[..., d] = 1.0 / length
    return FirstView(u, w / length, u_by_xws, u_by_X, rho_by_X)


def linearity_index(m: Vec, rho: Vec, variance: Vec, ray: Vec) -> Vec:
    """Ld = 4 sigma_rho / rho^2 / |ray| |cos(m, ray)| (...,): how far from linear the image of a
    point at 1 / rho along the unit direction m is in rho, seen along `ray` (..., d) from the
    sensor to the point."""
    # |cos(m, ray)| / |ray| = |m . ray| / |ray|^2
    cos_over_d = np.abs(np.vecdot(m, ray)) / np.maximum(np.vecdot(ray, ray), 1e-18)
    return 4.0 * np.sqrt(np.maximum(variance, 0.0)) / np.maximum(rho, 1e-9) ** 2 * cos_over_d
