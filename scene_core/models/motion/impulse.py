"""A free body in space with smooth velocity: a camera in somebody's hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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
from scene_core.params import param


@dataclass(frozen=True)
class Impulse(MotionModel):
    """Constant velocity and angular velocity, disturbed by impulses n = (V, Omega).

    r' = r + (v + V) dt;  q' = q * q((w + Omega) dt);  v' = v + V;  w' = w + Omega
    Q = G diag(sd_V^2, sd_Omega^2) G',  G = [I dt, 0; 0, dq'/dOmega; I, 0; 0, I] at n = 0

    xv = (x, y, z, qw, qx, qy, qz, vx, vy, vz, wx, wy, wz) [m, 1, m/s, rad/s]: v in the world,
    w in the robot. Per second: sd_V = sd_accel dt, sd_Omega = sd_ang_accel dt; per step: sd_V =
    sd_accel, sd_Omega = sd_ang_accel, whatever dt.

    Source: Davison, Reid, Molton, Stasse, *MonoSLAM*, PAMI 2007, section 3.4, whose Jacobian is 0/0
    at w = 0 in the released library, and which could not change axes; per step: Solà, *An EKF-SLAM
    toolbox in Matlab*, motion model "constVel", which turns by q + q w dt / 2 in the filter alone,
    and whose impulses move the robot from the next step on.
    """

    name = "impulse"
    space = THREE_D
    state_labels = (*THREE_D.labels, "vx", "vy", "vz", "wx", "wy", "wz")
    state_units = (*THREE_D.units, "m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s")

    sd_accel: float = param(
        4.0, unit="m/s²", lo=0.0, hi=1000.0, soft=(0.0, 20.0), label="Acceleration"
    )
    """Standard deviation of the acceleration, constant within a step and independent between
    steps: how suddenly it may be pushed. With noise per step: of the velocity's jump, in m/s."""
    sd_ang_accel: float = param(
        6.0, unit="rad/s²", lo=0.0, hi=1000.0, soft=(0.0, 30.0), label="Angular acceleration"
    )
    """Standard deviation of the angular acceleration: how suddenly it may be turned. With noise per
    step: of the angular velocity's jump, in rad/s."""
    noise_per: Literal["second", "step"] = param(
        "second", choices=("second", "step"), label="Noise per"
    )
    """second: impulses are acceleration times dt (SceneLib). step: impulses do not depend on dt
    (the toolbox)."""
    rest_sd_speed: float = param(
        1.0, unit="m/s", lo=0.0, hi=100.0, soft=(0.0, 5.0), effect="on reset", label="Start speed"
    )
    """Standard deviation of every component of the velocity when the robot is taken over from a
    model that has none."""
    rest_sd_turn: float = param(
        1.0, unit="rad/s", lo=0.0, hi=100.0, soft=(0.0, 5.0), effect="on reset", label="Start turn"
    )
    """The same for the angular velocity."""

    def _sds(self, dt: float) -> tuple[float, float]:
        scale = dt if self.noise_per == "second" else 1.0
        return self.sd_accel * scale, self.sd_ang_accel * scale

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        turn = free_body.turned(xv[3:7], xv[10:] * dt)
        fv = xv.copy()
        fv[:3] += xv[7:10] * dt
        fv[3:7] = turn.q
        dfv_by_dxv = np.eye(13)
        dfv_by_dxv[:3, 7:10] = dt * np.eye(3)
        dfv_by_dxv[3:7, 3:7] = turn.by_q
        dfv_by_dxv[3:7, 10:] = turn.by_theta * dt
        return Transition(fv, dfv_by_dxv, np.zeros((13, 0)), np.zeros((13, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        sd_V, sd_Omega = self._sds(dt)
        turn = free_body.turned(xv[3:7], xv[10:] * dt)
        G = np.zeros((13, 6))
        G[:3, :3] = sd_V * dt * np.eye(3)
        G[7:10, :3] = sd_V * np.eye(3)
        G[3:7, 3:] = sd_Omega * dt * turn.by_theta
        G[10:, 3:] = sd_Omega * np.eye(3)
        return G @ G.T

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv[:7], np.eye(13)[:7])

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return free_body.redefine(xv, xpdef, in_world=[7])

    def normalise(self, xv: Vec) -> Normalised:
        return free_body.normalise(xv)

    def lift(self, xp: Vec) -> Lifted:
        return free_body.at_rest(xp, [self.rest_sd_speed] * 3 + [self.rest_sd_turn] * 3)

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        sd_V, sd_Omega = self._sds(dt)
        pushed = xv.copy()
        pushed[7:10] += sd_V * rng.standard_normal(3)
        pushed[10:] += sd_Omega * rng.standard_normal(3)
        return self.normalise(self.f(pushed, u, dt, k).fv).value
