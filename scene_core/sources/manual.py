"""A robot that goes where its sliders say: speeds and turn rates, edited while it drives."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry import quaternion
from scene_core.models.base import MotionModel
from scene_core.models.labels import QUATERNION, bare
from scene_core.params import param
from scene_core.sources.drivers import Drive, Driver

AXES: Mapping[str, tuple[str, str, str]] = MappingProxyType(
    {
        "x forward, y left, z up": ("x", "y", "z"),
        "z forward, x left, y up": ("z", "x", "y"),
        "z forward, x right, y down": ("z", "-x", "-y"),
    }
)
"""Which of a robot's axes point forward, to the left and up."""
VELOCITY = ("vx", "vy", "vz")
TURN = ("wx", "wy", "wz")


@dataclass(frozen=True)
class Manual(Driver):
    """Drives as its settings say now; they are part of the command log like every other edit.

    Controls are met by their labels, each by what is asked for in its own unit: v, vx, dx, trans
    by the speeds (times dt where the unit is a length), w, wx, ax [rad], dS, dphi, rot1 and rot2 by
    the turn rates; accelerations so that the speed is reached within about `response`. A control
    with an unknown label takes forward when its unit is a speed or a length, and otherwise the next
    of turn, pitch, roll, look. A model without controls is pushed towards the speeds it is asked
    for; one without velocities is moved. In a pair both robots do the same.
    """

    name: ClassVar[str] = "manual"
    forward: float = param(0.0, unit="m/s", lo=-100.0, hi=100.0, soft=(-1.0, 1.0), label="Forward")
    """Speed ahead; backwards below zero."""
    left: float = param(0.0, unit="m/s", lo=-100.0, hi=100.0, soft=(-1.0, 1.0), label="Left")
    """Speed to the left, for what can move sideways."""
    up: float = param(0.0, unit="m/s", lo=-100.0, hi=100.0, soft=(-1.0, 1.0), label="Up")
    """Speed along its own upward axis, for what can fly."""
    turn: float = param(0.0, unit="rad/s", lo=-20.0, hi=20.0, soft=(-1.0, 1.0), label="Turn left")
    """Turn rate to the left; the front wheels of a car are turned to as many radians instead."""
    pitch: float = param(0.0, unit="rad/s", lo=-20.0, hi=20.0, soft=(-1.0, 1.0), label="Nose up")
    """Turn rate that lifts its nose."""
    roll: float = param(0.0, unit="rad/s", lo=-20.0, hi=20.0, soft=(-1.0, 1.0), label="Lean right")
    """Turn rate that leans it to the right."""
    look: float = param(0.0, unit="rad/s", lo=-20.0, hi=20.0, soft=(-1.0, 1.0), label="Look left")
    """How much faster than the robot its turret turns."""
    response: float = param(0.4, unit="s", lo=0.0, hi=100.0, soft=(0.05, 2.0), label="Response")
    """Time constant with which a speed that is a part of the state is reached."""
    axes: str = param("x forward, y left, z up", choices=tuple(AXES), label="Axes")
    """What the axes of a robot in space mean."""

    def upright(self, up: str) -> Driver:
        return replace(self, axes=tuple(AXES)[1]) if up == "y" else self

    def drive(
        self, motion: MotionModel, xv: Vec, memory: Any, index: int, dt: float, seed: int
    ) -> Drive:
        if motion.control_labels:
            return Drive(self._controls(motion, xv, dt), memory)
        push = np.zeros(len(xv))
        free = motion.f(xv, np.zeros(0), dt, motion.calib0).fv
        for prefix in dict.fromkeys(_prefix(s) for s in motion.state_labels):
            self._push(_Body.of(motion, prefix), xv, free, dt, push)
        return Drive(np.zeros(0), memory, push)

    def _controls(self, motion: MotionModel, xv: Vec, dt: float) -> Vec:
        u, labels = np.zeros(len(motion.control_labels)), motion.control_labels
        # What the state becomes by itself, so that accelerations make up for gravity and bias.
        free = motion.f(xv, u, dt, motion.calib0).fv
        for prefix in dict.fromkeys(_prefix(s) for s in labels):
            asked = self._asked(motion, prefix, xv, free, dt)
            spare = iter((self.turn, self.pitch, self.roll, self.look))
            for i, unit in enumerate(motion.control_units):
                if _prefix(labels[i]) != prefix:
                    continue
                value = asked.get((bare(labels[i]), unit))
                if value is None:
                    rate = self.forward if unit.startswith("m") else next(spare, 0.0)
                    value = rate if unit.endswith("/s") else rate * dt
                u[i] = value
        return u

    def _asked(
        self, motion: MotionModel, prefix: str, xv: Vec, free: Vec, dt: float
    ) -> dict[tuple[str, str], float]:
        """Controls by label and unit."""
        ahead, turn = self.forward, self.turn
        asked = {
            ("v", "m/s"): ahead,
            ("trans", "m"): ahead * dt,
            ("w", "rad/s"): turn,
            ("rot1", "rad"): 0.5 * turn * dt,
            ("rot2", "rad"): 0.5 * turn * dt,
            ("dphi", "rad"): turn * dt,
            ("dS", "rad"): turn * dt,
            ("dT", "rad"): (turn + self.look) * dt,
        }
        body = _Body.of(motion, prefix)
        if motion.space.d == 2:
            asked |= {("dz", "m"): ahead * dt, ("dx", "m"): self.left * dt}
            asked |= self._of_a_car(motion, prefix, xv, free, dt)
        if motion.space.d == 3:
            v, w = self._twist()
            for i, axis in enumerate("xyz"):
                asked[f"v{axis}", "m/s"], asked[f"d{axis}", "m"] = v[i], v[i] * dt
                asked[f"w{axis}", "rad/s"], asked[f"a{axis}", "rad"] = w[i], w[i] * dt
            if body.v is not None:
                wanted = self._nearer(xv[body.v], body.world(xv, v), dt)
                needed = body.own(xv, wanted - free[body.v]) / dt
                asked |= {(f"a{axis}", "m/s²"): needed[i] for i, axis in enumerate("xyz")}
        return asked

    def _of_a_car(
        self, motion: MotionModel, prefix: str, xv: Vec, free: Vec, dt: float
    ) -> dict[tuple[str, str], float]:
        """Acceleration and steering rate of a robot with its speed and steering in the state."""
        labels, asked = motion.state_labels, {}
        for label, control, unit, goal in (
            ("v", "a", "m/s²", self.forward),
            ("delta", "delta_rate", "rad/s", float(np.clip(self.turn, -1.0, 1.0))),
        ):
            if prefix + label in labels:
                i = labels.index(prefix + label)
                asked[control, unit] = float(self._nearer(xv[i], goal, dt) - free[i]) / dt
        return asked

    def _push(self, body: _Body, xv: Vec, free: Vec, dt: float, push: Vec) -> None:
        """What brings the velocities of a body to what is asked for, also where they would change
        by themselves; its pose, if it has none."""
        v, w = self._twist()
        if body.v is not None:
            push[body.v] = self._nearer(xv[body.v], body.world(xv, v), dt) - free[body.v]
        elif body.r is not None:
            push[body.r] = body.world(xv, v) * dt
        if body.w is not None:
            push[body.w] = self._nearer(xv[body.w], w, dt) - free[body.w]
        elif body.q is not None:
            step = quaternion.from_rotation_vector(w * dt)[0]
            push[body.q] = quaternion.product(xv[body.q], step) - xv[body.q]

    def _nearer(self, now: Vec, goal: Vec | float, dt: float) -> Vec:
        """Where a speed is after dt on its way to what is asked for."""
        share = 1.0 if self.response == 0.0 else -math.expm1(-dt / self.response)
        return now + share * (goal - now)

    def _twist(self) -> tuple[Vec, Vec]:
        """Velocity and turn rate (3,) in the axes of a robot in space; nose up is a turn about its
        right, leaning right one about its forward axis."""
        F, L, U = (_unit(axis) for axis in AXES[self.axes])
        v = self.forward * F + self.left * L + self.up * U
        return v, self.turn * U - self.pitch * L + self.roll * F


class _Body(NamedTuple):
    """Rows of one body's components in a state; None where it has none."""

    r: list[int] | None
    q: list[int] | None
    v: list[int] | None
    """Velocity in the world."""
    w: list[int] | None
    """Turn rate in the body."""

    @classmethod
    def of(cls, motion: MotionModel, prefix: str) -> _Body:
        parts = (("x", "y", "z"), QUATERNION, VELOCITY, TURN)
        return cls(*(_rows(motion.state_labels, prefix, names) for names in parts))

    def world(self, xv: Vec, a: Vec) -> Vec:
        """A vector of the body's axes in those of the world."""
        return a if self.q is None else quaternion.rotate(xv[self.q], a).v

    def own(self, xv: Vec, a: Vec) -> Vec:
        """The other way round."""
        return a if self.q is None else quaternion.rotate_back(xv[self.q], a).v


def _rows(labels: Sequence[str], prefix: str, names: Sequence[str]) -> list[int] | None:
    wanted = [prefix + name for name in names]
    return [labels.index(s) for s in wanted] if set(wanted) <= set(labels) else None


def _prefix(label: str) -> str:
    return label[: len(label) - len(bare(label))]


def _unit(axis: str) -> Vec:
    out = np.zeros(3)
    out["xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return out
