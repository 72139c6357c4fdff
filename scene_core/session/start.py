"""The estimator's first state, built from an experiment's settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from scene_core.arrays import Mat, Vec, block_diag, frozen
from scene_core.filter.observe import sensor_state
from scene_core.filter.world import Feature, Gaussian, Instrument, Layout, Mount, Robot, World
from scene_core.geometry.spaces import THREE_D, Space
from scene_core.models.base import FeatureModel, MotionModel
from scene_core.models.labels import bare, quaternions
from scene_core.models.registry import carriable, runs_on
from scene_core.params import ParamError
from scene_core.session.config import (
    EstimatorSettings,
    Experiment,
    InstrumentSettings,
    KnownFeature,
    MountSettings,
    RobotSettings,
)
from scene_core.session.markers import with_markers
from scene_core.session.tracks import body_name
from scene_core.sources.vision import load_patch
from scene_core.sources.worlds import SimulatedWorld

ROTATION = ("rx", "ry", "rz")


class _Blocks:
    """The blocks of a state, independent of each other, as they are added."""

    def __init__(self) -> None:
        self._means: dict[str, Vec] = {}
        self._covs: list[Mat] = []

    def add(self, name: str, mean: Vec, cov: Mat) -> None:
        self._means[name] = mean
        self._covs.append(cov)

    def gaussian(self) -> Gaussian:
        mean = np.concatenate(list(self._means.values())) if self._means else np.zeros(0)
        layout = Layout.of({name: len(x) for name, x in self._means.items()})
        return Gaussian(frozen(mean), frozen(block_diag(self._covs)), layout)


def initial_world(experiment: Experiment) -> World:
    """The World before frame 0: blocks robot, robot calibration, mount pose, mount calibration,
    known feature, in this order; independent of each other.

    Raises ParamError naming the table and the label that does not fit.
    """
    settings = experiment.estimator
    check_names(settings)
    robots = {i: Robot(i, r.motion) for i, r in settings.robots.items()}
    mounts = {i: _mount(settings, i, m) for i, m in settings.mounts.items()}
    given = known_features(experiment)
    blocks = _Blocks()
    _add_robots(blocks, settings, robots)
    _add_mounts(blocks, settings, mounts)
    for label, known in enumerate(given, 1):
        position = _known_position(settings, label, known)
        blocks.add(f"feature:{label}", position, np.eye(len(position)) * known.sd**2)
    idle = resting(settings)
    instruments = {
        i: _instrument(settings, i, m) for i, m in settings.instruments.items() if i not in idle
    }
    world = World(
        frame=-1,
        time=0.0,
        gauss=blocks.gaussian(),
        robots=robots,
        mounts=mounts,
        instruments=instruments,
        features={},
        policies=settings.policies,
        up=settings.up,
        next_label=len(given) + 1,
    )
    return with_markers(_with_known(world, experiment, given), settings)


def check_names(settings: EstimatorSettings) -> None:
    """Raise ParamError where a robot is called like a body of another one, e.g. "pair second"."""
    bodies = [body_name(i, b) for i, r in settings.robots.items() for b in r.motion.bodies]
    twice = next((name for name in bodies if bodies.count(name) > 1), None)
    if twice is not None:
        raise ParamError(
            f"estimator.robots.{twice}: a body of another robot is called '{twice}'; choose "
            "another name"
        )


def _add_robots(blocks: _Blocks, settings: EstimatorSettings, robots: Mapping[str, Robot]) -> None:
    for i, robot in settings.robots.items():
        blocks.add(robots[i].block, *start_state(f"estimator.robots.{i}", robot))
    for i, robot in settings.robots.items():
        if robot.calib_sd:
            motion = robot.motion
            at = f"estimator.robots.{i}.calib_sd"
            cov = _diagonal(at, motion.calib_labels, robot.calib_sd)
            blocks.add(robots[i].calib_block, motion.calib0, cov)


def _add_mounts(blocks: _Blocks, settings: EstimatorSettings, mounts: Mapping[str, Mount]) -> None:
    for i, mount in settings.mounts.items():
        at, sensor, pose = f"estimator.mounts.{i}", mount.sensor, mounts[i].pose
        if mount.pose_sd:
            cov = _state_cov(f"{at}.pose_sd", sensor.space.labels, pose, mount.pose_sd)
            blocks.add(mounts[i].pose_block, pose, cov)
        if mount.calib_sd:
            cov = _diagonal(f"{at}.calib_sd", sensor.calib_labels, mount.calib_sd)
            blocks.add(mounts[i].calib_block, sensor.calib0, cov)


def start_state(at: str, robot: RobotSettings) -> tuple[Vec, Mat]:
    """Mean and covariance of a robot's state xv from its start and start_sd by label."""
    motion = robot.motion
    unknown = [label for label in robot.start if label not in motion.state_labels]
    if unknown:
        raise ParamError(
            f"{at}.start has no component '{unknown[0]}': the state of the motion model "
            f"'{motion.name}' is {', '.join(motion.state_labels)}"
        )
    labels = motion.state_labels
    xv = np.array([robot.start.get(s, 1.0 if bare(s) == "qw" else 0.0) for s in labels])
    if not np.isfinite(xv).all():
        raise ParamError(f"{at}.start: give finite numbers")
    for rows in quaternions(labels).values():
        if np.linalg.norm(xv[rows]) < 1e-6:
            names = ", ".join(labels[i] for i in rows)
            raise ParamError(f"{at}.start: the quaternion {names} may not be zero")
    xv = motion.normalise(xv).value
    return xv, _state_cov(f"{at}.start_sd", motion.state_labels, xv, robot.start_sd)


