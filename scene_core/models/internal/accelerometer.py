"""An accelerometer on a robot whose acceleration is estimated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.models.base import InternalMeasurement, InternalMeasurementModel
from scene_core.models.labels import QUATERNION
from scene_core.params import param


@dataclass(frozen=True)
class Accelerometer(InternalMeasurementModel):
    """hv = R(q)' (a - g) [m/s^2], the specific force in the body; R = sd^2 I.

    a = (ax, ay, az) [m/s^2] is the acceleration in the world: at rest it reads minus gravity.

    Source: Davison, *Models and State Representation in Scene*, section 5.3; Solà, *Quaternion
    kinematics for the error-state Kalman filter*, section 5.1.
    """

    name = "accelerometer"
    needs = (*QUATERNION, "ax", "ay", "az")
    labels = ("fx", "fy", "fz")
    units = ("m/s²", "m/s²", "m/s²")
    world_fixed = ("gravity",)

    sd: float = param(0.1, unit="m/s²", lo=1e-6, hi=100.0, soft=(0.001, 1.0), label="Noise")
    """Standard deviation of every component."""
    gravity: tuple[float, float, float] = param(
        (0.0, 0.0, -9.81), unit="m/s²", lo=-100.0, hi=100.0, label="Gravity"
    )
    """Acceleration of free fall in the world's axes; (0, -9.81, 0) where y points up."""

    def h(self, needed: Vec) -> InternalMeasurement:
        felt = quaternion.rotate_back(needed[:4], needed[4:] - np.array(self.gravity))
        return InternalMeasurement(felt.v, np.concatenate([felt.by_q, felt.by_v], axis=1))

    def R(self, hv: Vec) -> Mat:
        return self.sd**2 * np.eye(3)
