"""An inclinometer: how far a robot leans from the vertical."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import wrap
from scene_core.models.base import Fault, InternalMeasurement, InternalMeasurementModel
from scene_core.models.labels import QUATERNION
from scene_core.params import param

AXES = {"y": (0, 2, 1), "z": (1, 0, 2)}
"""Axes of the body: left, forward, up."""


@dataclass(frozen=True)
class RollPitch(InternalMeasurementModel):
    """hv = (atan2(Y_left, Y_up), atan2(-Y_forward, Y_up)) [rad], Y = R(q)' e_up; R = sd^2 I.

    Y is the world's vertical in the body: where y is up the body is x left, y up, z forward
    (Scene), where z is up it is x forward, y left, z up. Roll and pitch are the angles of Y in two
    planes of the body, not Euler's. Not used on its side, where they lose their meaning.

    Source: Davison, Scene library, ROLL_PITCH; its derivative of the pitch has the roll's factor.
    """

    name = "roll and pitch"
    needs = QUATERNION
    labels = ("roll", "pitch")
    units = ("rad", "rad")
    world_fixed = ("gravity",)

    sd: float = param(
        np.deg2rad(0.4).item(), unit="rad", lo=1e-6, hi=3.2, soft=(0.001, 0.1), label="Noise"
    )
    """Standard deviation of either angle."""
    up: Literal["y", "z"] = param("z", choices=("y", "z"), label="Up")
    """Which axis of the world points up."""
    most: float = param(
        np.deg2rad(80.0).item(), unit="rad", lo=0.0, hi=np.pi / 2, label="Lean, max"
    )
    """Not used when the robot leans more than this."""

    def _vertical(self, q: Vec) -> quaternion.Rotated:
        return quaternion.rotate_back(q, np.eye(3)["xyz".index(self.up)])

    def h(self, needed: Vec) -> InternalMeasurement:
        Y = self._vertical(needed)
        left, forward, up = AXES[self.up]
        a, c, b = Y.v[left], -Y.v[forward], Y.v[up]
        dhv_by_dY = np.zeros((2, 3))
        for row, (side, axis, sign) in enumerate([(a, left, 1.0), (c, forward, -1.0)]):
            # Lying exactly on the other side the angle is undefined: it teaches nothing there.
            length2 = max(side * side + b * b, 1e-12)
            dhv_by_dY[row, axis], dhv_by_dY[row, up] = sign * b / length2, -side / length2
        return InternalMeasurement(np.arctan2([a, c], b), dhv_by_dY @ Y.by_q)

    def R(self, hv: Vec) -> Mat:
        return self.sd**2 * np.eye(2)

    def nu(self, hv: Vec, zv: Vec) -> Vec:
        return wrap(zv - hv)

    def feasible(self, needed: Vec, hv: Vec) -> Fault:
        Y = self._vertical(needed).v
        upright = Y[AXES[self.up][2]] >= np.cos(self.most) * np.linalg.norm(Y)
        return Fault.NONE if upright else Fault.INFEASIBLE
