"""The parts of a simulated experiment: how robots really move and sensors really measure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.ports import SourceError, Truth
from scene_core.geometry import quaternion
from scene_core.models.base import InternalMeasurementModel, MotionModel, Sensor
from scene_core.models.labels import bare, quaternions
from scene_core.models.lifting import lifted
from scene_core.params import entries, param
from scene_core.sources import noise
from scene_core.sources.drivers import Driver
from scene_core.sources.worlds import SimulatedWorld, in_axes, landmarks, lines


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
    calib_sd: Mapping[str, float] = entries(lo=0.0)
    """The true calibration is drawn around that with these standard deviations by label."""
    noise_on: str = param("motion", choices=("motion", "controls"), label="Noise on")
    """motion: the robot strays from the commanded motion. controls: it moves exactly as commanded
    and the estimator receives the commands with noise (the toolbox)."""
    on_ground: bool = param(False, effect="on reset", label="On the ground")
    """After every motion it is put down on the world's ground and tilted to its slope, keeping its
    heading; in a world that has a ground (terrain), with a motion model in 3-D."""

    def true_calib(self, name: str, seed: int) -> Vec:
        """True calibration (nk,) of the robot of this name."""
        nominal = _by_label(self.motion.calib_labels, self.motion.calib0)
        rng = noise.rng(seed, f"robot:{name}:calib")
        return _calibrated(f"source.robots.{name}", nominal, self.calib, self.calib_sd, rng)

    def drawn(self, name: str, dt: float, seed: int) -> Vec:
        """The true state at the start of the robot of this name, normalised."""
        motion, labels = self.motion, self.motion.state_labels
        by_label = {**self.driver.start(motion, dt), **self.start}
        xv = np.array([by_label.get(s, 1.0 if bare(s) == "qw" else 0.0) for s in labels])
        xv = motion.normalise(xv).value
        rng = noise.rng(seed, f"start:{name}")
        for at, label in enumerate(labels):
            xv[at] += self.start_sd.get(label, 0.0) * rng.standard_normal()
        for prefix, rows in quaternions(labels).items():
            sds = [self.start_sd.get(f"{prefix}r{axis}", 0.0) for axis in "xyz"]
            turn = np.array([sd * rng.standard_normal() for sd in sds])
            step = quaternion.from_rotation_vector(turn)[0]
            xv[rows] = quaternion.product(xv[rows], step)
        return motion.normalise(xv).value


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
    calib_sd: Mapping[str, float] = entries(lo=0.0)
    """The true calibration is drawn around that with these standard deviations by label."""
    every: int = param(1, lo=1, hi=1000, soft=(1, 10), label="Every n frames")
    """The sensor fires in every n-th frame."""
    offset: int = param(0, lo=0, hi=1000, soft=(0, 10), label="First frame")
    """The frame it fires in for the first time."""
    margin: float = param(0.0, lo=0.0, hi=1e4, soft=(0.0, 100.0), label="Margin")
    """New landmarks are offered only this far inside the sensor's limits, in its own units."""
    shortest: float = param(
        20.0, unit="px", lo=0.0, hi=1e4, soft=(0.0, 100.0), label="Shortest line"
    )
    """A camera measures a segment only when at least this much of it is in the image."""

    def true_calib(self, name: str, seed: int) -> Vec:
        """True calibration (nk,) of the mount of this name."""
        nominal = _by_label(self.sensor.calib_labels, self.sensor.calib0)
        rng = noise.rng(seed, f"mount:{name}:calib")
        return _calibrated(f"source.mounts.{name}", nominal, self.calib, self.calib_sd, rng)

    def fires(self, index: int) -> bool:
        """Whether the sensor measures in a frame."""
        return index >= self.offset and (index - self.offset) % self.every == 0


