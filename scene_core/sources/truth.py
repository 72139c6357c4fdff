"""The parts of a simulated experiment: how robots really move and sensors really measure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from scene_core.arrays import Vec
from scene_core.models.base import InternalMeasurementModel, MotionModel, Sensor
from scene_core.params import param
from scene_core.sources.drivers import Driver


@dataclass(frozen=True)
class TrueRobot:
    """How a robot really moves."""

    motion: MotionModel
    driver: Driver
    start: Mapping[str, float] = field(default_factory=dict)
    """State at frame 0 by label; a missing label is the driver's choice, else 0 (qw: 1)."""
    start_sd: Mapping[str, float] = field(default_factory=dict)
    """The true start is drawn around `start` with these standard deviations by state label;
    orientation in 3-D as rx, ry, rz. Missing: exactly there."""
    calib: Mapping[str, float] = field(default_factory=dict)
    """True calibration by label where it is not the motion model's nominal one."""
    noise_on: str = param("motion", choices=("motion", "controls"), label="Noise on")
    """motion: the robot strays from the commanded motion. controls: it moves exactly as commanded
    and the estimator receives the commands with noise (the toolbox)."""


@dataclass(frozen=True)
class TrueMount:
    """Where a sensor really is, and how it really measures."""

    sensor: Sensor
    robot: str
    pose: tuple[float, ...]
    """x_RS in the sensor's space."""
    hook: str = "base"
    calib: Mapping[str, float] = field(default_factory=dict)
    """True calibration by label where it is not the sensor's nominal one."""
    every: int = param(1, lo=1, hi=1000, soft=(1, 10), label="Every n frames")
    """The sensor fires in every n-th frame."""
    margin: float = param(0.0, lo=0.0, hi=1e4, soft=(0.0, 100.0), label="Margin")
    """New landmarks are offered only this far inside the sensor's limits, in its own units."""


@dataclass(frozen=True)
class TrueInstrument:
    """An internal measurement as it is really made."""

    robot: str
    model: InternalMeasurementModel


@dataclass(frozen=True)
class Disturbances:
    """What goes wrong with measurements of identified points."""

    misses: float = param(0.0, lo=0.0, hi=1.0, soft=(0.0, 0.5), label="Missed")
    """Fraction of the visible landmarks that are not detected."""
    outliers: float = param(0.0, lo=0.0, hi=1.0, soft=(0.0, 0.5), label="Outliers")
    """Fraction of the measurements that carry the right identity and a wrong place."""
    outlier_sigma: float = param(30.0, lo=1.0, hi=1e4, soft=(3.0, 100.0), label="Outlier size")
    """Distance of an outlier from the truth in standard deviations of the sensor's noise, half to
    one and a half times this, in any direction."""


@dataclass(frozen=True)
class SimulationState:
    """The true state after a frame."""

    xv: Mapping[str, Vec]
    memory: Mapping[str, Any]
    """What each robot's driver remembers."""
    before: Mapping[str, Vec]
    """True states one frame earlier: how far the sensors move during an exposure."""
