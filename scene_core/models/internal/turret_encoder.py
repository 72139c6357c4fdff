"""An encoder on the turret of a nomad."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.angle_reading import AngleReading
from scene_core.models.base import InternalMeasurement


@dataclass(frozen=True)
class TurretEncoder(AngleReading):
    """hv = wrap(T - zero) [rad], the turret against the base, which never turns; R = sd^2.

    Source: Davison, *Models and State Representation in Scene*, section 5.3.
    """

    name = "turret encoder"
    needs = ("T",)
    labels = ("turret",)
    world_fixed = ("north",)

    def h(self, needed: Vec) -> InternalMeasurement:
        return self.reading(needed[0], np.ones(1))
