"""A range finder that looks both ways along a line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import ONE_D
from scene_core.models.base import Backprojection, Fault, Projection, Sensor
from scene_core.params import param


@dataclass(frozen=True)
class Distance1D(Sensor):
    """h = z, the signed distance of a point along the line, from the sensor.

    h = (z) [m] of X = (z, w); R = sd^2.

    Source: Davison, Scene library, one-dimensional point feature.
    """

    name = "1-D distance"
    space = ONE_D
    pane = "bar"
    measurement_size = 1
    labels = ("z",)
    units = ("m",)

    sd: float = param(0.09, unit="m", lo=1e-6, hi=10.0, soft=(0.01, 0.5), label="Noise")
    """Standard deviation of a measured distance."""
    reach: float = param(4.0, unit="m", lo=0.01, hi=1000.0, soft=(1.0, 10.0), label="Reach")
    """Points farther than this are not seen."""

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        return ((-self.reach, self.reach),)

    def project(self, X: Vec, k: Vec) -> Projection:
        iw = 1.0 / np.maximum(X[..., 1:], 1e-12)
        h = X[..., :1] * iw
        dh_by_dX = np.empty((*h.shape, 2))
        dh_by_dX[..., 0], dh_by_dX[..., 1] = iw, -h * iw
        return Projection(h, dh_by_dX, np.zeros((*h.shape, 0)))

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """X = (z, 1): on a line there is no direction to keep, and z may be 0."""
        X = np.ones((*z.shape[:-1], 2))
        X[..., 0] = z[..., 0]
        dX_by_dz = np.array([[1.0], [0.0]])
        return Backprojection(X, dX_by_dz, np.zeros((2, 0)), np.zeros((2, 0)))

    def R(self, h: Vec) -> Mat:
        return np.full((*h.shape, 1), self.sd**2)

    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """OUTSIDE the reach, either way."""
        return np.where(np.abs(h[..., 0]) > self.reach, int(Fault.OUTSIDE), 0)
