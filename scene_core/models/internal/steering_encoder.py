"""An encoder on the steering."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.angle_reading import AngleReading
from scene_core.models.base import InternalMeasurement
from scene_core.params import param


@dataclass(frozen=True)
class SteeringEncoder(AngleReading):
    """hv = wrap(steering angle - zero) [rad]; R = sd^2.

    Source: Davison, *Models and State Representation in Scene*, section 5.3: odometry as an
    internal measurement.
    """

    name = "steering encoder"
    labels = ("steering",)

    component: Literal["delta", "S"] = param("delta", choices=("delta", "S"), label="Component")
    """The angle it is fixed to: delta, of a car's front wheels to its body; S, of a nomad's wheels
    to its base, which never turns and so keeps the world's axes."""

    @property
    def needs(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return (self.component,)

    @property
    def world_fixed(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("north",) if self.component == "S" else ()

    def h(self, needed: Vec) -> InternalMeasurement:
        return self.reading(needed[0], np.ones(1))
