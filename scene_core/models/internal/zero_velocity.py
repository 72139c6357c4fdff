"""What a robot knows when it stands still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import Fault, InternalMeasurement, InternalMeasurementModel
from scene_core.params import param

MOVING, TURNING = ("vx", "vy", "vz"), ("wx", "wy", "wz")


@dataclass(frozen=True)
class ZeroVelocity(InternalMeasurementModel):
    """hv = (v, w) [m/s, rad/s], to be compared with zero; R = diag(sd^2 I, sd_turn^2 I).

    A pseudo-measurement: where a detector says "at rest" the measured value is zero. Used only
    while the estimate itself is slow, or it would stop a robot that moves.

    Source: Foxlin, *Pedestrian tracking with shoe-mounted inertial sensors*, CG&A 2005.
    """

    name = "zero velocity"

    turning: bool = True
    """Whether the angular velocity is measured too; it says how long a measurement is, so it is
    not for editing while running."""
    sd: float = param(0.01, unit="m/s", lo=1e-6, hi=1.0, soft=(0.001, 0.1), label="Noise")
    """Standard deviation of every component of the velocity of what is called rest."""
    sd_turn: float = param(0.01, unit="rad/s", lo=1e-6, hi=1.0, soft=(0.001, 0.1))
    """The same for the angular velocity."""
    most: float = param(0.1, unit="m/s", lo=0.0, hi=10.0, soft=(0.0, 1.0), label="Speed, max")
    """Not used when the estimated speed is above this."""
    most_turn: float = param(
        0.2, unit="rad/s", lo=0.0, hi=10.0, soft=(0.0, 1.0), label="Turn rate, max"
    )
    """Not used when the estimated turn rate is above this."""

    @property
    def needs(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return MOVING + TURNING if self.turning else MOVING

    @property
    def labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.needs

    @property
    def units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("m/s",) * 3 + ("rad/s",) * (len(self.needs) - 3)

    def h(self, needed: Vec) -> InternalMeasurement:
        return InternalMeasurement(needed, np.eye(len(needed)))

    def R(self, hv: Vec) -> Mat:
        return np.diag([self.sd**2] * 3 + [self.sd_turn**2] * (len(hv) - 3))

    def feasible(self, needed: Vec, hv: Vec) -> Fault:
        speed, turn = np.linalg.norm(needed[:3]), np.linalg.norm(needed[3:])
        fast = speed > self.most or turn > self.most_turn
        return Fault.INFEASIBLE if fast else Fault.NONE
