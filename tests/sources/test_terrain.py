"""Robots on undulating ground: on its height, tilted to its slope, not turned by it."""

from __future__ import annotations

import numpy as np
import pytest

from scene_core.filter.ports import SourceError
from scene_core.geometry import quaternion
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.nomad_3d import TerrainNomad
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.sources.buildings import CorridorPlan
from scene_core.sources.drivers import ConstantControls, Waypoints
from scene_core.sources.simulated import Simulation
from scene_core.sources.terrain import Terrain, on_ground
from scene_core.sources.truth import TrueRobot
from scene_core.sources.worlds import ThickCloister, in_axes

HILLS = Terrain(relief=0.3, layout=3)


def way(robot: TrueRobot, up: str, frames: int, world: Terrain = HILLS) -> np.ndarray:
    simulation = Simulation(world, {"r": robot}, {}, dt=0.1, up=up)
    state, out = simulation.start(), []
    for k in range(frames):
        _, state = simulation.advance(state, k)
        out.append(state.xv["r"])
    return np.array(out)


def on_it(xv: np.ndarray, up: str) -> None:
    """Height and normal of the ground at every place of a trajectory (T, >= 7)."""
    turned = in_axes(HILLS, np.eye(3), up).T
    at = xv[:, :3] @ turned
    ground = HILLS.ground(at[:, :2])
    np.testing.assert_allclose(at[:, 2], ground.height, atol=1e-9)
    normal = np.column_stack([-ground.slope, np.ones(len(at))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    own = np.eye(3)["xyz".index(up)]
    stands = np.array([quaternion.rotate(q, own).v for q in xv[:, 3:7]]) @ turned
    np.testing.assert_allclose(stands, normal, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(xv[:, 3:7], axis=1), 1.0)


def test_the_nomad_stays_on_the_ground_between_its_waypoints() -> None:
    corners = ((-4.0, 0.0, 4.0), (4.0, 0.0, 4.0), (4.0, 0.0, -4.0))
    robot = TrueRobot(TerrainNomad(), Waypoints(corners), on_ground=True)
    xv = way(robot, "y", 900)
    on_it(xv, "y")
    near = [np.linalg.norm(xv[:, [0, 2]] - np.array(c)[[0, 2]], axis=1).min() for c in corners]
    assert max(near) < 0.4 and np.ptp(xv[:, 1]) > 0.3


def test_a_robot_with_z_up_climbs_the_same_hills() -> None:
    drive = ConstantControls({"dx": 0.04, "az": 0.005})
    robot = TrueRobot(Odometry3D(), drive, {"x": 1.0}, noise_on="controls", on_ground=True)
    on_it(way(robot, "z", 300), "z")


def test_flat_ground_changes_nothing_but_the_height() -> None:
    flat, drive = Terrain(relief=0.0), ConstantControls({"dx": 0.04, "az": 0.01})
    for up in ("z", "y"):
        turn = {"z": "az", "y": "ay"}[up]
        drive = ConstantControls({"dx": 0.04, turn: 0.01})
        free = TrueRobot(Odometry3D(), drive, noise_on="controls")
        held = TrueRobot(Odometry3D(), drive, {up: 2.0}, noise_on="controls", on_ground=True)
        np.testing.assert_allclose(way(held, up, 50, flat), way(free, up, 50, flat), atol=1e-12)


def test_the_tilt_does_not_turn_the_robot() -> None:
    """The smallest turn between two normals has no part about either of them."""
    motion, rng = Odometry3D(), np.random.default_rng(0)
    for _ in range(50):
        roll, pitch, yaw = rng.uniform(-1.0, 1.0, 3) * [0.3, 0.3, 3.0]
        q = quaternion.from_euler(roll, pitch, yaw)
        xv = np.array([*rng.uniform(-5, 5, 3), *q])
        put = on_ground(HILLS, "z", motion, xv)
        tilt = quaternion.product(put[3:], quaternion.conjugate(q))
        before, after = (quaternion.rotate(p, np.array([0, 0, 1.0])).v for p in (q, put[3:]))
        assert abs(tilt[1:] @ before) < 1e-12 and abs(tilt[1:] @ after) < 1e-12
        np.testing.assert_allclose(on_ground(HILLS, "z", motion, put), put, atol=1e-12)


def test_what_can_not_be_on_the_ground_is_told() -> None:
    driver = ConstantControls()
    for world, motion, words in (
        (ThickCloister(), Odometry3D(), "the world 'cloister' has no ground to drive on"),
        (CorridorPlan(), Odometry3D(), "the world 'corridor plan' has no ground to drive on"),
        (HILLS, PlanarNomad(), "'planar nomad' can not be kept on the ground"),
    ):
        robots = {"r": TrueRobot(motion, driver, on_ground=True)}
        with pytest.raises(SourceError, match=words):
            Simulation(world, robots, {}).start()
