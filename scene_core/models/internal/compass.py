"""A compass: the heading about the vertical."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry import quaternion
from scene_core.models.angle_reading import AngleReading
from scene_core.models.base import Fault, InternalMeasurement
from scene_core.models.labels import QUATERNION
from scene_core.params import param

LEVEL = {"y": (2, 0), "z": (0, 1)}
"""Axes of the world that span the level plane: the heading turns from the first to the second."""


@dataclass(frozen=True)
class Compass(AngleReading):
    """hv = wrap(heading - zero) [rad]; R = sd^2.

    In space: d = R(q) e_forward, heading = atan2(dx, dz) where y is up, atan2(dy, dx) where z is;
    in the plane the heading is a component of the state. Not used while the forward axis is nearly
    vertical, where it has no heading.

    Source: Davison, *Models and State Representation in Scene*, section 5.3; the heading is that
    of its section 4.2.
    """

    name = "compass"
    labels = ("heading",)

    component: Literal["quaternion", "phi", "T"] = param(
        "quaternion", choices=("quaternion", "phi", "T"), label="Component"
    )
    """What it turns with: a body in space, or the heading of a planar robot: phi; T, its turret."""
    up: Literal["y", "z"] = param("z", choices=("y", "z"), label="Up")
    """Which axis of the world points up; of no meaning for a planar robot."""
    forward: Literal["x", "y", "z"] = param("x", choices=("x", "y", "z"), label="Forward")
    """Which axis of the body has the heading; of no meaning for a planar robot."""
    least_level: float = param(0.2, lo=1e-3, hi=1.0, label="Level part, min")
    """Not used when the level part of the forward axis is shorter than this; 0.2 is 78 degrees
    up or down."""

    @property
    def world_fixed(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """A body in space must know what is level before it has a heading."""
        return ("north", "gravity") if self.component == "quaternion" else ("north",)

    @property
    def needs(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return QUATERNION if self.component == "quaternion" else (self.component,)

    def _level(self, q: Vec) -> tuple[float, float, quaternion.Rotated]:
        pointing = quaternion.rotate(q, np.eye(3)["xyz".index(self.forward)])
        ahead, across = LEVEL[self.up]
        return pointing.v[ahead], pointing.v[across], pointing

    def h(self, needed: Vec) -> InternalMeasurement:
        if self.component != "quaternion":
            return self.reading(needed[0], np.ones(1))
        a, c, pointing = self._level(needed)
        ahead, across = LEVEL[self.up]
        # Upright there is no heading, and nothing to learn about it.
        length2 = max(a * a + c * c, 1e-12)
        by_q = (a * pointing.by_q[across] - c * pointing.by_q[ahead]) / length2
        return self.reading(np.arctan2(c, a), by_q)

    def feasible(self, needed: Vec, hv: Vec) -> Fault:
        if self.component != "quaternion":
            return Fault.NONE
        a, c, _ = self._level(needed)
        return Fault.INFEASIBLE if np.hypot(a, c) < self.least_level else Fault.NONE
