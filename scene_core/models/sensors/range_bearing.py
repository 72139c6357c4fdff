"""A planar range finder that also tells the direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import TWO_D, wrap
from scene_core.models.base import Backprojection, Fault, Innovation, Projection, Sensor
from scene_core.models.ordered import demand_order
from scene_core.params import param


@dataclass(frozen=True)
class RangeBearing(Sensor):
    """h = (r, b) = (|m| / w, atan2(x, z)) of X = (m, w) = (z, x, w)

    Range [m] and bearing [rad] from the sensor's z axis towards its x axis;
    R = diag(sd_range^2, sd_bearing^2).

    Source: Thrun, Burgard, Fox, *Probabilistic Robotics*, section 6.6, in the axes of Scene.
    """

    name = "range-bearing"
    space = TWO_D
    pane = "polar"
    measurement_size = 2
    labels = ("r", "b")
    units = ("m", "rad")

    sd_range: float = param(0.1, unit="m", lo=1e-6, hi=100.0, soft=(0.01, 1.0), label="Range noise")
    """Standard deviation of a measured range."""
    sd_bearing: float = param(
        0.02, unit="rad", lo=1e-6, hi=3.2, soft=(0.001, 0.2), label="Bearing noise"
    )
    """Standard deviation of a measured bearing."""
    reach_min: float = param(
        0.1,
        unit="m",
        lo=1e-3,
        hi=1000.0,
        soft=(0.01, 2.0),
        label="Reach, min",
        below="reach_max",
    )
    """Points nearer than this are not seen."""
    reach_max: float = param(
        8.0, unit="m", lo=0.01, hi=10000.0, soft=(1.0, 50.0), label="Reach, max"
    )
    """Points farther than this are not seen."""
    field_of_view: float = param(
        2 * np.pi, unit="rad", lo=0.01, hi=2 * np.pi, soft=(0.5, 2 * np.pi), label="Field of view"
    )
    """Full opening angle, symmetric about the sensor's z axis."""

    def __post_init__(self) -> None:
        demand_order(self)

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        half = 0.5 * self.field_of_view
        return (0.0, self.reach_max), (-half, half)

    def project(self, X: Vec, k: Vec) -> Projection:
        z, x = X[..., 0], X[..., 1]
        # A point on the sensor itself, or at infinity, is out of reach; it only must stay finite.
        iw = 1.0 / np.maximum(X[..., 2], 1e-12)
        m = np.maximum(np.sqrt(z * z + x * x), 1e-12)
        h = np.empty((*z.shape, 2))
        h[..., 0], h[..., 1] = m * iw, np.arctan2(x, z)
        dh_by_dX = np.zeros((*h.shape, 3))
        dh_by_dX[..., 0, 0], dh_by_dX[..., 0, 1] = z / m * iw, x / m * iw
        dh_by_dX[..., 0, 2] = -h[..., 0] * iw
        dh_by_dX[..., 1, 0], dh_by_dX[..., 1, 1] = -x / m**2, z / m**2
        return Projection(h, dh_by_dX, np.zeros((*h.shape, 0)))

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """X = (cos b, sin b, 1 / r)."""
        c, s, ir = np.cos(z[..., 1]), np.sin(z[..., 1]), 1.0 / np.maximum(z[..., 0], 1e-12)
        X = np.empty((*c.shape, 3))
        X[..., 0], X[..., 1], X[..., 2] = c, s, ir
        dX_by_dz = np.zeros((*X.shape, 2))
        dX_by_dz[..., 0, 1], dX_by_dz[..., 1, 1], dX_by_dz[..., 2, 0] = -s, c, -(ir**2)
        return Backprojection(X, dX_by_dz, np.zeros((*X.shape, 0)), np.zeros((*X.shape, 0)))

    def R(self, h: Vec) -> Mat:
        R = np.diag([self.sd_range**2, self.sd_bearing**2])
        return np.broadcast_to(R, (*h.shape[:-1], 2, 2))

    def nu(self, h: Vec, z: Vec) -> Innovation:
        nu = z - h
        nu[..., 1] = wrap(nu[..., 1])
        return Innovation(nu, -np.eye(2), np.eye(2))

    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """OUTSIDE the reach or the field of view."""
        r, b = h[..., 0], h[..., 1]
        outside = (r < self.reach_min) | (r > self.reach_max)
        outside |= np.abs(b) > 0.5 * self.field_of_view
        return np.where(outside, int(Fault.OUTSIDE), 0)
