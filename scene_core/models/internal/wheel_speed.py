"""An encoder on a driven wheel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import InternalMeasurement, InternalMeasurementModel
from scene_core.params import param


@dataclass(frozen=True)
class WheelSpeed(InternalMeasurementModel):
    """hv = (v) [m/s], the speed along the wheels, signed; R = sd^2 + (sd_slip v)^2.

    Source: Davison, *Models and State Representation in Scene*, section 5.3.
    """

    name = "wheel speed"
    needs = ("v",)
    labels = ("v",)
    units = ("m/s",)

    sd: float = param(0.01, unit="m/s", lo=1e-6, hi=10.0, soft=(0.001, 0.2), label="Noise")
    """Standard deviation at rest: what the encoder's steps hide."""
    sd_slip: float = param(0.02, lo=0.0, hi=1.0, soft=(0.0, 0.2), label="Slip")
    """Standard deviation of the slip, as a fraction of the speed."""

    def h(self, needed: Vec) -> InternalMeasurement:
        return InternalMeasurement(needed, np.eye(1))

    def R(self, hv: Vec) -> Mat:
        return np.array([[self.sd**2 + (self.sd_slip * hv[0]) ** 2]])
