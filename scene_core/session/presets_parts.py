"""What the simulated scenarios are put together from: every part once as the estimator believes it
and once as it truly is, which are the same unless something is said about the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np

from scene_core.filter.policies import Association, Management, Policies, Selection, Update
from scene_core.geometry import quaternion
from scene_core.models.base import FeatureModel, InternalMeasurementModel, MotionModel, Sensor
from scene_core.models.camera import CentralCamera
from scene_core.session.config import (
    EstimatorSettings,
    Experiment,
    InstrumentSettings,
    KnownFeature,
    MountSettings,
    RobotSettings,
)
from scene_core.sources.drivers import Driver
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueInstrument, TrueMount, TrueRobot
from scene_core.sources.worlds import SimulatedWorld, landmarks

Pose = tuple[float, ...]
AnyCamera = TypeVar("AnyCamera", bound=CentralCamera)

ALL = 500
"""A number of features that stands for: as many as there are."""
OWN_AXES: Pose = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Where a sensor in space sits whose axes are the robot's."""
FORWARD = (0.5, -0.5, 0.5, -0.5)
"""Orientation of a camera that looks ahead on a robot with x forward, y left, z up."""
NONE: Mapping[str, float] = MappingProxyType({})


class Scenario(NamedTuple):
    """What a module of scenarios tells of each."""

    make: Callable[[], Experiment]
    frames: int = 400
    """How long one run is when statistics are taken."""
    reason: str = ""
    """Why its NEES is outside its band: an EKF's limit is a fact to show. Empty: it is inside."""


class RobotParts(NamedTuple):
    """A robot as it is believed and as it is."""

    believed: RobotSettings
    true: TrueRobot


class MountParts(NamedTuple):
    """A sensor on a robot as it is believed and as it is."""

    believed: MountSettings
    true: TrueMount


def robot(
    motion: MotionModel,
    driver: Driver,
    start: Mapping[str, float] = NONE,
    start_sd: Mapping[str, float] = NONE,
    *,
    calib_sd: Mapping[str, float] = NONE,
    true_calib: Mapping[str, float] = NONE,
    noise_on: Literal["motion", "controls"] = "motion",
    on_ground: bool = False,
) -> RobotParts:
    """A robot that starts around what is believed, as far off as `start_sd` says."""
    return RobotParts(
        RobotSettings(motion, start, start_sd, calib_sd),
        TrueRobot(
            motion, driver, start, start_sd, true_calib, noise_on=noise_on, on_ground=on_ground
        ),
    )


def mount(
    sensor: Sensor,
    robot: str,
    pose: Pose,
    *,
    hook: str = "base",
    pose_sd: Mapping[str, float] = NONE,
    true_pose: Pose | None = None,
    calib_sd: Mapping[str, float] = NONE,
    true_calib: Mapping[str, float] = NONE,
    true_calib_sd: Mapping[str, float] = NONE,
    margin: float = 0.0,
) -> MountParts:
    """A sensor; what is estimated of it is truly at `true_pose` and `true_calib`, or drawn around
    that with `true_calib_sd`."""
    return MountParts(
        MountSettings(sensor, robot, pose, hook, pose_sd, calib_sd),
        TrueMount(sensor, robot, true_pose or pose, hook, true_calib, true_calib_sd, margin=margin),
    )


def simulated(
    name: str,
    about: str,
    world: SimulatedWorld,
    robots: Mapping[str, RobotParts],
    mounts: Mapping[str, MountParts],
    policies: Policies,
    *,
    felt: Mapping[str, tuple[str, InternalMeasurementModel]] = MappingProxyType({}),
    known: tuple[KnownFeature, ...] = (),
    dt: float = 0.1,
    up: Literal["y", "z"] = "z",
    frames: int | None = None,
    **source: Any,
) -> Experiment:
    """A scenario in a computed world. `felt` are internal measurements (robot, model) by name;
    `source` is handed to the simulation."""
    return Experiment(
        name=name,
        about=about,
        estimator=EstimatorSettings(
            robots={i: r.believed for i, r in robots.items()},
            mounts={i: m.believed for i, m in mounts.items()},
            policies=policies,
            instruments={i: InstrumentSettings(on, model) for i, (on, model) in felt.items()},
            known=known,
            up=up,
        ),
        source=Simulation(
            world=world,
            robots={i: r.true for i, r in robots.items()},
            mounts={i: m.true for i, m in mounts.items()},
            instruments={i: TrueInstrument(on, model) for i, (on, model) in felt.items()},
            dt=dt,
            up=up,
            **source,
        ),
        frames=frames,
    )


def identified(
    landmark: FeatureModel,
    budget: int,
    *,
    new: int = 1,
    first: int = 8,
    features: int = 120,
    update: Literal["stacked", "sequential", "iterated"] = "stacked",
    invariant: bool = False,
) -> Policies:
    """Landmarks that say who they are: every one in view is mapped, none is given up because it
    was not found."""
    return Policies(
        landmark=landmark,
        selection=Selection(budget=budget),
        association=Association("identity"),
        update=Update(update, invariant=invariant),
        management=Management(
            keep_visible=ALL,
            max_new=new,
            max_new_first=first,
            max_features=features,
            min_match_ratio=0.0,
        ),
    )


def seen_from_anywhere(camera: AnyCamera) -> AnyCamera:
    """A camera whose landmarks have identities, read from any distance and direction."""
    return replace(camera, max_scale=0.0, max_angle=0.0)


def known_points(
    world: SimulatedWorld, ids: tuple[int, ...], sd: float = 0.01
) -> tuple[KnownFeature, ...]:
    """Points of a world that stands with z up, given at the start by their identities."""
    places = dict(zip(*(a.tolist() for a in landmarks(world)), strict=True))
    return tuple(KnownFeature(tuple(places[i]), i, sd) for i in ids)


def off(pose: Pose, turn: tuple[float, float, float]) -> Pose:
    """A pose in space turned by a rotation vector [rad] in its own axes: how a sensor is really
    fixed."""
    q = quaternion.product(np.array(pose[3:]), quaternion.from_rotation_vector(np.array(turn))[0])
    return (*pose[:3], *q.tolist())
