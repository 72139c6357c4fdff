"""A range finder in space that also tells the direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D, wrap
from scene_core.models.base import Backprojection, Fault, Innovation, Projection, Sensor
from scene_core.models.directions import FLU, angles, direction
from scene_core.models.ordered import demand_order
from scene_core.params import param


@dataclass(frozen=True)
class RangeBearingElevation(Sensor):
    """h = (|m| / w, atan2(y, x), atan2(z, |(x, y)|)) of X = (m, w) = (x, y, z, w)

    h = (r, azimuth, elevation) [m, rad, rad] in the sensor's own axes: x forward, y left, z up.
    R = diag(sd_range^2, sd_azimuth^2, sd_elevation^2). Straight above, where the azimuth means
    nothing, all stays finite.

    Source: Blanco, *Derivation and Implementation of a Full 6D EKF-based Solution to Bearing-Range
    SLAM*, University of Malaga, 2008.
    """

    name = "range-bearing-elevation"
    space = THREE_D
    pane = "polar"
    measurement_size = 3
    labels = ("r", "azimuth", "elevation")
    units = ("m", "rad", "rad")

    sd_range: float = param(0.1, unit="m", lo=1e-6, hi=100.0, soft=(0.01, 1.0), label="Range noise")
    """Standard deviation of a measured range."""
    sd_azimuth: float = param(
        0.02, unit="rad", lo=1e-6, hi=3.2, soft=(0.001, 0.2), label="Azimuth noise"
    )
    """Standard deviation of a measured azimuth."""
    sd_elevation: float = param(
        0.02, unit="rad", lo=1e-6, hi=3.2, soft=(0.001, 0.2), label="Elevation noise"
    )
    """Standard deviation of a measured elevation."""
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
    """Full opening angle in azimuth, symmetric about the sensor's x axis."""
    elevation_max: float = param(
        1.4, unit="rad", lo=0.01, hi=np.pi / 2, soft=(0.1, 1.5), label="Elevation, max"
    )
    """Points higher or lower than this are not seen."""

    def __post_init__(self) -> None:
        demand_order(self)

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        half, high = 0.5 * self.field_of_view, self.elevation_max
        return (0.0, self.reach_max), (-half, half), (-high, high)

    def project(self, X: Vec, k: Vec) -> Projection:
        m = X[..., :3]
        # A point on the sensor itself, or at infinity, is out of reach; it only must stay finite.
        iw = 1.0 / np.maximum(X[..., 3], 1e-12)
        length = np.maximum(np.sqrt(np.vecdot(m, m)), 1e-12)
        turn = angles(m, FLU)
        h = np.empty(m.shape)
        h[..., 0], h[..., 1:] = length * iw, turn.value
        dh_by_dX = np.zeros((*m.shape, 4))
        dh_by_dX[..., 0, :3] = m * (iw / length)[..., None]
        dh_by_dX[..., 0, 3] = -h[..., 0] * iw
        dh_by_dX[..., 1:, :3] = turn.by_m
        return Projection(h, dh_by_dX, np.zeros((*h.shape, 0)))

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """X = (cos e cos a, cos e sin a, sin e, 1 / r)."""
        ray, ir = direction(z[..., 1], z[..., 2], FLU), 1.0 / np.maximum(z[..., 0], 1e-12)
        X = np.concatenate([ray.m, ir[..., None]], axis=-1)
        dX_by_dz = np.zeros((*X.shape, 3))
        dX_by_dz[..., 3, 0] = -(ir**2)
        dX_by_dz[..., :3, 1:] = ray.by_angles
        return Backprojection(X, dX_by_dz, np.zeros((*X.shape, 0)), np.zeros((*X.shape, 0)))

    def R(self, h: Vec) -> Mat:
        R = np.diag([self.sd_range**2, self.sd_azimuth**2, self.sd_elevation**2])
        return np.broadcast_to(R, (*h.shape[:-1], 3, 3))

    def nu(self, h: Vec, z: Vec) -> Innovation:
        nu = z - h
        nu[..., 1:] = wrap(nu[..., 1:])
        return Innovation(nu, -np.eye(3), np.eye(3))

    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """OUTSIDE the reach or the field of view."""
        r, a, e = h[..., 0], h[..., 1], h[..., 2]
        outside = (r < self.reach_min) | (r > self.reach_max)
        outside |= (np.abs(a) > 0.5 * self.field_of_view) | (np.abs(e) > self.elevation_max)
        return np.where(outside, int(Fault.OUTSIDE), 0)
