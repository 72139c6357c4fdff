"""A free body in space whose accelerations change slowly."""

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
from scene_core.models.sampling import noisy_process
from scene_core.params import param

STRAIGHT = [0, 1, 2, 7, 8, 9, 13, 14, 15]
"""Rows of position, velocity and acceleration."""
ROUND = [3, 4, 5, 6, 10, 11, 12, 16, 17, 18]
"""Rows of orientation, angular velocity and angular acceleration."""


@dataclass(frozen=True)
class ConstantAcceleration(MotionModel):
    """Constant acceleration and angular acceleration, disturbed by white jerk.

    r' = r + v dt + a dt^2/2;  v' = v + a dt;  a' = a
    q' = q * q(w dt + alpha dt^2/2);  w' = w + alpha dt;  alpha' = alpha
    Q = G (J sd_a^2, J sd_alpha^2) G',  G = [I, 0; 0, dq'/dtheta],  for each axis
    J = [dt^5/20, dt^4/8, dt^3/6; dt^4/8, dt^3/3, dt^2/2; dt^3/6, dt^2/2, dt]

    xv = (r, q, v, w, a, alpha) (19,) [m, 1, m/s, rad/s, m/s^2, rad/s^2]: v and a in the world, w
    and alpha in the robot. The rotation is exact while w and alpha are parallel, and of the second
    order in dt otherwise. J is exact, so that the noise does not depend on the length of a step;
    finite at w = 0.

    Source: Bar-Shalom, Li, Kirubarajan, *Estimation with Applications*, section 6.2.3, for every
    axis of translation and rotation; as an alternative to MonoSLAM's constant velocity.
    """

    name = "constant acceleration"
    space = THREE_D
    # fmt: off
    state_labels = (*THREE_D.labels, "vx", "vy", "vz", "wx", "wy", "wz",
                    "ax", "ay", "az", "alphax", "alphay", "alphaz")
    # fmt: on
    state_units = (*THREE_D.units, *["m/s"] * 3, *["rad/s"] * 3, *["m/s²"] * 3, *["rad/s²"] * 3)

    sd_accel: float = param(
        5.0, unit="m/s²", lo=0.0, hi=1000.0, soft=(0.0, 50.0), label="Acceleration change"
    )
    """Standard deviation of the change of every component of the acceleration in one second; it
    grows with the square root of time."""
    sd_ang_accel: float = param(
        10.0, unit="rad/s²", lo=0.0, hi=1000.0, soft=(0.0, 100.0), label="Angular change"
    )
    """The same for the angular acceleration."""
    rest_sd_speed: float = param(
        1.0, unit="m/s", lo=0.0, hi=100.0, soft=(0.0, 5.0), effect="on reset", label="Start speed"
    )
    """Standard deviation of every component of the velocity when the robot is taken over from a
    model that has none."""
    rest_sd_turn: float = param(
        1.0, unit="rad/s", lo=0.0, hi=100.0, soft=(0.0, 5.0), effect="on reset", label="Start turn"
    )
    """The same for the angular velocity."""
    rest_sd_accel: float = param(
        2.0, unit="m/s²", lo=0.0, hi=1000.0, soft=(0.0, 20.0), effect="on reset"
    )
    """The same for the acceleration."""
    rest_sd_ang_accel: float = param(
        3.0, unit="rad/s²", lo=0.0, hi=1000.0, soft=(0.0, 30.0), effect="on reset"
    )
    """The same for the angular acceleration."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        half = 0.5 * dt * dt
        turn = free_body.turned(xv[3:7], xv[10:13] * dt + xv[16:] * half)
        fv = xv.copy()
        fv[:3] += xv[7:10] * dt + xv[13:16] * half
        fv[3:7] = turn.q
        fv[7:13] += xv[13:] * dt
        dfv_by_dxv = np.eye(19)
        dfv_by_dxv[:3, 7:10], dfv_by_dxv[:3, 13:16] = dt * np.eye(3), half * np.eye(3)
        dfv_by_dxv[3:7, 3:7] = turn.by_q
        dfv_by_dxv[3:7, 10:13], dfv_by_dxv[3:7, 16:] = turn.by_theta * dt, turn.by_theta * half
        dfv_by_dxv[7:13, 13:] = dt * np.eye(6)
        return Transition(fv, dfv_by_dxv, np.zeros((19, 0)), np.zeros((19, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        # fmt: off
        J = np.array([[dt**5 / 20, dt**4 / 8, dt**3 / 6],
                      [dt**4 /  8, dt**3 / 3, dt**2 / 2],
                      [dt**3 /  6, dt**2 / 2, dt       ]])
        # fmt: on
        white = np.kron(J, np.eye(3))
        turn = free_body.turned(xv[3:7], xv[10:13] * dt + 0.5 * xv[16:] * dt * dt)
        G = np.zeros((10, 9))
        G[:4, :3], G[4:, 3:] = turn.by_theta, np.eye(6)
        Q = np.zeros((19, 19))
        Q[np.ix_(STRAIGHT, STRAIGHT)] = self.sd_accel**2 * white
        Q[np.ix_(ROUND, ROUND)] = self.sd_ang_accel**2 * (G @ white @ G.T)
        return Q

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv[:7], np.eye(19)[:7])

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return free_body.redefine(xv, xpdef, in_world=[7, 13])

    def normalise(self, xv: Vec) -> Normalised:
        return free_body.normalise(xv)

    def lift(self, xp: Vec) -> Lifted:
        sds = self.rest_sd_speed, self.rest_sd_turn, self.rest_sd_accel, self.rest_sd_ang_accel
        return free_body.at_rest(xp, np.repeat(sds, 3).tolist())

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)
