"""Scene's planar robot: steered wheels below, a turret that turns by itself above."""

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


@dataclass(frozen=True)
class PlanarNomad(MotionModel):
    """Turn the wheels and the turret, then drive straight on.

    z' = z + F v dt cos(S + dS);  x' = x + F v dt sin(S + dS);  S' = S + dS;  T' = T + dT

    xv = (z, x, S, T) [m, m, rad, rad]: S the direction of travel, T that of the turret, both from
    z towards x; u = (v, dS, dT) [m/s, rad, rad] with the angles turned in the interval dt;
    k = (F), the speed scale: true speed over commanded speed. xp = (z, x, T).
    U = diag((sd_v v)^2, (sd_steer dS)^2, (sd_turret dT)^2), Q = 0.

    Source: Davison, Scene library, planar Nomad robot (TwoD); its Fv, in the state with variance
    zero as shipped, is k here, and is a part of the state when it is estimated.
    """

    name = "planar nomad"
    space = TWO_D
    state_labels = ("z", "x", "S", "T")
    state_units = ("m", "m", "rad", "rad")
    control_labels = ("v", "dS", "dT")
    control_units = ("m/s", "rad", "rad")
    calib_labels = ("speed scale",)
    calib_units = ("",)

    speed_scale: float = param(1.0, lo=0.1, hi=10.0, soft=(0.5, 1.5), label="Speed scale")
    """True speed over commanded speed, where it is not estimated."""
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
    """A waypoint counts as reached within this distance."""

    @property
    def calib0(self) -> Vec:
        return np.array([self.speed_scale])

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        c, s = np.cos(xv[2] + u[1]), np.sin(xv[2] + u[1])
        way = k[0] * u[0] * dt
        fv = xv + np.array([way * c, way * s, u[1], u[2]])
        fv[2:] = wrap(fv[2:])
        # fmt: off
        dfv_by_dxv = np.array([[1.0, 0.0, -way * s, 0.0],
                               [0.0, 1.0,  way * c, 0.0],
                               [0.0, 0.0,      1.0, 0.0],
                               [0.0, 0.0,      0.0, 1.0]])
        dfv_by_du = np.array([[k[0] * dt * c, -way * s, 0.0],
                              [k[0] * dt * s,  way * c, 0.0],
                              [          0.0,      1.0, 0.0],
                              [          0.0,      0.0, 1.0]])
        # fmt: on
        dfv_by_dk = np.array([[u[0] * dt * c], [u[0] * dt * s], [0.0], [0.0]])
        return Transition(fv, dfv_by_dxv, dfv_by_du, dfv_by_dk)

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        return np.zeros((4, 4))

    def U(self, u: Vec, dt: float) -> Mat:
        return np.diag((np.array([self.sd_v, self.sd_steer, self.sd_turret]) * u) ** 2)

    def U_unknown(self, dt: float) -> Mat:
        sd = np.array([self.unknown_sd_v, self.unknown_sd_turn, self.unknown_sd_turn])
        return np.diag(sd**2)

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv[[0, 1, 3]], np.eye(4)[[0, 1, 3]])

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return planar.redefine(xv, xpdef, directions=[2, 3])

    def normalise(self, xv: Vec) -> Normalised:
        return planar.normalise(xv, directions=[2, 3])

    def lift(self, xp: Vec) -> Lifted:
        # fmt: off
        dxv_by_dxp = np.array([[1.0, 0.0, 0.0],
                               [0.0, 1.0, 0.0],
                               [0.0, 0.0, 1.0],
                               [0.0, 0.0, 1.0]])
        # fmt: on
        return Lifted(xp[[0, 1, 2, 2]], dxv_by_dxp, np.diag([0.0, 0.0, self.rest_sd_steer**2, 0.0]))

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Steer to `goal` (z, x) [m], slowly while it is not ahead; the turret follows."""
        ahead = planar.goal_from(xv[:2], xv[2], goal, self.arrive)
        if ahead is None:
            return None
        dS = planar.limited(ahead.bearing, self.turn_rate, dt)
        dT = planar.limited(float(wrap(xv[2] + dS - xv[3])), 2.0 * self.turn_rate, dt)
        return np.array([planar.cruising(ahead, dS, self.cruise, dt), dS, dT])