def sd_labels(state_labels: tuple[str, ...]) -> tuple[str, ...]:
    """Labels an initial standard deviation may be given for: a quaternion's are rx, ry, rz."""
    turns = quaternions(state_labels)
    inside = {i for rows in turns.values() for i in rows}
    plain = tuple(s for i, s in enumerate(state_labels) if i not in inside)
    return plain + tuple(prefix + r for prefix in turns for r in ROTATION)


def resting(settings: EstimatorSettings) -> dict[str, str]:
    """Instruments that can not run on the motion model of their robot, with a sentence why; they
    come back with a model that has what they need."""
    reasons = {
        name: runs_on(one.model, settings.robots[one.robot].motion)
        for name, one in settings.instruments.items()
        if one.robot in settings.robots
    }
    return {i: f"instrument {i} rests: {reason}" for i, reason in reasons.items() if reason}


def final_model(model: FeatureModel) -> FeatureModel:
    """The last parametrisation in the chain of successors: what a known feature is."""
    while (successor := model.successor()) is not None:
        model = successor
    return model


def _state_cov(at: str, labels: tuple[str, ...], x: Vec, sd: Mapping[str, float]) -> Mat:
    allowed = sd_labels(labels)
    check_sd(at, allowed, sd)
    P = np.diag([float(sd.get(label, 0.0)) ** 2 for label in labels])
    for prefix, rows in quaternions(labels).items():
        G = _from_turn(x[rows])
        rotation = np.diag([float(sd.get(prefix + label, 0.0)) ** 2 for label in ROTATION])
        P[np.ix_(rows, rows)] = G @ rotation @ G.T
    return P


def sds_of(labels: tuple[str, ...], x: Vec, P: Mat) -> dict[str, float]:
    """The standard deviations that say P (n, n) about the mean x, by the labels of `sd_labels`."""
    out = dict(zip(labels, np.sqrt(P.diagonal()).tolist(), strict=True))
    for prefix, rows in quaternions(labels).items():
        G = np.linalg.pinv(_from_turn(x[rows]))
        turn = np.sqrt(np.maximum((G @ P[np.ix_(rows, rows)] @ G.T).diagonal(), 0.0)).tolist()
        out |= {prefix + label: sd for label, sd in zip(ROTATION, turn, strict=True)}
    return {label: out[label] for label in sd_labels(labels)}


def _from_turn(q: Vec) -> Mat:
    """(4, 3): the change of a quaternion for a small turn (rx, ry, rz)."""
    return THREE_D.from_tangent(np.concatenate([np.zeros(3), q]))[3:, 3:]


def _diagonal(at: str, labels: tuple[str, ...], sd: Mapping[str, float]) -> Mat:
    check_sd(at, labels, sd)
    return np.diag([float(sd.get(label, 0.0)) ** 2 for label in labels])


