"""The estimator's whole state as one immutable value.

`World` is what Scene calls Scene_Single and the toolbox calls Map, Rob, Sen and Lmk together.
Arrays in it are read-only, so a `World` can be handed to any thread and kept for as long as
somebody wants to look at it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.policies import Policies
from scene_core.models.base import (
    FeatureModel,
    InternalMeasurementModel,
    MotionModel,
    Particles,
    Sensor,
)

Label = int
"""Features are numbered from 1 and labels are never used again."""


@dataclass(frozen=True)
class Block:
    """A named part of the state: robot:cam, robot:cam:calib, mount:left:pose, mount:left:calib,
    feature:12."""

    name: str
    start: int
    size: int

    @property
    def slice(self) -> slice:
        return slice(self.start, self.start + self.size)

    @property
    def indices(self) -> np.ndarray:
        return np.arange(self.start, self.start + self.size)


@dataclass(frozen=True)
class Layout:
    """The ordered blocks of a state vector."""

    blocks: tuple[Block, ...]

    @staticmethod
    def of(sizes: Mapping[str, int]) -> Layout:
        """Blocks of the given sizes one after the other."""
        blocks, at = [], 0
        for name, size in sizes.items():
            blocks.append(Block(name, at, size))
            at += size
        return Layout(tuple(blocks))

    @cached_property
    def by_name(self) -> Mapping[str, Block]:
        return {b.name: b for b in self.blocks}

    @property
    def size(self) -> int:
        return self.blocks[-1].slice.stop if self.blocks else 0

    def __contains__(self, name: str) -> bool:
        return name in self.by_name

    def __getitem__(self, name: str) -> Block:
        return self.by_name[name]


@dataclass(frozen=True)
class Gaussian:
    """Mean x (n,) and covariance P (n, n) over the blocks of a layout; read-only."""

    x: Vec
    P: Mat
    layout: Layout

    def mean(self, name: str) -> Vec:
        return self.x[self.layout[name].slice]

    def cov(self, a: str, b: str | None = None) -> Mat:
        return self.P[self.layout[a].slice, self.layout[b or a].slice]


@dataclass(frozen=True)
class Robot:
    """A moving thing: block robot:<id>, and robot:<id>:calib iff its calibration is estimated."""

    id: str
    motion: MotionModel

    @property
    def block(self) -> str:
        return f"robot:{self.id}"

    @property
    def calib_block(self) -> str:
        return f"robot:{self.id}:calib"


@dataclass(frozen=True)
class Mount:
    """A sensor at a hook of a robot. Blocks mount:<id>:pose and mount:<id>:calib exist iff they
    are estimated; otherwise `pose` and the sensor's own calib0 hold."""

    id: str
    sensor: Sensor
    robot: str
    hook: str
    pose: Vec
    """Sensor pose x_RS in the hook's frame, in the sensor's space."""

    @property
    def pose_block(self) -> str:
        return f"mount:{self.id}:pose"

    @property
    def calib_block(self) -> str:
        return f"mount:{self.id}:calib"


@dataclass(frozen=True)
class Instrument:
    """An internal measurement model fitted to a robot."""

    id: str
    robot: str
    model: InternalMeasurementModel


@dataclass(frozen=True)
class Learnt:
    """What all measurements of a partial feature by one mount have in common, given each of its
    particles: the error of its first view, and of the way since."""

    b: Vec
    """Mean (K, m), to be added to a prediction."""
    B: Mat
    """Covariance (K, m, m)."""
    E: Mat
    """H_k P H_k' (K, m, m) at the time: how large it could have been."""


@dataclass(frozen=True)
class Feature:
    """What is known of a landmark besides its block feature:<label> of the state.

    A marker on a robot is a feature too: it has no block of its own, its coordinates follow from
    the block of its carrier.
    """

    label: Label
    model: FeatureModel
    mount: str
    """The mount that saw it first."""
    pose0: Vec
    """Pose of that sensor in the world when it was first seen."""
    z0: Vec
    """Where it was seen then."""
    appearance: Any
    """What recognises it: an identity (int), or an image patch."""
    born: int
    """Frame of its initialisation."""
    attempts: int = 0
    matches: int = 0
    updates: int = 0
    misses: int = 0
    """Failed searches in a row."""
    known: bool = False
    """Given at the start, not found by the filter."""
    particles: Particles | None = None
    """Free parameters of a partial feature."""
    learnt: Mapping[str, Learnt] = field(default_factory=dict)
    """What each mount's measurements of it have in common, by mount."""
    extent: tuple[float, float] | None = None
    """Where a segment begins and ends along its line; not a part of the state."""
    carrier: str = ""
    """The robot that carries this marker, else nothing."""
    offset: Vec | None = None
    """Where the marker is, in the axes of its carrier."""
    hook: str = "base"
    """Of the carrier: what the marker is fixed to."""

    @property
    def block(self) -> str:
        return f"robot:{self.carrier}" if self.carrier else f"feature:{self.label}"


@dataclass(frozen=True)
class Axes:
    """Where the axes of a world are in those the run began in, after they were redefined."""

    pose: Vec
    """(7,) as estimated."""
    robot: str
    """Where it was when they were put there."""
    frame: int
    lost: frozenset[str] = frozenset()
    """Directions of the world that are not certain to be where they were: gravity, north, plane, or
    any direction."""
    true_pose: Vec | None = None
    """(7,) in truth, which is told in the first axes: for display and metrics, never for the
    filter; None: unknown."""


@dataclass(frozen=True)
class World:
    """Everything the estimator knows after some phase of some frame."""

    frame: int
    time: float
    gauss: Gaussian
    robots: Mapping[str, Robot]
    mounts: Mapping[str, Mount]
    instruments: Mapping[str, Instrument]
    features: Mapping[Label, Feature]
    policies: Policies
    up: str = "z"
    """Which world axis points up: z or y."""
    next_label: Label = 1
    axes: Axes | None = None
    """None: those the run began in."""

    def xp(self, robot: str, hook: str = "base") -> Vec:
        """Position state of a robot's hook."""
        r = self.robots[robot]
        return r.motion.xp(self.gauss.mean(r.block), hook).xp

    def mount_pose(self, mount: str) -> Vec:
        """x_RS of a mount, estimated or nominal."""
        m = self.mounts[mount]
        return self.gauss.mean(m.pose_block) if m.pose_block in self.gauss.layout else m.pose

    def mount_calib(self, mount: str) -> Vec:
        """Calibration of a mount's sensor, estimated or nominal."""
        m = self.mounts[mount]
        return (
            self.gauss.mean(m.calib_block)
            if m.calib_block in self.gauss.layout
            else m.sensor.calib0
        )

    def robot_calib(self, robot: str) -> Vec:
        """Calibration of a robot's motion model, estimated or nominal."""
        r = self.robots[robot]
        return (
            self.gauss.mean(r.calib_block)
            if r.calib_block in self.gauss.layout
            else r.motion.calib0
        )
