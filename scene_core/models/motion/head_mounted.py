"""A camera on somebody's head: who wears it moves as they like, but like a person."""

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


def _forgetting(x: float) -> tuple[float, float, Mat]:
    """For a velocity of unit spread that is forgotten in unit time, after the time x: what is left
    of it, the way it still leads to, and the covariance of (way, velocity) by what is new."""
    left, way = np.exp(-x), -np.expm1(-x)
    if x < 0.02:
        # The closed form loses all digits: it is a difference of terms that cancel to x^3.
        var_way = x**3 * (2 / 3 - x / 2 + x**2 * 7 / 30 - x**3 / 12 + x**4 * 31 / 1260)
    else:
        var_way = 2.0 * x - 3.0 + 4.0 * left - left * left
    return left, way, np.array([[var_way, way * way], [way * way, way * (1.0 + left)]])


@dataclass(frozen=True)
class HeadMounted(MotionModel):
    """Velocity and angular velocity that are soon forgotten, under an unknown outside influence.

    Who wears the sensor decides how it moves, and nobody tells the filter: all of it is noise.
    With e = exp(-dt/t), t = t_speed or t_turn:
    r' = r + t (1 - e) v + n_r;  v' = e v + n_v
    q' = q * q(t (1 - e) w + n_theta);  w' = e w + n_w
    cov(n_r, n_v) = sd_speed^2 [t^2 (2 dt/t - 3 + 4 e - e^2), t (1 - e)^2; t (1 - e)^2, 1 - e^2],
    on every axis; the same with sd_turn for (n_theta, n_w), mapped by dq'/dtheta

    xv = (x, y, z, qw, qx, qy, qz, vx, vy, vz, wx, wy, wz) [m, 1, m/s, rad/s]: v in the world, w in
    the robot. The model "impulse" lets the spread of its velocities grow without end; here it tends
    to sd_speed and sd_turn, what a person does, however long nothing is seen. Q is exact for every
    dt, so the noise does not depend on the length of a step; finite at w = 0.

    Source: Davison, *Models and State Representation in Scene*, section 3, unknown outside
    influences; the process is Singer's (IEEE TAES 1970), for velocity instead of acceleration.
    """

    name = "head mounted camera"
    space = THREE_D
    state_labels = (*THREE_D.labels, "vx", "vy", "vz", "wx", "wy", "wz")
    state_units = (*THREE_D.units, "m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s")

    sd_speed: float = param(
        0.7, unit="m/s", lo=0.0, hi=100.0, soft=(0.0, 3.0), label="Walking speed"
    )
    """Standard deviation of every component of the velocity, as long as nothing is seen: 0.7 m/s
    is a person who walks now and then."""
    t_speed: float = param(1.0, unit="s", lo=0.01, hi=1000.0, soft=(0.1, 10.0), label="Walks for")
    """After this time a velocity is all but forgotten: how long a person keeps walking."""
    sd_turn: float = param(
        1.0, unit="rad/s", lo=0.0, hi=100.0, soft=(0.0, 5.0), label="Turn of the head"
    )
    """Standard deviation of every component of the angular velocity, as long as nothing is seen."""
    t_turn: float = param(0.3, unit="s", lo=0.01, hi=1000.0, soft=(0.05, 3.0), label="Turns for")
    """After this time an angular velocity is all but forgotten: how long a glance takes."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        left_v, way_v, _ = _forgetting(dt / self.t_speed)
        left_w, way_w, _ = _forgetting(dt / self.t_turn)
        way_v, way_w = way_v * self.t_speed, way_w * self.t_turn
        turn = free_body.turned(xv[3:7], way_w * xv[10:])
        fv = np.concatenate(
            [xv[:3] + way_v * xv[7:10], turn.q, left_v * xv[7:10], left_w * xv[10:]]
        )
        dfv_by_dxv = np.zeros((13, 13))
        dfv_by_dxv[:3, :3], dfv_by_dxv[:3, 7:10] = np.eye(3), way_v * np.eye(3)
        dfv_by_dxv[3:7, 3:7], dfv_by_dxv[3:7, 10:] = turn.by_q, way_w * turn.by_theta
        dfv_by_dxv[7:10, 7:10], dfv_by_dxv[10:, 10:] = left_v * np.eye(3), left_w * np.eye(3)
        return Transition(fv, dfv_by_dxv, np.zeros((13, 0)), np.zeros((13, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        _, _, cov_v = _forgetting(dt / self.t_speed)
        _, way_w, cov_w = _forgetting(dt / self.t_turn)
        turn = free_body.turned(xv[3:7], self.t_turn * way_w * xv[10:])
        # (x y z, vx vy vz) and (rotation vector, wx wy wz), in metres and radians
        straight = np.zeros((13, 6))
        straight[:3, :3], straight[7:10, 3:] = self.t_speed * np.eye(3), np.eye(3)
        bent = np.zeros((13, 6))
        bent[3:7, :3], bent[10:, 3:] = self.t_turn * turn.by_theta, np.eye(3)
        return (
            straight @ np.kron(self.sd_speed**2 * cov_v, np.eye(3)) @ straight.T
            + bent @ np.kron(self.sd_turn**2 * cov_w, np.eye(3)) @ bent.T
        )

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv[:7], np.eye(13)[:7])

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return free_body.redefine(xv, xpdef, in_world=[7])

    def normalise(self, xv: Vec) -> Normalised:
        return free_body.normalise(xv)

    def lift(self, xp: Vec) -> Lifted:
        return free_body.at_rest(xp, [self.sd_speed] * 3 + [self.sd_turn] * 3)

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)
