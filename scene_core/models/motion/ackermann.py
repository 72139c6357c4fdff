"""A car: it rolls where its front wheels point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import TWO_D, wrap
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

DETOUR = 1.2
"""A waypoint nearer to the centre of the tightest turn than this many of its radii can not be
turned to: the car drives straight on until it lies outside."""


@dataclass(frozen=True)
class PlanarAckermann(MotionModel):
    """Speed and steering angle in the state, driven by acceleration and steering rate.

    With vm = v + a dt/2, dm = delta + delta_rate dt/2 (the middle of the step):
    way = Fv vm dt;  turn = way tan(Fs dm) / wheelbase;  (z, x, phi) along the arc (way, turn);
    v' = v + a dt;  delta' = delta + delta_rate dt

    xv = (z, x, phi, v, delta) [m, m, rad, m/s, rad]: the middle of the rear axle, phi from z
    towards x, and speed and steering angle as the car's own sensors would give them;
    u = (a, delta_rate) [m/s^2, rad/s]; k = (Fv, Fs), the speed scale and the steering scale: true
    over shown. Exact for a constant acceleration and a fixed wheel; a moving wheel is of the second
    order in dt. U = diag(sd_accel^2, sd_steer_rate^2) for every control sample, however long it is
    held; Q = diag(0, 0, sd_slip^2 |way|, 0, 0).

    Source: Scheding, Nebot, Durrant-Whyte, *High-integrity navigation*, IEEE TCST 1999, kinematic
    model; calibration in the state as in Davison, *Models and State Representation in Scene*,
    section 3.
    """

    name = "planar ackermann"
    space = TWO_D
    state_labels = ("z", "x", "phi", "v", "delta")
    state_units = ("m", "m", "rad", "m/s", "rad")
    control_labels = ("a", "delta_rate")
    control_units = ("m/s²", "rad/s")
    calib_labels = ("speed scale", "steering scale")
    calib_units = ("", "")

    wheelbase: float = param(2.5, unit="m", lo=0.01, hi=50.0, soft=(0.2, 5.0), label="Wheelbase")
    """Distance of the axles."""
    speed_scale: float = param(1.0, lo=0.1, hi=10.0, soft=(0.5, 1.5), label="Speed scale")
    """True speed over shown speed, where it is not estimated."""
    steering_scale: float = param(1.0, lo=0.1, hi=10.0, soft=(0.5, 1.5), label="Steering scale")
    """True steering angle over shown steering angle, where it is not estimated."""
    sd_accel: float = param(
        0.5, unit="m/s²", lo=0.0, hi=100.0, soft=(0.0, 5.0), label="Acceleration noise"
    )
    """Standard deviation of the acceleration in one control sample, independent of the others."""
    sd_steer_rate: float = param(
        0.1, unit="rad/s", lo=0.0, hi=10.0, soft=(0.0, 1.0), label="Steering noise"
    )
    """Standard deviation of the steering rate in one control sample."""
    sd_slip: float = param(
        0.01, unit="rad", lo=0.0, hi=1.0, soft=(0.0, 0.1), label="Slip over a metre"
    )
    """Standard deviation of the heading's error after one metre; it grows with the square root of
    the way."""
    unknown_sd_accel: float = param(2.0, unit="m/s²", lo=0.0, hi=100.0, soft=(0.0, 10.0))
    """Standard deviation of the acceleration while nobody sends a command."""
    unknown_sd_steer_rate: float = param(0.5, unit="rad/s", lo=0.0, hi=10.0, soft=(0.0, 2.0))
    """Standard deviation of the steering rate while nobody sends a command."""
    rest_sd_v: float = param(
        1.0, unit="m/s", lo=0.0, hi=100.0, soft=(0.0, 10.0), effect="on reset", label="Start speed"
    )
    """Standard deviation of the speed when the robot is taken over from a model that has none."""
    rest_sd_delta: float = param(
        0.2, unit="rad", lo=0.0, hi=1.5, soft=(0.0, 0.6), effect="on reset", label="Start steering"
    )
    """The same for the steering angle."""
    cruise: float = param(2.0, unit="m/s", lo=0.01, hi=50.0, soft=(0.1, 10.0), label="Cruise")
    """Speed on the way to a waypoint."""
    max_accel: float = param(1.0, unit="m/s²", lo=0.01, hi=50.0, soft=(0.1, 5.0))
    """It accelerates and brakes at most this hard on the way to a waypoint."""
    max_steer: float = param(0.6, unit="rad", lo=0.01, hi=1.5, soft=(0.1, 1.0))
    """The front wheels turn at most this far on the way to a waypoint."""
    max_steer_rate: float = param(0.8, unit="rad/s", lo=0.01, hi=10.0, soft=(0.1, 2.0))
    """And at most this fast."""
    arrive: float = param(0.5, unit="m", lo=0.0, hi=20.0, soft=(0.05, 2.0), label="Arrival")
    """A waypoint counts as reached within this distance."""

    @property
    def calib0(self) -> Vec:
        return np.array([self.speed_scale, self.steering_scale])

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        vm, dm = xv[3] + 0.5 * u[0] * dt, xv[4] + 0.5 * u[1] * dt
        tan = np.tan(k[1] * dm)
        bend, dbend = tan / self.wheelbase, (1.0 + tan * tan) / self.wheelbase
        way = k[0] * vm * dt
        arc = planar.arc(xv[2], way, way * bend)
        fv = xv.copy()
        fv[:2] += arc.step
        fv[2] = wrap(xv[2] + way * bend)
        fv[3:] += u * dt
        # (dz, dx, turn) by the way and by the true steering angle
        by_way = np.append(arc.by_way + arc.by_turn * bend, bend)
        by_angle = np.append(arc.by_turn, 1.0) * (way * dbend)
        by_v, by_delta = by_way * (k[0] * dt), by_angle * k[1]
        dfv_by_dxv = np.eye(5)
        dfv_by_dxv[:2, 2] = arc.by_phi
        dfv_by_dxv[:3, 3], dfv_by_dxv[:3, 4] = by_v, by_delta
        dfv_by_du = np.zeros((5, 2))
        dfv_by_du[:3, 0], dfv_by_du[:3, 1] = 0.5 * dt * by_v, 0.5 * dt * by_delta
        dfv_by_du[3, 0] = dfv_by_du[4, 1] = dt
        dfv_by_dk = np.zeros((5, 2))
        dfv_by_dk[:3, 0], dfv_by_dk[:3, 1] = by_way * (vm * dt), by_angle * dm
        return Transition(fv, dfv_by_dxv, dfv_by_du, dfv_by_dk)

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        way = k[0] * (xv[3] + 0.5 * u[0] * dt) * dt
        return np.diag([0.0, 0.0, self.sd_slip**2 * abs(way), 0.0, 0.0])

    def U(self, u: Vec, dt: float) -> Mat:
        return np.diag([self.sd_accel**2, self.sd_steer_rate**2])

    def U_unknown(self, dt: float) -> Mat:
        return np.diag([self.unknown_sd_accel**2, self.unknown_sd_steer_rate**2])

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv[:3], np.eye(5)[:3])

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return planar.redefine(xv, xpdef, directions=[2])

    def normalise(self, xv: Vec) -> Normalised:
        return planar.normalise(xv, directions=[2])

    def lift(self, xp: Vec) -> Lifted:
        P_rest = np.diag([0.0, 0.0, 0.0, self.rest_sd_v**2, self.rest_sd_delta**2])
        return Lifted(np.append(xp, [0.0, 0.0]), np.eye(5)[:, :3], P_rest)

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)

    def stay(self, xv: Vec, dt: float) -> Vec:
        """Brakes with the wheels as they are."""
        return np.array([np.clip(-xv[3] / dt, -self.max_accel, self.max_accel), 0.0])

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Steer along the circle through `goal` (z, x) [m], where there is one (pure pursuit).

        Source: Coulter, *Implementation of the pure pursuit path tracking algorithm*, 1992.
        """
        ahead = planar.goal_from(xv[:2], xv[2], goal, self.arrive)
        if ahead is None:
            return None
        delta_rate = (self._steering_to(ahead) - xv[4]) / dt
        stop = np.sqrt(2.0 * self.max_accel * ahead.distance)
        a = (min(self.cruise, stop) / self.speed_scale - xv[3]) / dt
        limits = np.array([self.max_accel, self.max_steer_rate])
        return np.clip([a, delta_rate], -limits, limits)

    def _steering_to(self, ahead: planar.Goal) -> float:
        """The steering angle to show, on the way to a goal [rad]."""
        forward, left = ahead.distance * np.array([np.cos(ahead.bearing), np.sin(ahead.bearing)])
        tightest = self.wheelbase / np.tan(self.steering_scale * self.max_steer)
        if np.hypot(forward, abs(left) - tightest) < DETOUR * tightest and (
            forward < 0.0 or 2.0 * abs(left) * tightest > ahead.distance**2
        ):
            return 0.0
        if forward < 0.0:
            return float(np.copysign(self.max_steer, left))
        angle = np.arctan(2.0 * left * self.wheelbase / ahead.distance**2) / self.steering_scale
        return float(np.clip(angle, -self.max_steer, self.max_steer))
