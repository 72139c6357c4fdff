"""A body in space whose velocity and turn rate are measured on board."""

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
class BodyRates(MotionModel):
    """Velocity and turn rate, both in the robot's frame, held over dt.

    r' = r + R(q) v dt;  q' = q * q(w dt)

    xv = xp = (x, y, z, qw, qx, qy, qz) [m, 1]; u = (vx, vy, vz, wx, wy, wz) [m/s, rad/s].
    U = diag(sd_v^2, sd_w^2) for every control sample, however long it is held; Q = 0.

    Source: Solà, *An EKF-SLAM toolbox in Matlab*, motion model "odometry", its increments being
    rates times dt; the log it is made for: T. Barfoot, *Starry Night*.
    """

    name = "body rates"
    space = THREE_D
    state_labels = THREE_D.labels
    state_units = THREE_D.units
    control_labels = ("vx", "vy", "vz", "wx", "wy", "wz")
    control_units = ("m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s")

    sd_v: float = param(0.05, unit="m/s", lo=0.0, hi=10.0, soft=(0.0, 0.5), label="Speed noise")
    """Standard deviation of every component of the velocity in one control sample."""
    sd_w: float = param(0.05, unit="rad/s", lo=0.0, hi=20.0, soft=(0.0, 0.5), label="Turn noise")
    """Standard deviation of every component of the turn rate in one control sample."""
    unknown_sd_v: float = param(1.0, unit="m/s", lo=0.0, hi=10.0, soft=(0.0, 3.0))
    """Standard deviation of the velocity while nobody measures it."""
    unknown_sd_w: float = param(1.0, unit="rad/s", lo=0.0, hi=20.0, soft=(0.0, 3.0))
    """Standard deviation of the turn rate while nobody measures it."""
    cruise: float = param(0.5, unit="m/s", lo=0.01, hi=50.0, soft=(0.05, 2.0), label="Cruise")
    """Speed on the way to a waypoint."""
    turn_rate: float = param(0.6, unit="rad/s", lo=0.0, hi=10.0, soft=(0.0, 2.0))
    """It turns at most this fast about its own z to have its x ahead on the way to a waypoint; 0
    where that is not its way: it keeps its orientation."""
    arrive: float = param(0.2, unit="m", lo=0.0, hi=5.0, soft=(0.02, 1.0), label="Arrival")
    """A waypoint counts as reached within this distance."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        moved = free_body.stepped(xv, u * dt)
        return Transition(moved.xp, moved.by_xp, moved.by_step * dt, np.zeros((7, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        return np.zeros((7, 7))

    def U(self, u: Vec, dt: float) -> Mat:
        return np.diag([self.sd_v**2] * 3 + [self.sd_w**2] * 3)

    def U_unknown(self, dt: float) -> Mat:
        return np.diag([self.unknown_sd_v**2] * 3 + [self.unknown_sd_w**2] * 3)

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
        return np.concatenate([quaternion.rotate_back(xv[3:], v).v, turn / dt])
