"""Every sensor with every landmark it starts: birth and innovation have the Jacobians they claim,
with the robot, the sensor's pose and its calibration all in the state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.birth import birth, initialise
from scene_core.filter.gaussian import dense
from scene_core.filter.groups import groups
from scene_core.filter.observe import observe, residual, sensor_state
from scene_core.filter.policies import Policies
from scene_core.filter.ports import Detection
from scene_core.filter.world import Gaussian, Layout, Mount, Robot, World
from scene_core.models.base import FeatureModel, MotionModel, Sensor
from scene_core.models.judge import own_scale
from scene_core.models.pairs import Pair, pairs
from tests.pair_worlds import ROBOTS, forward, landmark_named, of_points, sensor_named

STARTED = [p for p in pairs() if p.verdict == "starts"]


def everything_in_the_state(sensor: Sensor, landmark: FeatureModel) -> World:
    """A robot somewhere with a sensor askew on it, and no landmark yet."""
    rng = np.random.default_rng(7)
    motion: MotionModel = ROBOTS[sensor.space.name][0]
    space, nk = sensor.space, len(sensor.calib_labels)
    sizes = {"robot:r": motion.state_size, "mount:eye:pose": space.n}
    layout = Layout.of(sizes | ({"mount:eye:calib": nk} if nk else {}))
    xv = 0.3 * rng.standard_normal(motion.state_size)
    pose = np.array(forward(sensor)) + 0.05 * rng.standard_normal(space.n)
    pose = space.normalise(pose)[0]
    x = np.concatenate([motion.normalise(xv + motion.lift(space.identity()).xv).value, pose])
    x = np.concatenate([x, sensor.calib0])
    A = 1e-2 * rng.standard_normal((x.size, x.size))
    is_line = landmark.shape == "segment"
    return World(
        frame=0,
        time=0.0,
        gauss=Gaussian(frozen(x), frozen(A @ A.T), layout),
        robots={"r": Robot("r", motion)},
        mounts={"eye": Mount("eye", sensor, "r", "base", frozen(pose))},
        instruments={},
        features={},
        policies=Policies(
            landmark=of_points() if is_line else landmark, line=landmark if is_line else None
        ),
        up="z" if space.d == 3 else "y",
    )


def somewhere(sensor: Sensor, shape: str) -> Vec:
    """A measurement of a point well in view, or of a segment."""
    rng = np.random.default_rng(8)
    lo, hi = np.array(sensor.limits).T
    ends = lo + (hi - lo) * rng.uniform(0.2, 0.8, (2 if shape == "segment" else 1, len(lo)))
    # Only what a point can cause: a pair of cameras measures more than that.
    X: Vec = sensor.backproject(ends, np.ones((len(ends), len(sensor.unmeasured))), sensor.calib0).X
    X[:, -1] = rng.uniform(0.2, 0.8, len(X))
    return sensor.project(X, sensor.calib0).h.ravel()


def at(world: World, x: Vec) -> World:
    return replace(world, gauss=Gaussian(x, world.gauss.P, world.gauss.layout))


def scales(world: World, x: Vec) -> Vec:
    """How far each component may move: a calibration by a part of itself, all else of 1."""
    out = np.ones(x.size)
    if "mount:eye:calib" in world.gauss.layout:
        calib = world.gauss.layout["mount:eye:calib"].slice
        out[calib] = own_scale(x[calib])
    return out


def numeric(f: Callable[[World], Vec], world: World, x: Vec) -> Mat:
    """df/dx by central differences."""
    columns = []
    for i, h in enumerate(1e-6 * scales(world, x)):
        step = h * np.eye(x.size)[i]
        columns.append((f(at(world, x + step)) - f(at(world, x - step))) / (2.0 * h))
    return np.stack(columns, axis=-1)


def same(claimed: Mat, wanted: Mat, world: World, x: Vec) -> None:
    """Equal in the units in which each column moves."""
    scale = scales(world, x)
    size = max(1.0, float(np.abs(wanted * scale).max()))
    np.testing.assert_allclose(claimed * scale, wanted * scale, rtol=1e-5, atol=1e-7 * size)


@pytest.mark.parametrize("pair", STARTED, ids=lambda p: f"{p.sensor}, {p.landmark}")
def test_birth_and_innovation_have_the_jacobians_they_claim(pair: Pair) -> None:
    sensor, landmark = sensor_named(pair.sensor), landmark_named(pair.landmark)
    world, z = everything_in_the_state(sensor, landmark), somewhere(sensor, landmark.shape)
    x, layout = world.gauss.x, world.gauss.layout

    def born(w: World) -> Vec:
        return birth(w, sensor_state(w, "eye"), landmark, z)[0]

    y, by, _ = birth(world, sensor_state(world, "eye"), landmark, z)
    none = {b.name: np.zeros((y.size, b.size)) for b in layout.blocks}
    same(np.concatenate(list((none | by).values()), axis=1), numeric(born, world, x), world, x)
    if landmark.free_labels:
        return
    world, _ = initialise(world, "eye", Detection(z, 1, shape=landmark.shape))
    # Off the place of its birth, where much would vanish.
    x = world.gauss.x.copy()
    robot = layout["robot:r"].slice
    x[robot] += 0.02 * np.random.default_rng(9).standard_normal(x[robot].size)

    def innovation(w: World) -> Vec:
        here = sensor_state(w, "eye")
        return residual(here, observe(here, groups(w)[0], w.gauss.x), z[None]).nu[0]

    here = sensor_state(at(world, x), "eye")
    claimed = residual(here, observe(here, groups(at(world, x))[0], x), z[None]).rows
    same(dense([claimed], x.size), -numeric(innovation, world, x), world, x)
