"""A planar sensor that tells the distance of a point and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import TWO_D
from scene_core.models.base import Backprojection, Fault, Projection, Sensor
from scene_core.models.ordered import demand_order
from scene_core.params import param


@dataclass(frozen=True)
class PlanarRange(Sensor):
    """h = |m| / w of X = (m, w) = (z, x, w)

    h = (r) [m]; R = sd^2. The direction stays open (bearing [rad], from the sensor's z axis
    towards its x axis): radio beacons and echoes come from all around.

    Source: Newman, Leonard, *Pure Range-Only Sub-Sea SLAM*, ICRA 2003; Blanco,
    Fernandez-Madrigal, Gonzalez, *Efficient Probabilistic Range-Only SLAM*, IROS 2008.
    """

    name = "planar range"
    space = TWO_D
    pane = "polar"
    measurement_size = 1
    labels = ("r",)
    units = ("m",)
    unmeasured = ("bearing",)

    sd: float = param(0.1, unit="m", lo=1e-6, hi=100.0, soft=(0.01, 1.0), label="Noise")
    """Standard deviation of a measured range."""
    reach_min: float = param(
        0.1,
        unit="m",
        lo=1e-3,
        hi=1000.0,
        soft=(0.01, 2.0),
        label="Reach, min",
        below="reach_max",
    )
    """Points nearer than this are not measured."""
    reach_max: float = param(
        8.0, unit="m", lo=0.01, hi=10000.0, soft=(1.0, 50.0), label="Reach, max"
    )
    """Points farther than this are not measured."""

    def __post_init__(self) -> None:
        demand_order(self)

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        return ((0.0, self.reach_max),)

    def project(self, X: Vec, k: Vec) -> Projection:
        z, x = X[..., 0], X[..., 1]
        # A point on the sensor itself, or at infinity, is out of reach; it only must stay finite.
        iw = 1.0 / np.maximum(X[..., 2], 1e-12)
        m = np.maximum(np.sqrt(z * z + x * x), 1e-12)
        h = (m * iw)[..., None]
        dh_by_dX = np.stack([z / m * iw, x / m * iw, -h[..., 0] * iw], axis=-1)[..., None, :]
        return Projection(h, dh_by_dX, np.zeros((*h.shape, 0)))

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """X = (cos b, sin b, 1 / r), n = (b) the bearing [rad]."""
        c, s = np.cos(n[..., 0]), np.sin(n[..., 0])
        ir = np.broadcast_to(1.0 / np.maximum(z[..., 0], 1e-12), c.shape)
        none = np.zeros_like(c)
        X = np.stack([c, s, ir], axis=-1)
        dX_by_dz = np.stack([none, none, -(ir**2)], axis=-1)[..., None]
        dX_by_dn = np.stack([-s, c, none], axis=-1)[..., None]
        return Backprojection(X, dX_by_dz, dX_by_dn, np.zeros((*X.shape, 0)))

    def R(self, h: Vec) -> Mat:
        return np.full((*h.shape, 1), self.sd**2)

    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """OUTSIDE the reach."""
        r = h[..., 0]
        return np.where((r < self.reach_min) | (r > self.reach_max), int(Fault.OUTSIDE), 0)
