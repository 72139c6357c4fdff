"""A robot with two driven wheels that slip: the Jacobians are left to numbers."""

from dataclasses import dataclass

import numpy as np

from scene_core.geometry.spaces import TWO_D, relative
from scene_core.models.base import Lifted, MotionModel, PositionState, Redefined, Transition
from scene_core.models.sampling import noisy_process
from scene_core.params import param


@dataclass(frozen=True)
class DifferentialDrive(MotionModel):
    name, space = "differential drive", TWO_D
    state_labels, state_units = ("z", "x", "phi"), ("m", "m", "rad")
    control_labels, control_units = ("v", "w"), ("m/s", "rad/s")
    slip: float = param(0.05, unit="m/√s", lo=0.0, hi=5.0, soft=(0.0, 0.3), label="Wheel slip")
    """How far each wheel strays in a second, standard deviation."""
    base: float = param(0.4, unit="m", lo=0.05, hi=5.0, soft=(0.1, 1.0), label="Wheel base")
    """Distance between the two wheels."""
    f_noisy = noisy_process

    def f(self, xv, u, dt, k):
        phi = xv[2] + u[1] * dt / 2
        return Transition(xv + dt * np.array([u[0] * np.cos(phi), u[0] * np.sin(phi), u[1]]))

    def Q(self, xv, u, dt, k):
        return self.slip**2 * dt * np.diag([0.5, 0.5, 2 / self.base**2])

    def xp(self, xv, hook="base"):
        return PositionState(xv)

    def redefine(self, xv, xpdef):
        return Redefined(relative(TWO_D, xpdef, xv).x)

    def lift(self, xp):
        return Lifted(xp, np.eye(3), np.zeros((3, 3)))
