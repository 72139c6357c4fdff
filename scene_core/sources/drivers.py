"""Who drives a simulated robot: nominal controls from its true state and the frame's number.

A driver is a value. What it has to remember from frame to frame (the waypoint it is heading for)
travels with the simulation's state, so a frame can be repeated and stepped back.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.ports import SourceError
from scene_core.models.base import MotionModel
from scene_core.params import param


class Drive(NamedTuple):
    """What the driver does over the coming interval."""

    u: Vec
    """Nominal controls (nu,), in the order of the motion model's control_labels."""
    memory: Any
    """What the driver wants to know in the next frame."""
    push: Vec | None = None
    """Added to the true state (n,) before the motion model moves it: the disturbance a driver
    chooses itself. None: the motion model draws its own noise."""


class Driver(ABC):
    """Nominal controls of a true robot."""

    name: ClassVar[str]
    """The word the settings file uses."""

    def memory0(self) -> Any:
        """What the driver knows before the first frame."""
        return None

    def unfit(self, motion: MotionModel) -> str:
        """Why it can not drive a motion model, as a clause; nothing when it can, as it does unless
        overridden."""
        return ""

    def check(self, motion: MotionModel) -> None:
        """Raises SourceError when a setting has no meaning for a motion model that it can drive;
        none, unless overridden."""
        return None

    def upright(self, up: str) -> Driver:
        """The driver for a simulation in which the axis `up` points up: as it is, unless
        overridden."""
        return self

    def start(self, motion: MotionModel, dt: float) -> Mapping[str, float]:
        """State components by label the driver wants the robot to start with; none unless
        overridden. The robot's own start is applied on top."""
        return {}

    def goal(self, memory: Any) -> Vec | None:
        """The position it is heading for, as it remembers; None, unless overridden."""
        return None

    @abstractmethod
    def drive(
        self, motion: MotionModel, xv: Vec, memory: Any, index: int, dt: float, seed: int
    ) -> Drive:
        """What happens in the dt seconds before frame `index` to a robot that is truly at xv.
        Pure: equal arguments give an equal answer."""


@dataclass(frozen=True)
class ConstantControls(Driver):
    """The same controls in every frame: with dx = .08 m and az = .9 deg, the toolbox's circle."""

    name: ClassVar[str] = "constant"
    controls: Mapping[str, float] = field(default_factory=dict)
    """By control label, in the motion model's units; a missing one is zero. Where a robot does not
    stay in its place with zeros, as in the air, at least one has to be given."""

    def unfit(self, motion: MotionModel) -> str:
        unknown = [label for label in self.controls if label not in motion.control_labels]
        if unknown:
            return f"it sets {', '.join(unknown)}, and {_controls_of(motion)}"
        held = motion.stay(motion.lift(motion.space.identity()).xv, 1.0)
        if self.controls or not held.any():
            return ""
        rows = zip(motion.control_labels, held, motion.control_units, strict=True)
        needed = ", ".join(f"{label} = {v:.4g} {unit}" for label, v, unit in rows if v)
        return f"it sets no control, and a robot that stays where it is needs {needed}"

    def drive(
        self, motion: MotionModel, xv: Vec, memory: Any, index: int, dt: float, seed: int
    ) -> Drive:
        return Drive(controls_of(motion, self.controls), memory)


@dataclass(frozen=True)
class Waypoints(Driver):
    """Drives from waypoint to waypoint for ever, as the motion model itself knows how to."""

    name: ClassVar[str] = "waypoints"
    points: tuple[tuple[float, ...], ...] = param(
        (), unit="m", lo=-1e5, hi=1e5, rows=True, label="Waypoints"
    )
    """Positions in the robot's space, (z), (z, x) or (x, y, z); after the last one comes the first.
    No waypoints: it stays where it is."""

    def memory0(self) -> Any:
        return 0

    def unfit(self, motion: MotionModel) -> str:
        if motion.navigates:
            return ""
        return (
            "it does not know how to steer to a goal"
            if motion.control_labels
            else "it has no controls to steer by"
        )

    def check(self, motion: MotionModel) -> None:
        d = motion.space.d
        for i, point in enumerate(self.points, 1):
            if len(point) != d:
                raise SourceError(
                    f"waypoint {i} is {list(point)}: a robot in {motion.space.name} needs "
                    f"{d} number{'s' * (d > 1)}, ({', '.join(motion.space.labels[:d])}) in m"
                )

    def goal(self, memory: Any) -> Vec | None:
        if not self.points:
            return None
        return np.array(self.points[self._next(memory) % len(self.points)], dtype=float)

    def drive(
        self, motion: MotionModel, xv: Vec, memory: Any, index: int, dt: float, seed: int
    ) -> Drive:
        self.check(motion)
        goal = self._next(memory)
        for ahead in range(len(self.points)):
            at = (goal + ahead) % len(self.points)
            u = motion.navigate(xv, np.array(self.points[at], dtype=float), dt)
            if u is not None:
                return Drive(u, at)
        return Drive(motion.stay(xv, dt), goal)

    @staticmethod
    def _next(memory: Any) -> int:
        """Another driver may have been at the wheel."""
        return memory if isinstance(memory, int) else 0


@dataclass(frozen=True)
class Shuttle(Driver):
    """Back and forth between two places on a line, at constant speed."""

    name: ClassVar[str] = "shuttle"
    low: float = param(-2.5, unit="m", lo=-1e4, hi=1e4, soft=(-10.0, 0.0))
    """Turns round here."""
    high: float = param(2.5, unit="m", lo=-1e4, hi=1e4, soft=(0.0, 10.0))
    """And here."""
    speed: float = param(0.5, unit="m/s", lo=0.0, hi=100.0, soft=(0.0, 2.0))
    """Nominal speed."""

    def unfit(self, motion: MotionModel) -> str:
        if "v" not in motion.control_labels:
            return f"it sets the speed v, and {_controls_of(motion)}"
        if motion.space.d > 1:
            return f"it goes to and fro on a line, and this is a robot in {motion.space.name}"
        return ""

    def memory0(self) -> Any:
        return 1.0

    def drive(
        self, motion: MotionModel, xv: Vec, memory: Any, index: int, dt: float, seed: int
    ) -> Drive:
        z = motion.space.position(motion.xp(xv).xp)[0]
        going = memory if memory in (-1.0, 1.0) else 1.0
        direction = -1.0 if z >= self.high else 1.0 if z <= self.low else going
        return Drive(controls_of(motion, {"v": direction * self.speed}), direction)


def controls_of(motion: MotionModel, by_label: Mapping[str, float]) -> Vec:
    """Controls u (nu,) of a motion model from values by label; missing ones are zero."""
    return np.array([float(by_label.get(s, 0.0)) for s in motion.control_labels])


def _controls_of(motion: MotionModel) -> str:
    if not motion.control_labels:
        return "there are no controls"
    return f"the controls are {', '.join(motion.control_labels)}"