def check_sd(at: str, allowed: tuple[str, ...], sd: Mapping[str, float]) -> None:
    """Raise ParamError unless all labels are allowed and all standard deviations make sense."""
    for label, value in sd.items():
        if label not in allowed:
            known = ", ".join(allowed) or "nothing"
            raise ParamError(f"{at} has no component '{label}': it may hold {known}")
        if not (np.isfinite(value) and value >= 0):
            raise ParamError(f"{at}.{label} = {value}: a standard deviation is finite and >= 0")


def _mount(settings: EstimatorSettings, name: str, mount: MountSettings) -> Mount:
    at = f"estimator.mounts.{name}"
    if mount.robot not in settings.robots:
        known = ", ".join(settings.robots)
        raise ParamError(f"{at}.robot = '{mount.robot}': there is no such robot, only {known}")
    motion: MotionModel = settings.robots[mount.robot].motion
    if mount.hook not in motion.hooks:
        known = ", ".join(motion.hooks)
        raise ParamError(f"{at}.hook = '{mount.hook}': '{motion.name}' has the hooks {known}")
    space: Space = mount.sensor.space
    if len(mount.pose) != space.n or not np.isfinite(mount.pose).all():
        raise ParamError(f"{at}.pose: give {space.n} finite numbers ({', '.join(space.labels)})")
    reason = carriable(motion, mount.sensor)
    if reason:
        raise ParamError(f"{at}.sensor: {reason}")
    pose = np.asarray(mount.pose, dtype=np.float64)
    if space.n == THREE_D.n and np.linalg.norm(pose[3:]) < 1e-6:
        raise ParamError(f"{at}.pose: its quaternion (the last four numbers) may not be zero")
    return Mount(name, mount.sensor, mount.robot, mount.hook, frozen(space.normalise(pose)[0]))


def _instrument(settings: EstimatorSettings, name: str, one: InstrumentSettings) -> Instrument:
    at = f"estimator.instruments.{name}"
    if one.robot not in settings.robots:
        known = ", ".join(settings.robots)
        raise ParamError(f"{at}.robot = '{one.robot}': there is no such robot, only {known}")
    return Instrument(name, one.robot, one.model)


def _known_position(settings: EstimatorSettings, label: int, known: KnownFeature) -> Vec:
    model = final_model(settings.policies.landmark)
    position = np.asarray(known.position, dtype=np.float64)
    if position.shape != (model.state_size,) or not np.isfinite(position).all():
        raise ParamError(
            f"estimator.known {label}.position: give {model.state_size} finite numbers "
            f"({', '.join(model.state_labels)}) for '{model.name}'"
        )
    if not (np.isfinite(known.sd) and known.sd >= 0):
        raise ParamError(f"estimator.known {label}.sd = {known.sd}: give a finite number >= 0")
    return position


def known_features(experiment: Experiment) -> tuple[KnownFeature, ...]:
    """The landmarks that are given at the start: by the settings, and by the file of a simulated
    world."""
    world = getattr(experiment.source, "world", None)
    told = world.known() if isinstance(world, SimulatedWorld) else ()
    by_file = (KnownFeature(one.position, one.id, one.sd) for one in told)
    return (*experiment.estimator.known, *by_file)


def _with_known(world: World, experiment: Experiment, known: tuple[KnownFeature, ...]) -> World:
    if not known:
        return world
    if not world.mounts:
        raise ParamError("estimator.known: known features need a sensor that sees them")
    mount = next(iter(world.mounts))
    model = final_model(world.policies.landmark)
    at = sensor_state(world, mount)
    sensor, pose0 = at.mount.sensor, at.xws
    features = {}
    for label, one in enumerate(known, 1):
        X_W = model.primitive(world.gauss.mean(f"feature:{label}")[None]).X
        X_S = sensor.space.to_local(pose0, X_W).X
        z0 = sensor.project(X_S, at.k).h[0]
        features[label] = Feature(
            label=label,
            model=model,
            mount=mount,
            pose0=frozen(pose0),
            z0=frozen(z0),
            appearance=_appearance(experiment, one.appearance),
            born=-1,
            known=True,
        )
    return replace(world, features=features)


def _appearance(experiment: Experiment, appearance: Any) -> Any:
    """What recognises a known feature: an identity, or a patch, whose place a simulation knows by
    name and a recording by file."""
    resolve = getattr(experiment.source, "appearance_of", None)
    if resolve is not None:
        return resolve(appearance)
    if isinstance(appearance, str):
        return load_patch(appearance)
    return appearance
