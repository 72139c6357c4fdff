"""What instruments that read one angle share: a zero, a noise, and that they live on a circle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import wrap
from scene_core.models.base import InternalMeasurement, InternalMeasurementModel
from scene_core.params import param


@dataclass(frozen=True)
class AngleReading(InternalMeasurementModel):
    """hv = wrap(angle - zero); R = sd^2. Final instruments say which angle."""

    units = ("rad",)

    sd: float = param(
        np.deg2rad(0.5).item(), unit="rad", lo=1e-6, hi=3.2, soft=(0.001, 0.2), label="Noise"
    )
    """Standard deviation of a reading."""
    zero: float = param(0.0, unit="rad", lo=-np.pi, hi=np.pi, label="Zero")
    """The angle at which it reads zero."""

    def reading(self, angle: float, by_needed: Vec) -> InternalMeasurement:
        """The measurement of `angle` with its derivative by the needed components (n,)."""
        return InternalMeasurement(wrap(np.array([angle - self.zero])), by_needed[None])

    def R(self, hv: Vec) -> Mat:
        return np.array([[self.sd**2]])

    def nu(self, hv: Vec, zv: Vec) -> Vec:
        return wrap(zv - hv)
