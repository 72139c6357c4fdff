"""New axes change how the state is told, and nothing of what any sensor is going to see."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scene_core.arrays import Vec, frozen
from scene_core.filter import axes
from scene_core.filter.expect import predictions
from scene_core.filter.fixed import lost
from scene_core.filter.gaussian import augment
from scene_core.filter.groups import groups, moments
from scene_core.filter.policies import Policies
from scene_core.filter.records import Predictions
from scene_core.filter.world import Feature, Gaussian, Instrument, Layout, Mount, Robot, World
from scene_core.geometry.embedding import embed, flatten
from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import ONE_D, THREE_D, TWO_D, Space
from scene_core.models import registry
from scene_core.models.base import FeatureModel, MotionModel, completed
from scene_core.models.features.inverse_depth_line import InverseDepthLine
from scene_core.models.internal.compass import Compass
from scene_core.models.internal.height import Height
from scene_core.models.internal.roll_pitch import RollPitch
from scene_core.models.judge import angles_of, difference, projectively_equal
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.inertial import Inertial
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.trial_states import sample_pose, sample_state
from scene_core.params import ParamError

SPACES = {"1-D": ONE_D, "2-D": TWO_D, "3-D": THREE_D}
MOTIONS = [cls() for cls in registry.models("motion").values()]
FREE = [m for m in MOTIONS if not m.world_fixed]
SENSORS = [cls() for cls in registry.models("sensors").values()]
ALL_FEATURES = [cls() for cls in registry.models("features").values()]
TURNED = [f for f in ALL_FEATURES if type(f).redefine_free is not FeatureModel.redefine_free]
"""Their particles turn with the axes, but only as far as that turn is certain."""
FEATURES = [f for f in ALL_FEATURES if f not in TURNED]


def in_space(models: list[Any], space: Space) -> list[Any]:
    return [m for m in models if m.space is space]


def built(
    motions: list[MotionModel], space: Space, seed: int, up: str = "z", sensors: int = 99
) -> World:
    """Robots that each have a sensor, the first one every sensor of a space, features of every
    model of it and a marker on the first robot, all correlated with each other."""
    rng = np.random.default_rng(seed)
    robots = {f"r{i}": Robot(f"r{i}", m) for i, m in enumerate(motions)}
    means: dict[str, Vec] = {}
    for robot in robots.values():
        xv = sample_state(robot.motion.state_labels, robot.motion.state_units, rng)
        means[robot.block] = robot.motion.normalise(xv).value
    mounts = {}
    for sensor in in_space(SENSORS, space)[:sensors]:
        for robot in list(robots) if not mounts else ["r0"]:
            name = f"{sensor.name} on {robot}"
            pose = sample_pose(space, rng)
            mounts[name] = mount = Mount(name, sensor, robot, "base", frozen(pose))
            means[mount.pose_block] = pose
            if len(sensor.calib_labels):
                means[mount.calib_block] = sensor.calib0
    features = {}
    first = next(iter(mounts))
    for model in in_space(FEATURES, space):
        for _ in range(2):
            label = len(features) + 1
            feature, y = found(model, label, first, rng)
            features[label] = feature
            means[feature.block] = y
    marker = len(features) + 1
    features[marker] = replace(
        features[1], label=marker, model=flat_point(space), carrier="r0", particles=None,
        extent=None, offset=frozen(rng.standard_normal(space.d)),
    )  # fmt: skip
    layout = Layout.of({name: len(x) for name, x in means.items()})
    A = 0.03 * rng.standard_normal((layout.size, layout.size))
    world = World(
        frame=3, time=0.1, gauss=Gaussian(np.concatenate(list(means.values())), A @ A.T, layout),
        robots=robots, mounts=mounts, instruments={}, features=features,
        policies=Policies(landmark=flat_point(space)), up=up, next_label=marker + 1,
    )  # fmt: skip
    return on_constraints(world)


def flat_point(space: Space) -> FeatureModel:
    """Plain coordinates."""
    return next(
        f for f in in_space(FEATURES, space) if f.state_size == space.d and not f.unmeasured
    )


def found(
    model: FeatureModel, label: int, mount: str, rng: np.random.Generator
) -> tuple[Feature, Vec]:
    space, ends = model.space, 2 if model.shape == "segment" else 1
    pose0 = sample_pose(space, rng)
    X = np.concatenate([_ray(space, rng) for _ in range(ends)])
    y = model.initialise(pose0, X[None]).y[0]
    feature = Feature(
        label, model, mount, frozen(pose0), frozen(np.zeros(1)), label, 0,
        particles=model.particles0() if model.free_labels else None,
        extent=(-0.7, 1.3) if ends == 2 else None,
    )  # fmt: skip
    return feature, y


def _ray(space: Space, rng: np.random.Generator) -> Vec:
    m = rng.standard_normal(space.d)
    return np.array([*(m / np.linalg.norm(m)), rng.uniform(0.2, 1.0)])


def on_constraints(world: World) -> World:
    """The same state, and its covariance, on the constraints of all parts."""
    x, P = world.gauss.x.copy(), world.gauss.P.copy()
    N = np.eye(len(x))
    normal = {r.block: r.motion.normalise for r in world.robots.values()}
    normal |= {m.pose_block: m.sensor.space.normalise for m in world.mounts.values()}
    normal |= {f.block: f.model.normalise for f in world.features.values() if not f.carrier}
    for name, function in normal.items():
        at = world.gauss.layout[name].slice
        proper = function(x[at])
        if proper is not None:
            x[at], N[at, at] = (
                completed(proper, function, x[at]) if hasattr(proper, "value") else proper
            )
    P = N @ P @ N.T
    return replace(world, gauss=Gaussian(frozen(x), frozen(0.5 * (P + P.T)), world.gauss.layout))


def seen(world: World) -> list[Predictions]:
    return [p for mount in world.mounts for p in predictions(world, mount)]


def assert_seen_alike(after: World, before: World) -> None:
    assert_seen_as(after, before, seen(before))


def assert_seen_as(after: World, before: World, expected_of: list[Predictions]) -> None:
    for new, old in zip(seen(after), expected_of, strict=True):
        where = f"{old.model} by {old.mount}"
        units = before.mounts[old.mount].sensor.units
        assert np.array_equal(new.fault, old.fault), where
        good = old.fault == 0
        h, expected = new.h[good], old.h[good]
        if old.shape == "segment":
            # A plane has two normals; which one is chosen says nothing.
            h = h * np.sign(np.vecdot(h, expected))[:, None]
            assert new.ends is not None and old.ends is not None
            assert_equal(new.ends[good], old.ends[good], where)
        else:
            h = expected + difference(h, expected, np.broadcast_to(angles_of(units), h.shape))
        assert_equal(h, expected, where)
        for a, b in ((new.E, old.E), (new.R, old.R), (new.S, old.S)):
            assert_equal(a[good], b[good], where)


def assert_equal(a: Vec, b: Vec, where: str) -> None:
    assert np.abs(a - b).max(initial=0.0) < 1e-10 * max(1.0, np.abs(b).max(initial=0.0)), where


@pytest.mark.parametrize("motion", FREE, ids=lambda m: m.name)
def test_every_model_predicts_the_same_in_new_axes(motion: MotionModel) -> None:
    for seed in range(2):
        world = built([motion, motion], motion.space, seed)
        before = seen(world)
        after = axes.redefine(world, "r0")
        assert_seen_as(after, world, before)
        assert_seen_as(axes.redefine(after, "r1"), world, before)


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("motion", in_space(FREE, TWO_D), ids=lambda m: m.name)
def test_planar_robots_carry_the_axes_of_a_map_in_space(motion: MotionModel, up: str) -> None:
    world = built([motion, PlanarUnicycle()], THREE_D, 5, up)
    assert_seen_alike(axes.redefine(world, "r0"), world)


@pytest.mark.parametrize("motion", FREE, ids=lambda m: m.name)
def test_the_defining_robot_is_at_the_origin_for_certain(motion: MotionModel) -> None:
    world = axes.redefine(built([motion, motion], motion.space, 1), "r1")
    robot = world.robots["r1"]
    xv, space = world.gauss.mean(robot.block), motion.space
    xp, J = completed(motion.xp(xv), motion.xp, xv)
    assert J is not None
    assert np.abs(space.difference(xp, space.identity())).max() < 1e-12
    P = space.tangent_map(xp) @ J @ world.gauss.cov(robot.block) @ (space.tangent_map(xp) @ J).T
    assert np.abs(P).max() < 1e-14
    whole = space.tangent_map(xp) @ J @ world.gauss.P[world.gauss.layout[robot.block].slice]
    assert np.abs(whole).max() < 1e-14


@pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
def test_all_blocks_go_through_one_joint_linear_map(space: Space) -> None:
    world = built(in_space(FREE, space)[:2], space, 2, sensors=1)
    at = axes.definition(world, "r0")
    parts, definer = axes.changes(world, at), world.gauss.layout["robot:r0"].slice
    J = axes.times(parts, np.eye(len(world.gauss.x)), definer)
    after = axes.redefine(world, "r0").gauss
    P = J @ world.gauss.P @ J.T
    assert np.abs(after.P - P).max() < 1e-12 * np.abs(P).max()
    assert np.array_equal(after.P, after.P.T)

    def told(x: Vec) -> Vec:
        moved = replace(world, gauss=replace(world.gauss, x=x))
        return axes.redefine(moved, "r0").gauss.x

    # Off its constraint a quaternion means nothing: changes along it are the covariance's own.
    values, ways = np.linalg.eigh(world.gauss.P)
    ways = ways[:, values > 1e-9 * values[-1]][:, :: max(1, len(values) // 12)]
    along = central_differences(
        lambda a: told(world.gauss.x + ways @ a), (np.zeros(ways.shape[1]),), 0
    )
    assert np.abs(J @ ways - along).max() < 1e-5


def test_blocks_that_do_not_depend_on_the_axes_stay() -> None:
    world = built([Impulse(), Impulse()], THREE_D, 0)
    after = axes.redefine(world, "r0")
    for mount in world.mounts.values():
        for block in (mount.pose_block, mount.calib_block):
            if block in world.gauss.layout:
                assert np.array_equal(after.gauss.mean(block), world.gauss.mean(block))
                assert np.array_equal(after.gauss.cov(block), world.gauss.cov(block))


def test_a_marker_follows_its_robot() -> None:
    world = built([Impulse(), Impulse()], THREE_D, 4)
    after = axes.redefine(world, "r0")
    label = world.next_label - 1
    assert after.features[label].offset is world.features[label].offset
    group = groups(after, [label])[0]
    y, Pyy = moments(group, after.gauss.x, after.gauss.P)
    offset = world.features[label].offset
    assert offset is not None
    # The first robot is the origin: the marker is where it is on it, and certainly there.
    assert np.abs(y[0] - offset).max() < 1e-12
    assert np.abs(Pyy).max() < 1e-13


def test_going_there_and_to_another_robot_is_going_to_the_other_at_once() -> None:
    world = built([Impulse(), Impulse()], THREE_D, 6)
    twice = axes.redefine(axes.redefine(world, "r0"), "r1")
    once = axes.redefine(world, "r1")
    assert twice.axes is not None and once.axes is not None
    assert np.abs(THREE_D.difference(twice.axes.pose, once.axes.pose)).max() < 1e-12
    assert np.abs(twice.gauss.P - once.gauss.P).max() < 1e-9 * np.abs(once.gauss.P).max()
    for label, feature in once.features.items():
        assert np.allclose(twice.features[label].pose0[:3], feature.pose0[:3], atol=1e-10)


# What is refused.


def with_start(world: World, robot: str, xp: Vec, P: Vec | None = None) -> World:
    """A robot somewhere else, with nothing known about it but P (7, 7) of its pose."""
    x, cov = world.gauss.x.copy(), world.gauss.P.copy()
    at = world.gauss.layout[f"robot:{robot}"].slice
    x[at.start : at.start + 7] = xp
    cov[at], cov[:, at] = 0.0, 0.0
    if P is not None:
        cov[at.start : at.start + 7, at.start : at.start + 7] = P
    return replace(world, gauss=Gaussian(frozen(x), frozen(cov), world.gauss.layout))


def pose(theta: float, axis: str, shift: tuple[float, ...] = (0.4, -0.3, 0.2)) -> Vec:
    out = np.array([*shift, np.cos(theta / 2), 0.0, 0.0, 0.0])
    out[4 + "xyz".index(axis)] = np.sin(theta / 2)
    return out


def test_gravity_may_not_tilt() -> None:
    world = built([Impulse(), Inertial()], THREE_D, 0)
    level = with_start(world, "r0", pose(0.7, "z"))
    assert_seen_alike(axes.redefine(level, "r0"), level)
    tilted = with_start(world, "r0", pose(0.1, "x"))
    sentence = (
        r"the axes can not be put at robot 'r0': the motion model 'inertial.*' of robot 'r1' "
        r"relies on gravity, and the up axis would tilt by 5\.73 deg"
    )
    with pytest.raises(ParamError, match=sentence):
        axes.redefine(tilted, "r0")


def test_a_tilt_that_is_only_unlikely_is_a_tilt() -> None:
    world = built([Impulse(), Inertial()], THREE_D, 0)
    G = THREE_D.from_tangent(pose(0.0, "z"))
    doubtful = with_start(world, "r0", pose(0.0, "z"), G @ np.diag([1, 1, 1, 1e-4, 0, 0]) @ G.T)
    with pytest.raises(ParamError, match=r"tilt by 0 ± 0\.57 deg"):
        axes.redefine(doubtful, "r0")
    turning = with_start(world, "r0", pose(0.0, "z"), G @ np.diag([1, 1, 1, 0, 0, 1e-4]) @ G.T)
    assert_seen_alike(axes.redefine(turning, "r0"), turning)


@pytest.mark.parametrize(
    ("model", "there", "sentence"),
    [
        (RollPitch(), pose(0.2, "y"), "gravity, and the up axis would tilt by 11.5 deg"),
        (Compass(), pose(0.2, "z"), "north, and its direction would turn by 11.5 deg"),
        (Height(), pose(0.2, "z"), "plane, and its height would change by 0.2 ± 0 m"),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_an_instrument_that_relies_on_a_direction_is_named(
    model: Any, there: Vec, sentence: str
) -> None:
    world = with_start(built([Impulse()], THREE_D, 0), "r0", there)
    world = replace(world, instruments={"felt": Instrument("felt", "r0", model)})
    with pytest.raises(ParamError, match=f"'{model.name}' .felt. relies on {sentence}"):
        axes.redefine(world, "r0")
    at_home = with_start(world, "r0", THREE_D.identity())
    assert axes.redefine(at_home, "r0").axes is not None


def test_a_planar_robot_stays_in_its_plane() -> None:
    world = built([Impulse(), PlanarUnicycle()], THREE_D, 3)
    turned = with_start(world, "r0", pose(1.0, "z", (0.4, -0.3, 0.0)))
    assert_seen_alike(axes.redefine(turned, "r0"), turned)
    with pytest.raises(ParamError, match="robot 'r1' is for 2-D, and the new axes would tilt by"):
        axes.redefine(with_start(world, "r0", pose(0.3, "y")), "r0")
    with pytest.raises(ParamError, match=r"would leave it by 0\.2"):
        axes.redefine(with_start(world, "r0", pose(0.3, "z")), "r0")


def test_an_unknown_robot_is_named() -> None:
    with pytest.raises(ParamError, match="no robot 'x': choose one of r0"):
        axes.redefine(built([Impulse()], THREE_D, 0), "x")


def test_what_was_lost_stays_lost() -> None:
    world = built([Impulse(), Impulse()], THREE_D, 0)
    level = axes.redefine(with_start(world, "r0", pose(0.5, "z", (1.0, 0.0, 0.0))), "r0")
    assert not lost(level, "gravity") and not lost(level, "plane")
    assert lost(level, "north") and lost(level, "the sun")
    again = axes.redefine(with_start(level, "r1", pose(0.5, "x")), "r1")
    assert lost(again, "gravity") and lost(again, "north") and not lost(world, "north")


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
def test_flatten_undoes_embed(space: Space, up: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        xp = sample_pose(space, rng)
        there, by_xp = embed(xp, space, up)
        back, by_pose = flatten(there, space, up)
        assert np.abs(space.difference(back, xp)).max() < 1e-14
        assert np.abs(by_pose @ by_xp - np.eye(space.n)).max() < 1e-14


@pytest.mark.parametrize("model", TURNED, ids=lambda m: m.name)
def test_particles_turn_with_axes_that_are_known(model: FeatureModel) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        world = built([PlanarUnicycle()], model.space, seed)
        mounts = world.mounts
        feature, y = found(model, 99, next(iter(mounts)), rng)
        gauss = augment(world.gauss, feature.block, y, {}, 0.01 * np.eye(len(y)))
        P = gauss.P.copy()
        P[:3], P[:, :3] = 0.0, 0.0
        world = replace(world, gauss=gauss, features={**world.features, 99: feature})
        sd = np.degrees(np.sqrt(gauss.P[2, 2]))
        sentence = f"landmark 99 .'{model.name}'. carry its .* known only to {sd:.2g} deg: wait"
        with pytest.raises(ParamError, match=sentence):
            axes.redefine(world, "r0")
        world = replace(world, gauss=replace(gauss, P=frozen(P)))
        after = axes.redefine(world, "r0")
        turned = after.features[99].particles
        assert turned is not None and feature.particles is not None
        assert not np.array_equal(turned.lam, feature.particles.lam)
        assert_seen_alike(after, world)


def test_a_landmark_may_point_anywhere_in_the_new_axes() -> None:
    """The pole of a direction is only a chart."""
    world = with_start(built([Impulse()], THREE_D, 8), "r0", pose(1.2, "y"))
    assert_seen_alike(axes.redefine(world, "r0"), world)


@pytest.mark.parametrize(
    ("far", "end"),
    [(0.3, 1.0), (0.0, 1.0), (0.05, 1.3)],
    ids=["in front", "at infinity", "beyond it"],
)
def test_an_end_stays_where_it_is_however_far(far: float, end: float) -> None:
    model = InverseDepthLine()
    y = np.array([0.3, -0.2, 0.1, 0.2, -0.4, 0.4, -0.1, 0.5, far])
    xpdef = sample_pose(THREE_D, np.random.default_rng(4))
    t = axes._extent(model, y, (-0.1, end), xpdef)
    moved = model.redefine(y, xpdef).value
    there = model.ends(moved, np.array(t)).reshape(2, 4)
    here = THREE_D.to_local(xpdef, model.ends(y, np.array([-0.1, end])).reshape(2, 4)).X
    there *= np.sign(np.vecdot(there, here))[:, None]  # X and -X are one point
    assert projectively_equal("the ends", there, here) == ""


@pytest.mark.parametrize("model", TURNED, ids=lambda m: m.name)
def test_an_uncertain_place_is_no_reason_to_keep_particles_from_turning(
    model: FeatureModel,
) -> None:
    world = built([PlanarUnicycle()], model.space, 1)
    feature, y = found(model, 99, next(iter(world.mounts)), np.random.default_rng(1))
    gauss = augment(world.gauss, feature.block, y, {}, 0.01 * np.eye(len(y)))
    P = gauss.P.copy()
    P[2], P[:, 2] = 0.0, 0.0
    assert P[0, 0] > 1e-6
    gauss = replace(gauss, P=frozen(P))
    world = replace(world, gauss=gauss, features={**world.features, 99: feature})
    assert_seen_alike(axes.redefine(world, "r0"), world)
