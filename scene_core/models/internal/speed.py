"""A speedometer that does not know the direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import Fault, InternalMeasurement, InternalMeasurementModel
from scene_core.params import param


@dataclass(frozen=True)
class Speed(InternalMeasurementModel):
    """hv = |v| [m/s], v = (vx, vy, vz); dhv = v' / |v|, zero at rest; R = sd^2.

    Source: Davison, *Models and State Representation in Scene*, section 5.3.
    """

    name = "speed"
    needs = ("vx", "vy", "vz")
    labels = ("speed",)
    units = ("m/s",)

    sd: float = param(0.05, unit="m/s", lo=1e-6, hi=10.0, soft=(0.001, 1.0), label="Noise")
    """Standard deviation of a measured speed."""
    least: float = param(0.05, unit="m/s", lo=0.0, hi=10.0, soft=(0.0, 0.5), label="Speed, min")
    """Below this speed it is not used: near rest |v| is far from linear in v."""

    def h(self, needed: Vec) -> InternalMeasurement:
        speed = np.sqrt(needed @ needed)
        # At rest |v| has no derivative; zero says that the measurement teaches nothing there.
        return InternalMeasurement(np.array([speed]), (needed / max(speed, 1e-12))[None])

    def R(self, hv: Vec) -> Mat:
        return np.array([[self.sd**2]])

    def feasible(self, needed: Vec, hv: Vec) -> Fault:
        return Fault.INFEASIBLE if hv[0] < self.least else Fault.NONE
