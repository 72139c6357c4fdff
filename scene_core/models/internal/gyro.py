"""A rate gyro."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import InternalMeasurement, InternalMeasurementModel
from scene_core.params import param


@dataclass(frozen=True)
class Gyro(InternalMeasurementModel):
    """hv = (wx, wy, wz) [rad/s], the angular velocity in the robot's frame; R = sd^2 I.

    Source: Davison, *Models and State Representation in Scene*, section 5.3; noise as in the HRP-2
    extension of MonoSLAM (Stasse et al., IROS 2006).
    """

    name = "gyro"
    needs = ("wx", "wy", "wz")
    labels = ("wx", "wy", "wz")
    units = ("rad/s", "rad/s", "rad/s")

    sd: float = param(0.01, unit="rad/s", lo=1e-6, hi=10.0, soft=(0.001, 0.2), label="Noise")
    """Standard deviation of every component."""

    def h(self, needed: Vec) -> InternalMeasurement:
        return InternalMeasurement(needed, np.eye(3))

    def R(self, hv: Vec) -> Mat:
        return self.sd**2 * np.eye(3)
