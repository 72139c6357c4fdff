"""Scene's Nomad on undulating ground: at every step the ground tilts as it likes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D, wrap
from scene_core.models import free_body, planar
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
class TerrainNomad(MotionModel):
    """Turn the wheels, drive straight on in the robot's own plane, turn the turret; then the ground
    folds by an unknown angle about an unknown axis in that plane.

    r' = r + R(q) (way sin(S + dS), 0, way cos(S + dS)),  way = F v dt
    q' = q * qy(dT) * q_fold;  S' = S + dS - dT
    Q = L(q') diag(0, b, 0, b) L(q')',  b = (slope way)^2 / 8: a fold by N(0, (slope way)^2), its
    axis uniform among the horizontal ones of the robot

    xv = (x, y, z, qw, qx, qy, qz, S) [m, 1, rad]: the pose is that of the turret (z forward, x
    left, y up from the plane it stands on), S the direction of travel in it, from z towards x;
    u = (v, dS, dT) [m/s, rad, rad] with the angles turned in the interval dt; k = (F), the speed
    scale. U = diag((sd_v v)^2, (sd_steer dS)^2, (sd_turret dT)^2).

    Source: Davison, Scene library, Nomad robot (ThreeD); its FV is k here, and its noise of the
    fold is taken at the new orientation.
    """

    name = "nomad on terrain"
    space = THREE_D
    state_labels = (*THREE_D.labels, "S")
    state_units = (*THREE_D.units, "rad")
    control_labels = ("v", "dS", "dT")
    control_units = ("m/s", "rad", "rad")
    calib_labels = ("speed scale",)
    calib_units = ("",)

    speed_scale: float = param(1.0, lo=0.1, hi=10.0, soft=(0.5, 1.5), label="Speed scale")
    """True speed over commanded speed, where it is not estimated."""
    slope: float = param(0.5, unit="rad/m", lo=0.0, hi=10.0, soft=(0.0, 2.0), label="Slope noise")
    """Standard deviation of the angle by which the ground folds in a step, for every metre driven
    in it."""
    sd_v: float = param(0.14, lo=0.0, hi=2.0, soft=(0.0, 0.5), label="Speed noise")
    """Standard deviation of the speed, as a fraction of the speed."""
    sd_steer: float = param(0.02, lo=0.0, hi=2.0, soft=(0.0, 0.2), label="Steering noise")
    """Standard deviation of a turn of the wheels, as a fraction of the turn."""
    sd_turret: float = param(0.02, lo=0.0, hi=2.0, soft=(0.0, 0.2), label="Turret noise")
    """Standard deviation of a turn of the turret, as a fraction of the turn."""
    unknown_sd_v: float = param(0.5, unit="m/s", lo=0.0, hi=10.0, soft=(0.0, 2.0))
    """Standard deviation of the speed while nobody sends a command."""
    unknown_sd_turn: float = param(0.1, unit="rad", lo=0.0, hi=3.2, soft=(0.0, 0.5))
    """Standard deviation of both turns while nobody sends a command."""
    rest_sd_steer: float = param(0.3, unit="rad", lo=0.0, hi=3.2, effect="on reset")
    """Standard deviation of the wheels' direction when the robot is taken over from another
    model, which knows its heading only."""
    cruise: float = param(0.3, unit="m/s", lo=0.01, hi=10.0, soft=(0.05, 1.0), label="Cruise")
    """Speed on the way to a waypoint."""
    turn_rate: float = param(0.6, unit="rad/s", lo=0.01, hi=10.0, soft=(0.1, 2.0))
    """The wheels turn at most this fast towards a waypoint."""
    arrive: float = param(0.2, unit="m", lo=0.0, hi=5.0, soft=(0.02, 1.0), label="Arrival")
    """A waypoint counts as reached within this distance, in the plane the robot stands on."""
    up: str = param("y", choices=("y", "z"), label="Waypoints' up")
    """The axis of the world along which a waypoint is brought into the plane the robot stands on;
    nothing else depends on it."""

    @property
    def calib0(self) -> Vec:
        return np.array([self.speed_scale])

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        c, s = np.cos(xv[7] + u[1]), np.sin(xv[7] + u[1])
        along, across = np.array([s, 0.0, c]), np.array([c, 0.0, -s])
        way = k[0] * u[0] * dt
        step = quaternion.rotate(xv[3:7], way * along)
        turn = free_body.turned(xv[3:7], np.array([0.0, u[2], 0.0]))
        by_way, by_S = step.by_v @ along, step.by_v @ across * way
        fv = np.concatenate([xv[:3] + step.v, turn.q, [wrap(xv[7] + u[1] - u[2])]])
        dfv_by_dxv = np.eye(8)
        dfv_by_dxv[:3, 3:7], dfv_by_dxv[:3, 7] = step.by_q, by_S
        dfv_by_dxv[3:7, 3:7] = turn.by_q
        dfv_by_du = np.zeros((8, 3))
        dfv_by_du[:3, 0], dfv_by_du[:3, 1] = by_way * (k[0] * dt), by_S
        dfv_by_du[3:7, 2] = turn.by_theta[:, 1]
        dfv_by_du[7, 1:] = 1.0, -1.0
        dfv_by_dk = np.zeros((8, 1))
        dfv_by_dk[:3, 0] = by_way * (u[0] * dt)
        return Transition(fv, dfv_by_dxv, dfv_by_du, dfv_by_dk)

    def _sd_fold(self, u: Vec, dt: float, k: Vec) -> float:
        return self.slope * abs(k[0] * u[0] * dt)

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        turn = free_body.turned(xv[3:7], np.array([0.0, u[2], 0.0]))
        about = quaternion.left_matrix(turn.q)[:, [1, 3]]
        Q = np.zeros((8, 8))
        Q[3:7, 3:7] = self._sd_fold(u, dt, k) ** 2 / 8.0 * (about @ about.T)
        return Q

    def U(self, u: Vec, dt: float) -> Mat:
        return np.diag((np.array([self.sd_v, self.sd_steer, self.sd_turret]) * u) ** 2)

    def U_unknown(self, dt: float) -> Mat:
        sd = np.array([self.unknown_sd_v, self.unknown_sd_turn, self.unknown_sd_turn])
        return np.diag(sd**2)

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv[:7], np.eye(8)[:7])

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return free_body.redefine(xv, xpdef)

    def normalise(self, xv: Vec) -> Normalised:
        out, J = free_body.normalise(xv)
        out[7] = wrap(out[7])
        return Normalised(out, J)

    def lift(self, xp: Vec) -> Lifted:
        return free_body.at_rest(xp, [self.rest_sd_steer])

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        moved = self.f(xv, u + gaussian(self.U(u, dt), rng), dt, k).fv
        angle, axis = self._sd_fold(u, dt, k) * rng.standard_normal(), rng.uniform(0.0, 2.0 * np.pi)
        fold = angle * np.array([np.sin(axis), 0.0, np.cos(axis)])
        moved[3:7] = free_body.turned(moved[3:7], fold).q
        return self.normalise(moved).value

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Steer to where the vertical through `goal` (x, y, z) [m] meets the robot's plane, slowly
        while it is not ahead; the turret follows."""
        vertical = np.eye(3)["xyz".index(self.up)]
        R = quaternion.matrix(xv[3:7])
        normal, gap = R[:, 1], goal - xv[:3]
        # On a wall the vertical never meets the plane: it is taken to be at least that steep.
        rise = np.copysign(max(abs(normal @ vertical), 0.1), normal @ vertical)
        aim = R.T @ (gap - normal @ gap / rise * vertical)
        ahead = planar.goal_from(np.zeros(2), xv[7], aim[[2, 0]], self.arrive)
        if ahead is None:
            return None
        dS = planar.limited(ahead.bearing, self.turn_rate, dt)
        dT = planar.limited(float(wrap(xv[7] + dS)), 2.0 * self.turn_rate, dt)
        return np.array([planar.cruising(ahead, dS, self.cruise, dt), dS, dT])
