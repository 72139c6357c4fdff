"""A velocity sensor that moves with the body: Doppler log, optical flow, walking pattern."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.models.base import InternalMeasurement, InternalMeasurementModel
from scene_core.models.labels import QUATERNION
from scene_core.params import param


@dataclass(frozen=True)
class Velocity(InternalMeasurementModel):
    """hv = R(q)' v [m/s], the velocity in the body; R = sd^2 I.

    v = (vx, vy, vz) [m/s] in the world.

    Source: the waist velocity of the HRP-2 extension of MonoSLAM (Stasse et al., IROS 2006), with
    the part of the Jacobian that depends on the attitude, which was left out there.
    """

    name = "velocity"
    needs = (*QUATERNION, "vx", "vy", "vz")
    labels = ("vx", "vy", "vz")
    units = ("m/s", "m/s", "m/s")

    sd: float = param(0.03, unit="m/s", lo=1e-6, hi=10.0, soft=(0.001, 0.5), label="Noise")
    """Standard deviation of every component."""

    def h(self, needed: Vec) -> InternalMeasurement:
        felt = quaternion.rotate_back(needed[:4], needed[4:])
        return InternalMeasurement(felt.v, np.concatenate([felt.by_q, felt.by_v], axis=1))

    def R(self, hv: Vec) -> Mat:
        return self.sd**2 * np.eye(3)
