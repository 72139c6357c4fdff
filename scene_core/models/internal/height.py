"""An altimeter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import InternalMeasurement, InternalMeasurementModel
from scene_core.params import param


@dataclass(frozen=True)
class Height(InternalMeasurementModel):
    """hv = z - zero [m], or y - zero: the place along the vertical; R = sd^2.

    Source: the camera height of the HRP-2 extension of MonoSLAM (Stasse et al., IROS 2006).
    """

    name = "height"
    labels = ("height",)
    units = ("m",)
    world_fixed = ("gravity", "plane")

    sd: float = param(0.02, unit="m", lo=1e-6, hi=100.0, soft=(0.001, 0.5), label="Noise")
    """Standard deviation of a measured height."""
    zero: float = param(0.0, unit="m", lo=-1e5, hi=1e5, soft=(-5.0, 5.0), label="Zero")
    """Height above the world's origin at which it reads zero."""
    up: Literal["y", "z"] = param("z", choices=("y", "z"), label="Up")
    """Which axis of the world points up."""

    @property
    def needs(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return (self.up,)

    def h(self, needed: Vec) -> InternalMeasurement:
        return InternalMeasurement(needed - self.zero, np.eye(1))

    def R(self, hv: Vec) -> Mat:
        return np.array([[self.sd**2]])
