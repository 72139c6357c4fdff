"""A marker is a feature whose place is a function of the state of the robot that carries it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.associate import judged
from scene_core.filter.correct import correct
from scene_core.filter.expect import predictions
from scene_core.filter.gaussian import dense
from scene_core.filter.groups import groups, moments, rows_of
from scene_core.filter.manage import delete, delete_failing
from scene_core.filter.observe import observe, rows, sensor_state
from scene_core.filter.policies import Policies
from scene_core.filter.ports import Match
from scene_core.filter.world import Feature, Gaussian, Layout, Mount, Robot, World
from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import TWO_D
from scene_core.models.features.point_2d import Point2D
from scene_core.models.motion.ackermann import PlanarAckermann
from scene_core.models.motion.odometry_2d import PlanarOdometry
from scene_core.models.sensors.range_bearing import RangeBearing

OFFSET = np.array([0.3, -0.2])


def two_robots(seed: int = 0) -> World:
    """A guide with a scanner, an assistant with a marker, and a landmark; all correlated."""
    rng = np.random.default_rng(seed)
    guide, assistant = Robot("guide", PlanarOdometry()), Robot("assistant", PlanarAckermann())
    layout = Layout.of({guide.block: 3, assistant.block: 5, "feature:1": 2})
    x = np.array([0.2, -0.1, 0.4, 2.0, 1.0, -1.2, 0.5, 0.1, 1.5, -1.0])
    A = 0.02 * rng.standard_normal((10, 10))
    pose0 = frozen(np.zeros(3))
    at = {"label": 1, "model": Point2D(), "mount": "scanner", "pose0": pose0, "z0": frozen([1, 0])}
    features = {
        1: Feature(**at, appearance=1, born=0),
        2: Feature(
            **{**at, "label": 2},
            appearance=7,
            born=-1,
            known=True,
            carrier="assistant",
            offset=frozen(OFFSET),
        ),
    }
    sensor = RangeBearing(reach_max=20.0)
    return World(
        frame=0,
        time=0.0,
        gauss=Gaussian(frozen(x), frozen(A @ A.T), layout),
        robots={"guide": guide, "assistant": assistant},
        mounts={
            "scanner": Mount("scanner", sensor, "guide", "base", frozen([0.1, 0.0, 0.2])),
            "blind": Mount("blind", sensor, "assistant", "base", pose0),
        },
        instruments={},
        features=features,
        policies=Policies(landmark=Point2D()),
        next_label=3,
    )


def h_of(world: World, x: Vec) -> Vec:
    """Range and bearing of the marker, written out."""
    (gz, gx, gphi), (az, ax, aphi) = x[:3], x[3:6]
    sz, sx = gz + 0.1 * np.cos(gphi), gx + 0.1 * np.sin(gphi)
    c, s = np.cos(aphi), np.sin(aphi)
    dz, dx = az + c * OFFSET[0] - s * OFFSET[1] - sz, ax + s * OFFSET[0] + c * OFFSET[1] - sx
    return np.array([np.hypot(dz, dx), np.arctan2(dx, dz) - gphi - 0.2])


def test_h_and_its_jacobian_by_both_robots() -> None:
    world = two_robots()
    group = groups(world, [2])[0]
    at = sensor_state(world, "scanner")
    seen = observe(at, group, world.gauss.x)
    np.testing.assert_allclose(seen.h[0], h_of(world, world.gauss.x), atol=1e-12)
    H = dense([rows(at, seen)], world.gauss.x.size)
    numeric = central_differences(lambda x: h_of(world, x), (world.gauss.x,), 0)
    np.testing.assert_allclose(H, numeric, atol=1e-7)
    assert np.abs(H[:, 3:6]).max() > 0.1, "the assistant's pose is in H"


def test_an_update_is_the_dense_textbook_one() -> None:
    world = two_robots(seed=1)
    z = h_of(world, world.gauss.x) + np.array([0.02, -0.01])
    found = [Match("scanner", 2, z, 1.0, 1.0)]
    verdicts = judged(world, "scanner", predictions(world, "scanner"), found)
    assert verdicts[0].verdict == "accepted"
    after, _, _ = correct(world, "scanner", found, verdicts)
    H = central_differences(lambda x: h_of(world, x), (world.gauss.x,), 0)
    P = world.gauss.P
    R = world.mounts["scanner"].sensor.R(h_of(world, world.gauss.x)[None])[0]
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    expected: Vec = world.gauss.x + K @ (z - h_of(world, world.gauss.x))
    left: Mat = P - K @ H @ P
    np.testing.assert_allclose(after.gauss.x, expected, atol=1e-8)
    np.testing.assert_allclose(after.gauss.P, left, atol=1e-10)
    for block in ("robot:guide", "robot:assistant"):
        assert np.trace(after.gauss.cov(block)) < np.trace(world.gauss.cov(block))


def test_its_moments_are_those_of_its_robot() -> None:
    world = two_robots(seed=2)
    y, Pyy = moments(groups(world, [2])[0], world.gauss.x, world.gauss.P)
    xp = world.xp("assistant")
    np.testing.assert_allclose(y[0], TWO_D.to_world(xp, np.array([*OFFSET, 1.0])).X[:2], atol=1e-12)
    rng = np.random.default_rng(0)
    x = rng.multivariate_normal(world.gauss.x, 0.01 * world.gauss.P, size=20000)
    where = TWO_D.to_world(x[:, 3:6], np.tile([*OFFSET, 1.0], (len(x), 1))).X[:, :2]
    sd = np.outer(*2 * [np.sqrt(np.diag(Pyy[0]))])
    np.testing.assert_allclose(100.0 * np.cov(where.T) / sd, Pyy[0] / sd, atol=0.04)


def test_its_rows_beside_those_of_the_state() -> None:
    world = two_robots(seed=3)
    P, (marker, landmark) = rows_of(world, [2, 1])
    assert landmark == world.gauss.layout["feature:1"].slice
    n = world.gauss.x.size
    np.testing.assert_array_equal(P[:n, :n], world.gauss.P)
    _, Pyy = moments(groups(world, [2])[0], world.gauss.x, world.gauss.P)
    np.testing.assert_allclose(P[marker, marker], Pyy[0], atol=1e-12)
    J = central_differences(
        lambda x: moments(groups(world, [2])[0], x, world.gauss.P)[0][0], (world.gauss.x,), 0
    )
    np.testing.assert_allclose(P[marker, :n], J @ world.gauss.P, atol=1e-8)


def test_nobody_looks_for_a_marker_on_himself() -> None:
    world = two_robots()
    assert [p.labels for p in predictions(world, "scanner")] == [(1,), (2,)]
    assert [p.labels for p in predictions(world, "blind")] == [(1,)]


def test_limits_of_a_first_view_do_not_hold_for_what_moves() -> None:
    """pose0 is where the sensor is now: a marker may come from any side and any distance."""
    world = two_robots()
    far = replace(world.features[2], pose0=frozen([100.0, 100.0, 0.0]))
    moved = replace(world, features={**world.features, 2: far})
    for a, b in zip(predictions(world, "scanner"), predictions(moved, "scanner"), strict=True):
        np.testing.assert_array_equal(a.fault, b.fault)


@pytest.mark.parametrize("attempts", [0, 500])
def test_it_is_never_deleted(attempts: int) -> None:
    world = two_robots()
    old = replace(world.features[2], attempts=attempts, known=False)
    world = replace(world, features={**world.features, 2: old})
    after, events = delete_failing(world)
    assert 2 in after.features and not events
    assert "robot:assistant" in delete(world, [2]).gauss.layout
