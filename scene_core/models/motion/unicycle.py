"""A planar robot with forward speed and turn rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import TWO_D, relative, wrap
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


def _arc(a: float) -> tuple[float, float, float, float]:
    """S = sin(a)/a and C = (1 - cos(a))/a with dS/da and dC/da, finite at a = 0."""
    if abs(a) < 1e-2:
        a2 = a * a
        return (
            1.0 - a2 / 6 + a2 * a2 / 120,
            a * (0.5 - a2 / 24 + a2 * a2 / 720),
            a * (-1 / 3 + a2 / 30 - a2 * a2 / 840),
            0.5 - a2 / 8 + a2 * a2 / 144,
        )
    sin, cos = np.sin(a), np.cos(a)
    S, C = sin / a, 2.0 * np.sin(0.5 * a) ** 2 / a
    return S, C, (cos - S) / a, (sin - C) / a


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
        c, s = np.cos(xv[2]), np.sin(xv[2])
        way = u[0] * dt
        S, C, dS, dC = _arc(float(u[1]) * dt)
        dz, dx = S * c - C * s, S * s + C * c
        fv = xv + np.array([way * dz, way * dx, u[1] * dt])
        fv[2] = wrap(fv[2])
        # fmt: off
        dfv_by_dxv = np.array([[1.0, 0.0, -way * dx],
                               [0.0, 1.0,  way * dz],
                               [0.0, 0.0,       1.0]])
        dfv_by_du = np.array([[dt * dz, way * dt * (dS * c - dC * s)],
                              [dt * dx, way * dt * (dS * s + dC * c)],
                              [    0.0,                           dt]])
        # fmt: on
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
        seen = relative(TWO_D, xpdef, xv)
        return Redefined(seen.x, seen.by_b, seen.by_a)

    def normalise(self, xv: Vec) -> Normalised:
        return Normalised(*TWO_D.normalise(xv))

    def lift(self, xp: Vec) -> Lifted:
        return Lifted(xp, np.eye(3), np.zeros((3, 3)))

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Turn to `goal` (z, x) [m] and drive, slowly while it is not ahead."""
        dz, dx = float(goal[0] - xv[0]), float(goal[1] - xv[1])
        distance = np.hypot(dz, dx)
        if distance <= self.arrive:
            return None
        error = wrap(np.arctan2(dx, dz) - xv[2])
        w = np.clip(error / dt, -self.turn_rate, self.turn_rate)
        return np.array([min(self.cruise, distance / dt) * max(0.0, np.cos(error)), w])
