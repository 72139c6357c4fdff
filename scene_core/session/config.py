"""One description of an experiment, complete enough to repeat it bit for bit.

What `userData.m` was in the toolbox: robots, mounts, instruments, landmarks, policies, the source
of the measurements and the seed, as a tree of frozen dataclasses.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from scene_core.filter.policies import Policies
from scene_core.filter.ports import Source
from scene_core.models.base import InternalMeasurementModel, MotionModel, Sensor
from scene_core.params import entries, param


@dataclass(frozen=True)
class RobotSettings:
    """What the estimator believes of a robot at the start."""

    motion: MotionModel
    start: Mapping[str, float] = field(default_factory=dict)
    """Initial mean by state label; a missing label is 0 (qw: 1)."""
    start_sd: Mapping[str, float] = field(default_factory=dict)
    """Initial standard deviation by state label; orientation in 3-D as rx, ry, rz (rotation vector
    in the robot's frame, rad). Missing: known exactly."""
    calib_sd: Mapping[str, float] = entries(lo=0.0)
    """Calibration labels to estimate, with their initial standard deviation."""


@dataclass(frozen=True)
class MountSettings:
    """A sensor on a robot, as the estimator believes it."""

    sensor: Sensor
    robot: str
    pose: tuple[float, ...]
    """x_RS in the space of the sensor: z; z, x, phi; or x, y, z, qw, qx, qy, qz. In m and rad."""
    hook: str = "base"
    pose_sd: Mapping[str, float] = entries(lo=0.0)
    """Not empty: the pose is estimated; labels as in RobotSettings.start_sd."""
    calib_sd: Mapping[str, float] = entries(lo=0.0)
    """As in RobotSettings, of the sensor."""


@dataclass(frozen=True)
class InstrumentSettings:
    """An internal measurement of a robot."""

    robot: str
    model: InternalMeasurementModel


@dataclass(frozen=True)
class KnownFeature:
    """A landmark given at the start."""

    position: tuple[float, ...] = param(unit="m")
    """Place in the world."""
    appearance: Any = None
    """An identity, the path of an image patch, or the name of a place of the simulated world."""
    sd: float = param(0.0, unit="m", lo=0.0)
    """Standard deviation of every coordinate."""


@dataclass(frozen=True)
class MarkerSettings:
    """Something on a robot that sensors recognise which are not at the same hook: seen, it says
    where that robot is."""

    robot: str
    position: tuple[float, ...] = param(unit="m")
    """Place in the axes of the hook: z; z, x; or x, y, z."""
    identity: int = param(lo=0, hi=2**31 - 1, effect="on reset")
    """What tells it from landmarks and other markers."""
    hook: str = "base"
    """What of the robot it is fixed to."""


@dataclass(frozen=True)
class EstimatorSettings:
    """Everything the filter believes and chooses."""

    robots: Mapping[str, RobotSettings]
    mounts: Mapping[str, MountSettings]
    policies: Policies
    instruments: Mapping[str, InstrumentSettings] = field(default_factory=dict)
    known: tuple[KnownFeature, ...] = ()
    markers: Mapping[str, MarkerSettings] = field(default_factory=dict)
    up: Literal["y", "z"] = "z"
    """Which axis of the world points up."""


@dataclass(frozen=True)
class Experiment:
    """An estimator, a source of measurements, and a seed."""

    name: str
    about: str
    """One sentence: what to look at."""
    estimator: EstimatorSettings
    source: Source
    """A frozen dataclass: Simulation, ImageSequence, Mrclam. Its parameters are the Truth tab."""
    seed: int = param(0, lo=0, hi=2**31 - 1)
    """Every random number of a run follows from it."""
    frames: int | None = param(None, lo=1)
    """Stop here; None: when the source ends."""
    align: Literal["none", "se2", "se3", "sim3"] = "none"
    """How the estimate is brought into the axes of the reference before errors are taken: a
    recording's reference may be in axes, or at a scale, that the filter can not know."""
