"""A body in space that carries an accelerometer and a rate gyro, both with drifting biases."""

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

POSE, V, BA, BG = slice(0, 7), slice(7, 10), slice(10, 13), slice(13, 16)
R, Q_WR = slice(0, 3), slice(3, 7)
TAU = 0.3
"""[s] in which a body on its way takes on the velocity it should have."""


@dataclass(frozen=True)
class Inertial(MotionModel):
    """Specific force and angular velocity, both in the body, as controls; biases in the state.

    a_W = R(q_mid) (a - ba) + g,  q_mid = q * q((w - bg) dt / 2)
    r' = r + v dt + a_W dt^2 / 2;  v' = v + a_W dt;  q' = q * q((w - bg) dt);  ba' = ba, bg' = bg

    xv = (x, y, z, qw, qx, qy, qz, vx, vy, vz, bax, bay, baz, bgx, bgy, bgz)
    [m, 1, m/s, m/s^2, rad/s]: v in the world, biases in the body;
    u = (ax, ay, az, wx, wy, wz) [m/s^2, rad/s]. The rotation is exact for a constant rate, the
    mean acceleration is taken half way through the turn.
    U = diag(noise_accel^2, noise_gyro^2) / dt,  Q = diag(0, walk_accel^2, walk_gyro^2) dt.

    Source: Solà, *Quaternion kinematics for the error-state Kalman filter*, sections 5.1 and 5.4.
    """

    name = "inertial"
    space = THREE_D
    # fmt: off
    state_labels = (*THREE_D.labels, "vx", "vy", "vz",
                    "bax", "bay", "baz", "bgx", "bgy", "bgz")
    # fmt: on
    state_units = (*THREE_D.units, *("m/s",) * 3, *("m/s²",) * 3, *("rad/s",) * 3)
    control_labels = ("ax", "ay", "az", "wx", "wy", "wz")
    control_units = (*("m/s²",) * 3, *("rad/s",) * 3)
    world_fixed = ("gravity",)

    gravity: tuple[float, float, float] = param(
        (0.0, 0.0, -9.81), unit="m/s²", lo=-100.0, hi=100.0, label="Gravity"
    )
    """Acceleration of free fall in the world's axes; (0, -9.81, 0) where y points up."""
    noise_accel: float = param(
        0.02, unit="m/s²/√Hz", lo=0.0, hi=100.0, soft=(0.0, 0.2), label="Accelerometer noise"
    )
    """Noise density of the accelerometer, as in its data sheet: the standard deviation of a sample
    held for dt is this over the root of dt."""
    noise_gyro: float = param(
        0.002, unit="rad/s/√Hz", lo=0.0, hi=10.0, soft=(0.0, 0.02), label="Gyro noise"
    )
    """Noise density of the gyro, as in its data sheet."""
    walk_accel: float = param(
        0.001, unit="m/s²/√s", lo=0.0, hi=10.0, soft=(0.0, 0.01), label="Accelerometer drift"
    )
    """Random walk of the accelerometer's bias: its standard deviation after one second."""
    walk_gyro: float = param(
        0.0001, unit="rad/s/√s", lo=0.0, hi=1.0, soft=(0.0, 0.001), label="Gyro drift"
    )
    """Random walk of the gyro's bias: its standard deviation after one second."""
    unknown_sd_accel: float = param(15.0, unit="m/s²", lo=0.0, hi=1000.0, soft=(0.0, 50.0))
    """Standard deviation of the specific force while nobody sends any; at rest it is 9.81 m/s²."""
    unknown_sd_gyro: float = param(6.0, unit="rad/s", lo=0.0, hi=1000.0, soft=(0.0, 20.0))
    """Standard deviation of the angular velocity while nobody sends any."""
    rest_sd_speed: float = param(
        1.0, unit="m/s", lo=0.0, hi=100.0, soft=(0.0, 5.0), effect="on reset", label="Start speed"
    )
    """Standard deviation of every component of the velocity when the robot is taken over from a
    model that has none."""
    rest_sd_accel_bias: float = param(
        0.1, unit="m/s²", lo=0.0, hi=10.0, soft=(0.0, 0.5), effect="on reset"
    )
    """The same for the accelerometer's bias."""
    rest_sd_gyro_bias: float = param(
        0.02, unit="rad/s", lo=0.0, hi=1.0, soft=(0.0, 0.1), effect="on reset"
    )
    """The same for the gyro's bias."""
    cruise: float = param(0.5, unit="m/s", lo=0.01, hi=50.0, soft=(0.05, 2.0), label="Cruise")
    """Speed on the way to a waypoint."""
    max_accel: float = param(1.0, unit="m/s²", lo=0.01, hi=50.0, soft=(0.1, 5.0))
    """It accelerates and brakes at most this hard on the way to a waypoint."""
    turn_rate: float = param(0.6, unit="rad/s", lo=0.0, hi=10.0, soft=(0.0, 2.0))
    """It turns at most this fast about its own z to have its x ahead on the way to a waypoint; 0
    where that is not its way: it keeps its orientation."""
    arrive: float = param(0.2, unit="m", lo=0.0, hi=5.0, soft=(0.02, 1.0), label="Arrival")
    """A waypoint counts as reached within this distance."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        q, rate = xv[Q_WR], u[3:] - xv[BG]
        turn, half = free_body.turned(q, rate * dt), free_body.turned(q, rate * dt / 2)
        force = quaternion.rotate(half.q, u[:3] - xv[BA])
        accel = force.v + np.array(self.gravity)
        fv = xv.copy()
        fv[R] += xv[V] * dt + accel * (dt**2 / 2)
        fv[V] += accel * dt
        fv[Q_WR] = turn.q
        # Columns of du are (a, w); the biases enter as -u.
        by_u = np.zeros((3, 6))
        by_u[:, :3] = force.by_v
        by_u[:, 3:] = force.by_q @ half.by_theta * (dt / 2)
        dfv_by_du = np.zeros((16, 6))
        dfv_by_du[R], dfv_by_du[V] = by_u * (dt**2 / 2), by_u * dt
        dfv_by_du[Q_WR, 3:] = turn.by_theta * dt
        by_q = force.by_q @ half.by_q
        dfv_by_dxv = np.eye(16)
        dfv_by_dxv[R, V] = dt * np.eye(3)
        dfv_by_dxv[R, Q_WR], dfv_by_dxv[V, Q_WR] = by_q * (dt**2 / 2), by_q * dt
        dfv_by_dxv[Q_WR, Q_WR] = turn.by_q
        dfv_by_dxv[:, 10:] -= dfv_by_du
        return Transition(fv, dfv_by_dxv, dfv_by_du, np.zeros((16, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        walk = [self.walk_accel**2 * dt] * 3 + [self.walk_gyro**2 * dt] * 3
        return np.diag([0.0] * 10 + walk)

    def U(self, u: Vec, dt: float) -> Mat:
        density = np.array([self.noise_accel] * 3 + [self.noise_gyro] * 3)
        # A sample that is held for no time moves nothing, whatever its noise.
        return np.diag(density**2 / dt) if dt > 0.0 else np.zeros((6, 6))

    def U_unknown(self, dt: float) -> Mat:
        return np.diag([self.unknown_sd_accel**2] * 3 + [self.unknown_sd_gyro**2] * 3)

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv[POSE], np.eye(16)[POSE])

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return free_body.redefine(xv, xpdef, in_world=(V.start,))

    def normalise(self, xv: Vec) -> Normalised:
        return free_body.normalise(xv)

    def lift(self, xp: Vec) -> Lifted:
        sds = [self.rest_sd_speed] * 3 + [self.rest_sd_accel_bias] * 3
        return free_body.at_rest(xp, sds + [self.rest_sd_gyro_bias] * 3)

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)

    def stay(self, xv: Vec, dt: float) -> Vec:
        """Brakes, and holds its own weight: the controls of a body that hovers."""
        return self._pushed(xv, -xv[V], np.zeros(3), dt)

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Straight to `goal` (x, y, z) [m], hovering, turning to it on the way."""
        distance = float(np.linalg.norm(goal - xv[R]))
        speed = min(self.cruise, np.sqrt(self.max_accel * distance))
        v = free_body.straight_to(xv[R], goal, speed, self.arrive, dt)
        if v is None:
            return None
        turn = free_body.turn_to(xv[POSE], goal, self.turn_rate, self.arrive, dt)
        return self._pushed(xv, v - xv[V], turn, dt)

    def _pushed(self, xv: Vec, dv: Vec, turn: Vec, dt: float) -> Vec:
        """What is felt, biases and all, while the velocity goes to v + dv in TAU or as fast as it
        may, and the body turns by a rotation vector [rad] within dt."""
        rate = self.max_accel / max(float(np.linalg.norm(dv)), 1e-12)
        accel = dv * min(rate, 1.0 / max(TAU, dt))
        half = free_body.turned(xv[Q_WR], turn / 2).q
        force = quaternion.rotate_back(half, accel - np.array(self.gravity))
        return np.concatenate([force.v + xv[BA], turn / dt + xv[BG]])
