"""A planar robot that reports how far it moved along, across, and how far it turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import TWO_D
from scene_core.models import planar
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
class PlanarIncrements(MotionModel):
    """Increments of position and heading, in the robot's frame.

    (z, x)' = (z, x) + R(phi) (dz, dx);  phi' = phi + dphi

    xv = xp = (z, x, phi) [m, m, rad], phi from z towards x; u = (dz, dx, dphi) [m, m, rad], dz
    ahead; per step: dt is not used. U = diag(sd_ahead^2, sd_across^2, sd_turn^2), Q = 0. Unlike a
    turn, a way and a turn it is regular for a robot that stands still.

    Source: Solà, *An EKF-SLAM toolbox in Matlab*, motion model "odometry", in the plane.
    """

    name = "planar increments"
    space = TWO_D
    state_labels = TWO_D.labels
    state_units = TWO_D.units
    control_labels = ("dz", "dx", "dphi")
    control_units = ("m", "m", "rad")

    sd_ahead: float = param(0.02, unit="m", lo=0.0, hi=10.0, soft=(0.0, 0.1), label="Noise ahead")
    """Standard deviation of the displacement along the heading, per step."""
    sd_across: float = param(0.01, unit="m", lo=0.0, hi=10.0, soft=(0.0, 0.1), label="Noise across")
    """Standard deviation of the displacement across the heading, per step."""
    sd_turn: float = param(0.01, unit="rad", lo=0.0, hi=3.2, soft=(0.0, 0.1), label="Turn noise")
    """Standard deviation of the turn, per step."""
    unknown_sd_position: float = param(0.2, unit="m", lo=0.0, hi=10.0, soft=(0.0, 1.0))
    """Standard deviation of the displacement, per step, while nobody sends odometry."""
    unknown_sd_turn: float = param(0.2, unit="rad", lo=0.0, hi=3.2, soft=(0.0, 1.0))
    """Standard deviation of the turn, per step, while nobody sends odometry."""
    cruise: float = param(0.3, unit="m/s", lo=0.01, hi=10.0, soft=(0.05, 1.0), label="Cruise")
    """Speed on the way to a waypoint."""
    turn_rate: float = param(0.6, unit="rad/s", lo=0.01, hi=10.0, soft=(0.1, 2.0))
    """It turns at most this fast towards a waypoint."""
    arrive: float = param(0.2, unit="m", lo=0.0, hi=5.0, soft=(0.02, 1.0), label="Arrival")
    """A waypoint counts as reached within this distance."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        step = TWO_D.compose(xv, u)
        return Transition(step.x, step.by_a, step.by_b, np.zeros((3, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        return np.zeros((3, 3))

    def U(self, u: Vec, dt: float) -> Mat:
        return np.diag([self.sd_ahead**2, self.sd_across**2, self.sd_turn**2])

    def U_unknown(self, dt: float) -> Mat:
        return np.diag([self.unknown_sd_position**2] * 2 + [self.unknown_sd_turn**2])

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv, np.eye(3))

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return planar.redefine(xv, xpdef, (2,))

    def normalise(self, xv: Vec) -> Normalised:
        return planar.normalise(xv, (2,))

    def lift(self, xp: Vec) -> Lifted:
        return Lifted(xp, np.eye(3), np.zeros((3, 3)))

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Drive and turn to `goal` (z, x) [m], slowly while it is not ahead."""
        ahead = planar.goal_from(xv[:2], xv[2], goal, self.arrive)
        if ahead is None:
            return None
        turn = planar.limited(ahead.bearing, self.turn_rate, dt)
        return np.array([planar.cruising(ahead, 0.0, self.cruise, dt) * dt, 0.0, turn])
