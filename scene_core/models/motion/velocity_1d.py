"""A vehicle on a line, driven by its velocity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import ONE_D
from scene_core.models.base import Lifted, MotionModel, PositionState, Redefined, Transition
from scene_core.models.sampling import noisy_process
from scene_core.params import param


@dataclass(frozen=True)
class Velocity1D(MotionModel):
    """Position on a line under a commanded velocity.

    z' = z + v dt;  xv = (z) [m], u = (v) [m/s], U = (sd_fraction v)^2, Q = 0.

    Source: Davison, Scene library, one-dimensional example robot.
    """

    name = "1-D velocity"
    space = ONE_D
    state_labels = ("z",)
    state_units = ("m",)
    control_labels = ("v",)
    control_units = ("m/s",)

    sd_fraction: float = param(0.1, lo=0.0, hi=2.0, soft=(0.0, 0.5), label="Speed noise")
    """Standard deviation of the true velocity, as a fraction of the commanded one."""
    unknown_sd_v: float = param(0.2, unit="m/s", lo=0.0, hi=10.0, soft=(0.0, 1.0))
    """Standard deviation of the velocity while nobody sends a command."""
    cruise: float = param(0.1, unit="m/s", lo=0.001, hi=10.0, soft=(0.01, 1.0), label="Cruise")
    """Speed on the way to a waypoint."""
    arrive: float = param(0.02, unit="m", lo=0.0, hi=1.0, soft=(0.0, 0.2), label="Arrival")
    """A waypoint counts as reached within this distance."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        return Transition(xv + u * dt, np.eye(1), np.full((1, 1), dt), np.zeros((1, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        return np.zeros((1, 1))

    def U(self, u: Vec, dt: float) -> Mat:
        return np.diag((self.sd_fraction * u) ** 2)

    def U_unknown(self, dt: float) -> Mat:
        return np.full((1, 1), self.unknown_sd_v**2)

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv, np.eye(1))

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return Redefined(xv - xpdef, np.eye(1), -np.eye(1))

    def lift(self, xp: Vec) -> Lifted:
        return Lifted(xp, np.eye(1), np.zeros((1, 1)))

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Cruise towards `goal` (z) [m]; half-steps within two steps of it."""
        gap = float(goal[0] - xv[0])
        if abs(gap) <= self.arrive:
            return None
        if abs(gap) < 2.0 * self.cruise * dt:
            return np.array([0.5 * gap / dt])
        return np.array([np.copysign(self.cruise, gap)])
