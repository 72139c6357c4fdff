"""A planar bearing sensor that is mounted a little turned, written for one point at a time."""

from dataclasses import dataclass

import numpy as np

from scene_core.geometry.spaces import TWO_D, wrap
from scene_core.models.base import Backprojection, Fault, Innovation, Projection, Sensor
from scene_core.params import param


@dataclass(frozen=True)
class TurnedBearing(Sensor):
    name, space, pane, measurement_size = "turned bearing", TWO_D, "polar", 1
    labels, units, unmeasured = ("b",), ("rad",), ("rho",)
    calib_labels, calib_units = ("turn",), ("rad",)
    limits = ((-np.pi, np.pi),)
    turn: float = param(0.0, unit="rad", lo=-3.2, hi=3.2, soft=(-0.2, 0.2), label="Turned by")
    """Added to every bearing; may be estimated."""
    sd: float = param(0.02, unit="rad", lo=1e-4, hi=1.0, soft=(0.001, 0.1), label="Bearing noise")
    """Standard deviation of a measured bearing."""
    calib0 = property(lambda self: np.array([self.turn]))

    def project(self, X, k):
        return Projection(np.array([wrap(np.arctan2(X[1], X[0]) + k[0])]))

    def backproject(self, z, n, k):
        return Backprojection(np.array([np.cos(z[0] - k[0]), np.sin(z[0] - k[0]), n[0]]))

    def R(self, h):
        return np.array([[self.sd**2]])

    def nu(self, h, z):
        return Innovation(wrap(z - h), -np.eye(1), np.eye(1))

    def visibility(self, h, X, xws, pose0, y_X):
        return Fault.OUTSIDE if X[2] > 10.0 * np.hypot(X[0], X[1]) else Fault.NONE