def check_robots(robots: Mapping[str, TrueRobot]) -> None:
    """Raises SourceError for the start of what a robot's state does not have, and for a spread that
    is none."""
    for i, robot in robots.items():
        labels = robot.motion.state_labels
        turns = (f"{prefix}r{axis}" for prefix in quaternions(labels) for axis in "xyz")
        for what, given, known in (
            ("start", robot.start, labels),
            ("start_sd", robot.start_sd, (*labels, *turns)),
        ):
            unknown = [s for s in given if s not in known]
            if unknown:
                raise SourceError(
                    f"source.robots.{i}.{what} has no component '{unknown[0]}': it may hold "
                    f"{', '.join(known)}"
                )
        below = [s for s, sd in robot.start_sd.items() if not sd >= 0.0]
        if below:
            raise SourceError(
                f"source.robots.{i}.start_sd.{below[0]} = {robot.start_sd[below[0]]}: a standard "
                "deviation is >= 0"
            )


def check_hook(at: str, hook: str, motion: MotionModel) -> None:
    """Raises SourceError when something is fixed to a hook that a robot does not have."""
    if hook not in motion.hooks:
        raise SourceError(
            f"{at}.hook = '{hook}': '{motion.name}' has the hooks {', '.join(motion.hooks)}"
        )


def check_mounts(mounts: Mapping[str, TrueMount], robots: Mapping[str, TrueRobot]) -> None:
    """Raises SourceError for a sensor that is on no robot, on none of its hooks, or at a place of
    another dimension."""
    for i, mount in mounts.items():
        if mount.robot not in robots:
            raise SourceError(f"source.mounts.{i}: there is no true robot '{mount.robot}'")
        check_hook(f"source.mounts.{i}", mount.hook, robots[mount.robot].motion)
        n = mount.sensor.space.n
        if len(mount.pose) != n:
            raise SourceError(f"source.mounts.{i}.pose: give {n} numbers, not {len(mount.pose)}")


@dataclass(frozen=True)
class TrueInstrument:
    """An internal measurement as it is really made."""

    robot: str
    model: InternalMeasurementModel


@dataclass(frozen=True)
class TrueMarker:
    """Where a marker really is on its robot; every sensor that is not at its hook sees it."""

    robot: str
    position: tuple[float, ...] = param(unit="m")
    """Place in the axes of the hook, in as many dimensions as the sensors that see it."""
    identity: int = param(lo=0, hi=2**31 - 1, effect="on reset")
    """What tells it from landmarks and other markers."""
    hook: str = "base"
    """What of the robot it is fixed to."""


@dataclass(frozen=True)
class Disturbances:
    """What goes wrong with measurements of identified points and segments."""

    misses: float = param(0.0, lo=0.0, hi=1.0, soft=(0.0, 0.5), label="Missed")
    """Fraction of the visible landmarks that are not detected."""
    outliers: float = param(0.0, lo=0.0, hi=1.0, soft=(0.0, 0.5), label="Outliers")
    """Fraction of the measurements that carry the right identity and a wrong place."""
    outlier_sigma: float = param(30.0, lo=1.0, hi=1e4, soft=(3.0, 100.0), label="Outlier size")
    """Distance of an outlier from the truth in standard deviations of the sensor's noise, half to
    one and a half times this, in any direction."""


def with_outliers(
    z: Vec,
    h: Vec,
    R: Mat,
    rows: np.ndarray,
    count: int,
    wrong: Disturbances,
    rng: np.random.Generator,
) -> Vec:
    """Measurements z (K, m) with some of them somewhere else, far from the true h (K, m).

    Of the `count` landmarks of the world those at `rows` (K,) are seen; which are hit and where to
    does not depend on that. R (K, m, m) is what the distance is measured by.
    """
    m = h.shape[1]
    hit = rng.random(count) < wrong.outliers
    way = rng.standard_normal((count, m))
    way *= (rng.uniform(0.5, 1.5, count) / np.linalg.norm(way, axis=1))[:, None]
    far = h + wrong.outlier_sigma * (np.linalg.cholesky(R) @ way[rows][..., None])[..., 0]
    return np.where(hit[rows][:, None], far, z)


