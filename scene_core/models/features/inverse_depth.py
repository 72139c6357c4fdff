"""A point on a ray, kept so that a single view of it is enough."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D, wrap
from scene_core.models.base import (
    Converted,
    FeatureModel,
    Glyphs,
    Initialised,
    Normalised,
    Primitive,
    Redefined,
)
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.params import param

# World axes that play (a, b, c) in m = cos(p) cos(w) a + cos(p) sin(w) b + sin(p) c.
_AXES = {"z": (0, 1, 2), "y": (2, 0, 1)}
_IDENTITY = np.eye(6)


EUCLIDEAN = EuclideanPoint()
"""One value for all conversions, so that converted features go through the chain together."""


@dataclass(frozen=True)
class InverseDepth(FeatureModel):
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
    unmeasured = ("rho",)

    rho_mean: float = param(
        0.01, unit="1/m", lo=1e-6, hi=100.0, soft=(0.001, 2.0), effect="next feature", label="Prior"
    )
    """Inverse distance of a new feature."""
    rho_sd: float = param(
        0.5,
        unit="1/m",
        lo=1e-6,
        hi=100.0,
        soft=(0.01, 2.0),
        effect="next feature",
        label="Prior sd",
    )
    """Its standard deviation: two of them should reach the inverse of the nearest distance."""
    linearity: float = param(0.1, lo=0.0, hi=10.0, soft=(0.0, 0.5), label="Linearity")
    """Converted to Euclidean coordinates below this linearity index. 0: never."""
    rho_min: float = param(0.001, unit="1/m", lo=1e-9, hi=1.0, soft=(1e-4, 0.1))
    """An update that puts the point behind its own ray leaves it at this inverse distance."""
    pole: Literal["z", "y"] = param("z", choices=("z", "y"), effect="on reset", label="Pole")
    """World axis the pitch is measured towards: the vertical, so that level rays are regular."""
    far: float = param(20.0, unit="m", lo=0.1, hi=1e5, soft=(2.0, 100.0), label="Rays drawn to")
    """The uncertain depth is drawn no farther than this."""

    def successor(self) -> FeatureModel:
        return EUCLIDEAN

    def prior(self) -> tuple[Vec, Mat]:
        return np.array([self.rho_mean]), np.array([[self.rho_sd**2]])

    def _direction(self, y: Vec) -> tuple[Vec, Mat]:
        """m (..., 3) and dm/d(pitch, yaw) (..., 3, 2)."""
        a, b, c = _AXES[self.pole]
        cp, sp = np.cos(y[..., 3]), np.sin(y[..., 3])
        cy, sy = np.cos(y[..., 4]), np.sin(y[..., 4])
        m, dm = np.empty((*cp.shape, 3)), np.zeros((*cp.shape, 3, 2))
        m[..., a], m[..., b], m[..., c] = cp * cy, cp * sy, sp
        dm[..., a, 0], dm[..., b, 0], dm[..., c, 0] = -sp * cy, -sp * sy, cp
        dm[..., a, 1], dm[..., b, 1] = -m[..., b], m[..., a]
        return m, dm

    def _angles(self, v: Vec) -> tuple[Vec, Mat]:
        """(pitch, yaw) (..., 2) of directions v (..., 3) of any length, and the Jacobian.

        Straight towards the pole the yaw is free; its derivative is bounded, not infinite.
        """
        a, b, c = _AXES[self.pole]
        va, vb, vc = v[..., a], v[..., b], v[..., c]
        flat2 = np.maximum(va * va + vb * vb, 1e-18 * (v * v).sum(-1))
        flat, length2 = np.sqrt(flat2), flat2 + vc * vc
        J = np.zeros((*v.shape[:-1], 2, 3))
        J[..., 0, a], J[..., 0, b] = -vc * va / (flat * length2), -vc * vb / (flat * length2)
        J[..., 0, c] = flat / length2
        J[..., 1, a], J[..., 1, b] = -vb / flat2, va / flat2
        return np.stack([np.arctan2(vc, flat), np.arctan2(vb, va)], axis=-1), J

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        """y = (t, angles(R m), w / |m|) for the sensor pose (t, q) and X = (m, w)."""
        seen = THREE_D.to_world(xws, X)
        ray = seen.X[..., :3] - X[..., 3:] * xws[:3]
        angles, da = self._angles(ray)
        length = np.sqrt((X[..., :3] * X[..., :3]).sum(-1))
        y = np.empty((*X.shape[:-1], 6))
        y[..., :3] = xws[:3]
        y[..., 3:5] = angles
        y[..., 5] = X[..., 3] / length
        by_xws = np.zeros((*y.shape, 7))
        by_xws[..., (0, 1, 2), (0, 1, 2)] = 1.0
        by_xws[..., 3:5, 3:] = da @ seen.by_xp[..., :3, 3:]
        by_X = np.zeros((*y.shape, 4))
        by_X[..., 3:5, :3] = da @ seen.by_X[..., :3, :3]
        by_X[..., 5, :3] = -(X[..., 3] / length**3)[..., None] * X[..., :3]
        by_X[..., 5, 3] = 1.0 / length
        return Initialised(y, by_xws, by_X)

    def primitive(self, y: Vec) -> Primitive:
        m, dm = self._direction(y)
        rho = y[..., 5:]
        X = np.empty((*y.shape[:-1], 4))
        X[..., :3] = rho * y[..., :3] + m
        X[..., 3] = y[..., 5]
        dX_by_dy = np.zeros((*X.shape, 6))
        dX_by_dy[..., (0, 1, 2), (0, 1, 2)] = rho
        dX_by_dy[..., :3, 3:5] = dm
        dX_by_dy[..., :3, 5] = y[..., :3]
        dX_by_dy[..., 3, 5] = 1.0
        return Primitive(X, dX_by_dy)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        m, dm = self._direction(y)
        anchor = THREE_D.to_local(xpdef, _with_w(y[..., :3], 1.0))
        ray = THREE_D.to_local(xpdef, _with_w(m, 0.0))
        angles, da = self._angles(ray.X[..., :3])
        value = np.concatenate([anchor.X[..., :3], angles, y[..., 5:]], axis=-1)
        by_state = np.zeros((*y.shape, 6))
        by_state[..., :3, :3] = anchor.by_X[..., :3, :3]
        by_state[..., 3:5, 3:5] = da @ ray.by_X[..., :3, :3] @ dm
        by_state[..., 5, 5] = 1.0
        by_xpdef = np.zeros((*y.shape, 7))
        by_xpdef[..., :3, :] = anchor.by_xp[..., :3, :]
        by_xpdef[..., 3:5, :] = da @ ray.by_xp[..., :3, :]
        return Redefined(value, by_state, by_xpdef)

    def normalise(self, y: Vec) -> Normalised:
        """yaw in (-pi, pi], and a negative rho raised to rho_min.

        The covariance stays as it is (the Jacobian is the identity): the update said only that the
        point is far, which its spread goes on saying.
        """
        value = y.copy()
        value[..., 4] = wrap(y[..., 4])
        value[..., 5] = np.where(y[..., 5] < 0.0, self.rho_min, y[..., 5])
        return Normalised(value, _IDENTITY)

    def _point(self, y: Vec) -> tuple[Vec, Mat]:
        """p = x0 + m / rho (..., 3) and dp/dy (..., 3, 6)."""
        m, dm = self._direction(y)
        distance = 1.0 / np.maximum(y[..., 5:], 1e-9)
        J = np.zeros((*m.shape, 6))
        J[..., (0, 1, 2), (0, 1, 2)] = 1.0
        J[..., 3:5] = distance[..., None] * dm
        J[..., 5] = -(distance**2) * m
        return y[..., :3] + distance * m, J

    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        """First-order Euclidean ellipsoid, and the ray between rho +- 2 sigma cut at `far`."""
        p, J = self._point(y)
        m, _ = self._direction(y)
        two_sigma = 2.0 * np.sqrt(np.maximum(Pyy[..., 5, 5], 0.0))
        rho = y[..., 5, None] + two_sigma[..., None] * (1.0, -1.0)
        distance = 1.0 / np.maximum(rho, 1.0 / self.far)
        ends = y[..., None, :3] + distance[..., None] * m[..., None, :]
        return Glyphs(p, J @ Pyy @ np.swapaxes(J, -1, -2), ends)

    def ready(self, y: Vec, Pyy: Mat, xws: Vec) -> np.ndarray:
        rho = np.maximum(y[..., 5], 1e-9)
        ray = self._point(y)[0] - xws[:3]
        m, _ = self._direction(y)
        # |cos(m, p - c)| / |p - c| = |m . (p - c)| / |p - c|^2
        cos_over_d = np.abs((m * ray).sum(-1)) / np.maximum((ray * ray).sum(-1), 1e-18)
        Ld = 4.0 * np.sqrt(np.maximum(Pyy[..., 5, 5], 0.0)) / rho**2 * cos_over_d
        return (Ld < self.linearity) & (y[..., 5] > 0.0)

    def convert(self, y: Vec) -> Converted:
        return Converted(*self._point(y))


def _with_w(m: Vec, w: float) -> Vec:
    X = np.full((*m.shape[:-1], 4), w)
    X[..., :3] = m
    return X
