"""A body in space of which nothing is known but where it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
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
from scene_core.models.sampling import gaussian
from scene_core.params import param


@dataclass(frozen=True)
class ZeroOrder(MotionModel):
    """It stays where it is, but for a velocity V and a turn rate Omega that nobody knows.

    r' = r + V dt;  q' = q * q(Omega dt);  V ~ N(0, sd_speed^2), Omega ~ N(0, sd_turn^2)
    Q = G diag((sd_speed dt)^2, (sd_turn dt)^2) G',  G = [I, 0; 0, dq'/d(Omega dt)] at Omega = 0

    xv = xp = (x, y, z, qw, qx, qy, qz) [m, 1]: V in the world, Omega in the robot, both constant
    within a step and independent between steps.

    Source: Davison, Scene library, zero-order motion model; its dq'/dOmega is taken at 4 rad/s.
    """

    name = "zero order"
    space = THREE_D
    state_labels = THREE_D.labels
    state_units = THREE_D.units

    sd_speed: float = param(
        12.0, unit="m/s", lo=0.0, hi=1000.0, soft=(0.0, 20.0), label="Speed noise"
    )
    """Standard deviation of every component of the unknown velocity: how fast it may move."""
    sd_turn: float = param(
        4.0, unit="rad/s", lo=0.0, hi=1000.0, soft=(0.0, 10.0), label="Turn noise"
    )
    """Standard deviation of every component of the unknown turn rate: how fast it may turn."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        return Transition(xv.copy(), np.eye(7), np.zeros((7, 0)), np.zeros((7, 0)))

    def _step_covariance(self, dt: float) -> Mat:
        """Of the displacement and the rotation vector (6, 6)."""
        return np.diag([(self.sd_speed * dt) ** 2] * 3 + [(self.sd_turn * dt) ** 2] * 3)

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        G = np.zeros((7, 6))
        G[:3, :3] = np.eye(3)
        G[3:, 3:] = free_body.turned(xv[3:], np.zeros(3)).by_theta
        return G @ self._step_covariance(dt) @ G.T

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv, np.eye(7))

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return free_body.redefine(xv, xpdef)

    def normalise(self, xv: Vec) -> Normalised:
        return free_body.normalise(xv)

    def lift(self, xp: Vec) -> Lifted:
        return free_body.at_rest(xp, [])

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        step = gaussian(self._step_covariance(dt), rng)
        turn = free_body.turned(xv[3:], step[3:])
        return free_body.normalise(np.concatenate([xv[:3] + step[:3], turn.q])).value