@dataclass(frozen=True)
class SimulationState:
    """The true state after a frame."""

    xv: Mapping[str, Vec]
    memory: Mapping[str, Any]
    """What each robot's driver remembers."""
    before: Mapping[str, Vec]
    """True states one frame earlier: how far the sensors move during an exposure."""
    motions: Mapping[str, MotionModel]
    """Whose states these are."""


def retold(state: SimulationState, motions: Mapping[str, MotionModel]) -> SimulationState:
    """The same for robots some of which move by another motion model from now on: what the models
    have in common stays, the rest is as the new one's `lift` puts it."""
    swapped = {
        i: was
        for i, was in state.motions.items()
        if type(was) is not type(motions[i]) or was.state_labels != motions[i].state_labels
    }
    if not swapped:
        return state
    xv, before = dict(state.xv), dict(state.before)
    for i, was in swapped.items():
        for states in (xv, before):
            new = motions[i].normalise(lifted(was, motions[i], states[i]).xv).value
            states[i] = frozen(new)
    return SimulationState(xv, state.memory, before, motions)


def told(
    world: SimulatedWorld,
    up: str,
    robots: Mapping[str, TrueRobot],
    mounts: Mapping[str, TrueMount],
    state: SimulationState,
    seed: int,
) -> Truth:
    """What is really so in a state, for display and metrics."""
    labels = {}
    for i, robot in robots.items():
        motion = robot.motion
        labels[f"robot:{i}"] = _by_label(motion.state_labels, state.xv[i])
        labels[f"robot:{i}:calib"] = _by_label(motion.calib_labels, robot.true_calib(i, seed))
    for i, mount in mounts.items():
        sensor = mount.sensor
        labels[f"mount:{i}:pose"] = dict(zip(sensor.space.labels, mount.pose, strict=True))
        labels[f"mount:{i}:calib"] = _by_label(sensor.calib_labels, mount.true_calib(i, seed))
    ids, at = landmarks(world)
    line_ids, ends = lines(world)
    if world.space.d == 3:
        at, ends = in_axes(world, at, up), in_axes(world, ends, up)
    goals = {i: robot.driver.goal(state.memory[i]) for i, robot in robots.items()}
    return Truth(
        xp={i: frozen(robot.motion.xp(state.xv[i]).xp) for i, robot in robots.items()},
        labels=labels,
        points=frozen(at),
        ids=ids,
        segments=frozen(ends),
        segment_ids=line_ids,
        goals={i: frozen(goal) for i, goal in goals.items() if goal is not None},
        bodies={i: _further_bodies(robot.motion, state.xv[i]) for i, robot in robots.items()},
    )


def _further_bodies(motion: MotionModel, xv: Vec) -> dict[str, Vec]:
    return {body: frozen(motion.xp(xv, body).xp) for body in motion.bodies[1:]}


def _by_label(labels: Sequence[str], values: Vec) -> dict[str, float]:
    return dict(zip(labels, values.tolist(), strict=True))


def _calibrated(
    at: str,
    nominal: Mapping[str, float],
    true: Mapping[str, float],
    sd: Mapping[str, float],
    rng: np.random.Generator,
) -> Vec:
    """The true calibration; the draw of one component does not depend on which others are drawn."""
    unknown = [s for s in (*true, *sd) if s not in nominal]
    if unknown:
        known = ", ".join(nominal) or "nothing"
        raise SourceError(f"{at}: there is no calibration '{unknown[0]}': it has {known}")
    draws = rng.standard_normal(len(nominal))
    mean, sds = ({**nominal, **true}, {**dict.fromkeys(nominal, 0.0), **sd})
    return np.array(
        [mean[s] + sds[s] * z for s, z in zip(nominal, draws, strict=True)], dtype=float
    )
