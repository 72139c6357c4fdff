"""A planar robot that reports how far it turned, drove and turned again."""

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
class PlanarOdometry(MotionModel):
    """Turn by rot1, drive straight on by trans, turn by rot2.

    z' = z + trans cos(phi + rot1);  x' = x + trans sin(phi + rot1);  phi' = phi + rot1 + rot2

    xv = (z, x, phi) [m, m, rad], phi from z towards x; u = (rot1, trans, rot2) [rad, m, rad] per
    step: dt is not used by f; a robot that drives backwards has trans < 0. Q = 0 and U = diag:
    var(rot) = (rot_per_rad rot)^2 + (rot_per_metre trans)^2, for both;
    var(trans) = (trans_per_metre trans)^2 + trans_per_rad^2 (rot1^2 + rot2^2).

    Source: Thrun, Burgard, Fox, *Probabilistic Robotics*, section 5.4; its alpha 1 to 4 are the
    squares of the four fractions in the order rot_per_rad, rot_per_metre, trans_per_metre,
    trans_per_rad.
    """

    name = "planar odometry"
    space = TWO_D
    state_labels = ("z", "x", "phi")
    state_units = ("m", "m", "rad")
    control_labels = ("rot1", "trans", "rot2")
    control_units = ("rad", "m", "rad")

    rot_per_rad: float = param(0.1, lo=0.0, hi=2.0, soft=(0.0, 0.5), label="Turn noise per turn")
    """Standard deviation of a turn, as a fraction of the turn."""
    rot_per_metre: float = param(
        0.05, unit="rad/m", lo=0.0, hi=10.0, soft=(0.0, 0.5), label="Turn noise per way"
    )
    """Standard deviation of both turns, for every metre driven between them."""
    trans_per_metre: float = param(0.1, lo=0.0, hi=2.0, soft=(0.0, 0.5), label="Way noise per way")
    """Standard deviation of the way driven, as a fraction of the way."""
    trans_per_rad: float = param(
        0.02, unit="m/rad", lo=0.0, hi=10.0, soft=(0.0, 0.2), label="Way noise per turn"
    )
    """Standard deviation of the way driven, for every radian turned before and after."""
    unknown_sd_rot: float = param(0.1, unit="rad", lo=0.0, hi=3.2, soft=(0.0, 0.5))
    """Standard deviation of both turns, per step, while nobody sends odometry."""
    unknown_sd_trans: float = param(0.1, unit="m", lo=0.0, hi=10.0, soft=(0.0, 0.5))
    """Standard deviation of the way driven, per step, while nobody sends odometry."""
    cruise: float = param(0.3, unit="m/s", lo=0.01, hi=10.0, soft=(0.05, 1.0), label="Cruise")
    """Speed on the way to a waypoint."""
    turn_rate: float = param(0.6, unit="rad/s", lo=0.01, hi=10.0, soft=(0.1, 2.0))
    """It turns at most this fast towards a waypoint."""
    arrive: float = param(0.2, unit="m", lo=0.0, hi=5.0, soft=(0.02, 1.0), label="Arrival")
    """A waypoint counts as reached within this distance."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        c, s = np.cos(xv[2] + u[0]), np.sin(xv[2] + u[0])
        dz, dx = u[1] * c, u[1] * s
        fv = np.array([xv[0] + dz, xv[1] + dx, wrap(xv[2] + u[0] + u[2])])
        # fmt: off
        dfv_by_dxv = np.array([[1.0, 0.0, -dx],
                               [0.0, 1.0,  dz],
                               [0.0, 0.0, 1.0]])
        dfv_by_du = np.array([[-dx,   c, 0.0],
                              [ dz,   s, 0.0],
                              [1.0, 0.0, 1.0]])
        # fmt: on
        return Transition(fv, dfv_by_dxv, dfv_by_du, np.zeros((3, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        return np.zeros((3, 3))

    def U(self, u: Vec, dt: float) -> Mat:
        rot1, trans, rot2 = u
        drift = (self.rot_per_metre * trans) ** 2
        slip = self.trans_per_rad**2 * (rot1**2 + rot2**2)
        var_trans = (self.trans_per_metre * trans) ** 2 + slip
        var_rot1 = (self.rot_per_rad * rot1) ** 2 + drift
        return np.diag([var_rot1, var_trans, (self.rot_per_rad * rot2) ** 2 + drift])

    def U_unknown(self, dt: float) -> Mat:
        return np.diag([self.unknown_sd_rot, self.unknown_sd_trans, self.unknown_sd_rot]) ** 2

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        return PositionState(xv, np.eye(3))

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        return planar.redefine(xv, xpdef, directions=[2])

    def normalise(self, xv: Vec) -> Normalised:
        return planar.normalise(xv, directions=[2])

    def lift(self, xp: Vec) -> Lifted:
        return Lifted(xp, np.eye(3), np.zeros((3, 3)))

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Turn to `goal` (z, x) [m] and drive, slowly while it is not ahead."""
        ahead = planar.goal_from(xv[:2], xv[2], goal, self.arrive)
        if ahead is None:
            return None
        rot1 = planar.limited(ahead.bearing, self.turn_rate, dt)
        return np.array([rot1, planar.cruising(ahead, rot1, self.cruise, dt) * dt, 0.0])
