"""A planar robot with forward speed and turn rate."""

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
class PlanarUnicycle(MotionModel):
    """Exact motion along a circular arc.

    With a = w dt, S = sin(a)/a, C = (1 - cos(a))/a:
    z' = z + v dt (S cos(phi) - C sin(phi));  x' = x + v dt (S sin(phi) + C cos(phi));
    phi' = phi + a

    xv = (z, x, phi) [m, m, rad], phi from z towards x; u = (v, w) [m/s, rad/s].
    U = diag(sd_v^2, sd_w^2) for every control sample, however long it is held; Q = 0.

    Source: Thrun, Burgard, Fox, *Probabilistic Robotics*, section 5.3; noise per sample as usual
    for the MRCLAM logs (Leung et al., IJRR 2011).
    """

    name = "planar unicycle"
    space = TWO_D
    state_labels = ("z", "x", "phi")
    state_units = ("m", "m", "rad")
    control_labels = ("v", "w")
    control_units = ("m/s", "rad/s")

    sd_v: float = param(0.1, unit="m/s", lo=0.0, hi=10.0, soft=(0.0, 0.5), label="Speed noise")
    """Standard deviation of the speed in one control sample, independent of the other samples."""
    sd_w: float = param(0.5, unit="rad/s", lo=0.0, hi=20.0, soft=(0.0, 2.0), label="Turn noise")
    """Standard deviation of the turn rate in one control sample."""
    unknown_sd_v: float = param(0.5, unit="m/s", lo=0.0, hi=10.0, soft=(0.0, 2.0))
    """Standard deviation of the speed while nobody sends a command."""
    unknown_sd_w: float = param(1.0, unit="rad/s", lo=0.0, hi=20.0, soft=(0.0, 3.0))
    """Standard deviation of the turn rate while nobody sends a command."""
    cruise: float = param(0.3, unit="m/s", lo=0.01, hi=10.0, soft=(0.05, 1.0), label="Cruise")
    """Speed on the way to a waypoint."""
    turn_rate: float = param(0.6, unit="rad/s", lo=0.01, hi=10.0, soft=(0.1, 2.0))
    """It turns at most this fast towards a waypoint."""
    arrive: float = param(0.2, unit="m", lo=0.0, hi=5.0, soft=(0.02, 1.0), label="Arrival")
    """A waypoint counts as reached within this distance."""

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        arc = planar.arc(xv[2], u[0] * dt, u[1] * dt)
        fv = np.append(xv[:2] + arc.step, wrap(xv[2] + u[1] * dt))
        dfv_by_dxv = np.eye(3)
        dfv_by_dxv[:2, 2] = arc.by_phi
        dfv_by_du = np.zeros((3, 2))
        dfv_by_du[:2, 0], dfv_by_du[:2, 1] = dt * arc.by_way, dt * arc.by_turn
        dfv_by_du[2, 1] = dt
        return Transition(fv, dfv_by_dxv, dfv_by_du, np.zeros((3, 0)))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        return np.zeros((3, 3))

    def U(self, u: Vec, dt: float) -> Mat:
        return np.diag([self.sd_v**2, self.sd_w**2])

    def U_unknown(self, dt: float) -> Mat:
        return np.diag([self.unknown_sd_v**2, self.unknown_sd_w**2])

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
        w = planar.limited(ahead.bearing, self.turn_rate, dt) / dt
        return np.array([planar.cruising(ahead, 0.0, self.cruise, dt), w])
