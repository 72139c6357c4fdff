"""A robot in space that reports how far it moved and turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D
from scene_core.models import free_body
from scene_core.models.base import (
    Lifted,
    MotionModel,
    Normalised,
    PositionState,
    Redefined,
    Transition,
)
from scene_core.models.sampling import noisy_process
from scene_core.params import param


@dataclass(frozen=True)
class Odometry3D(MotionModel):
    """Increments of position and orientation, both in the robot's frame.

    r' = r + R(q) dr;  q' = q * q(a)

    xv = xp = (x, y, z, qw, qx, qy, qz) [m, 1]; u = (dx, dy, dz, ax, ay, az) [m, rad], the second
    half a rotation vector; per step: dt is not used. U = diag(sd_position^2, sd_angle^2), Q = 0.

    Source: Solà, *An EKF-SLAM toolbox in Matlab*, motion model "odometry".
    """

    name = "6-DoF odometry"
    space = THREE_D
    state_labels = THREE_D.labels
    state_units = THREE_D.units
    control_labels = ("dx", "dy", "dz", "ax", "ay", "az")
    control_units = ("m", "m", "m", "rad", "rad", "rad")

    sd_position: float = param(
        0.005, unit="m", lo=0.0, hi=10.0, soft=(0.0, 0.05), label="Position noise"
    )
    """Standard deviation of every component of the displacement, per step."""
    sd_angle: float = param(
        np.deg2rad(0.05).item(),
        unit="rad",
        lo=0.0,
        hi=3.2,
        soft=(0.0, 0.02),
        label="Angle noise",
    )
    """Standard deviation of every component of the rotation vector, per step."""
    unknown_sd_position: float = param(0.05, unit="m", lo=0.0, hi=10.0, soft=(0.0, 0.2))
    """Standard deviation of the displacement, per step, while nobody sends odometry."""
    unknown_sd_angle: float = param(0.05, unit="rad", lo=0.0, hi=3.2, soft=(0.0, 0.2))
    """Standard deviation of the rotation, per step, while nobody sends odometry."""
    cruise: float = param(0.5, unit="m/s", lo=0.01, hi=50.0, soft=(0.05, 2.0), label="Cruise")
    """Speed on the way to a waypoint."""
    turn_rate: float = param(0.6, unit="rad/s", lo=0.0, hi=10.0, soft=(0.0, 2.0))
    """It turns at most this fast about its own z to have its x ahead on the way to a waypoint; 0
    where that is not its way: it keeps its orientation."""
    arrive: float = param(0.2, unit="m", lo=0.0, hi=5.0, soft=(0.02, 1.0), label="Arrival")
    """A waypoint counts as reached within this distance."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        moved = free_body.stepped(xv, u)
        return Transition(moved.xp, moved.by_xp, moved.by_step, np.zeros((7, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        return np.zeros((7, 7))

    def U(self, u: Vec, dt: float) -> Mat:
        return np.diag([self.sd_position**2] * 3 + [self.sd_angle**2] * 3)

    def U_unknown(self, dt: float) -> Mat:
        return np.diag([self.unknown_sd_position**2] * 3 + [self.unknown_sd_angle**2] * 3)

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv, np.eye(7))

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return free_body.redefine(xv, xpdef)

    def normalise(self, xv: Vec) -> Normalised:
        return free_body.normalise(xv)

    def lift(self, xp: Vec) -> Lifted:
        return free_body.at_rest(xp, [])

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Straight to `goal` (x, y, z) [m], turning to it on the way."""
        v = free_body.straight_to(xv[:3], goal, self.cruise, self.arrive, dt)
        if v is None:
            return None
        turn = free_body.turn_to(xv, goal, self.turn_rate, self.arrive, dt)
        return np.concatenate([quaternion.rotate_back(xv[3:], v * dt).v, turn])
