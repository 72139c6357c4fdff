"""What the map draws of lines, particles and markers is what the filter believes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene_core.arrays import frozen
from scene_core.filter.world import Feature, World
from scene_core.geometry import quaternion
from scene_core.geometry.ellipses import sigma
from scene_core.models.features.point_3d import EuclideanPoint
from tests.web.line_runs import house, run, shown
from web_panels import map_geometry as geo
from web_panels.bodies import turned_to
from web_panels.clouds import Clouds, places
from web_panels.map_layers import label_places, outline

RNG = np.random.default_rng(5)
LINES = ("Plücker line", "homogeneous line", "inverse depth line")


def world_of(kind: str) -> World:
    trace = shown(kind).trace
    assert trace is not None
    return trace.world


def test_lines_are_drawn_where_their_camera_predicts_them() -> None:
    """Both ends lie in the plane with the predicted normal, to a few mrad where an end is hundreds
    of lengths of the ruler away from it."""
    trace = shown("house").trace
    assert trace is not None
    world = next(r.world for r in trace.records if r.phase == "select")
    (p,) = trace.predictions("camera")
    cloud = Clouds().of(world, 0.95, 0.0, 1e9)
    assert len(cloud.lines.rows) == len(world.features) > 10
    at = geo.mount_pose(world, "camera")
    for label, ends in zip(cloud.labels, cloud.lines.ends, strict=True):
        rays = (ends - at[:3]) @ quaternion.matrix(at[3:])
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        np.testing.assert_allclose(rays @ p.h[p.row[label]], 0.0, atol=5e-3)
        assert np.linalg.norm(ends[1] - ends[0]) > 0.3


@pytest.mark.parametrize("line", LINES)
def test_ends_have_first_order_ellipsoids(line: str) -> None:
    """The content of drawn samples: J P J' against ends of random lines y ~ N(y, P)."""
    world = run(house(line), 12).world
    small = 1e-6
    gauss = replace(world.gauss, P=frozen(small * world.gauss.P))
    cloud = Clouds().of(replace(world, gauss=gauss), 0.95, 0.0)
    balls = cloud.lines.balls
    for k, key in enumerate(balls.labels):
        assert isinstance(key, tuple)
        label, end = key
        f = world.features[label]
        P = gauss.cov(f.block)
        y = RNG.multivariate_normal(world.gauss.mean(f.block), P, 4000, method="eigh")
        X = f.model.ends(y, np.tile(np.array(f.extent), (len(y), 1)))[:, 4 * end : 4 * end + 4]
        sampled = np.cov(places(X, 1e3).T)
        R = quaternion.matrix(balls.wxyz[k])
        drawn = R @ np.diag((balls.scales[k] / sigma(3, 0.95)) ** 2) @ R.T
        assert np.abs(drawn - sampled).max() < 0.15 * np.abs(sampled).max()
        if k > 5:
            break


def test_what_is_at_infinity_is_drawn_in_its_direction() -> None:
    X = np.array([[3.0, 4.0, 0.0, 0.0], [3.0, 4.0, 0.0, 1.0], [3.0, 4.0, 0.0, 1e-9]])
    at = places(X, 100.0)
    np.testing.assert_allclose(at, [[60.0, 80.0, 0.0], [3.0, 4.0, 0.0], [60.0, 80.0, 0.0]])
    assert np.isfinite(places(np.zeros((1, 4)), 100.0)).all()


def test_rods_lie_between_the_ends() -> None:
    cloud = Clouds().of(world_of("house"), 0.95, 0.0)
    rods = cloud.lines.rods(cloud.labels, 0.01)
    for k in range(len(rods.labels)):
        axis = quaternion.matrix(rods.wxyz[k])[:, 2] * 0.5 * rods.scales[k, 2]
        tips = np.stack([rods.positions[k] - axis, rods.positions[k] + axis])
        np.testing.assert_allclose(tips, cloud.lines.ends[k], atol=1e-9)
    down = turned_to(np.array([[0.0, 0.0, -2.0]]))
    np.testing.assert_allclose(quaternion.matrix(down[0])[:, 2], [0, 0, -1], atol=1e-12)


def test_particles_lie_on_their_ray_and_weigh_what_they_weigh() -> None:
    world = world_of("particles")
    cloud = Clouds().of(world, 0.95, 0.0)
    partial = [f for f in world.features.values() if f.particles is not None]
    assert partial and len(cloud.swarm.rows) == sum(particle_count(f) for f in partial)
    for f in partial:
        assert f.particles is not None
        own = [k for k, key in enumerate(cloud.swarm.labels) if key in own_keys(f)]
        row = cloud.labels.index(f.label)
        np.testing.assert_array_equal(cloud.swarm.rows[own], row)
        y = world.gauss.mean(f.block)
        way = cloud.swarm.positions[own] - y[:3]
        np.testing.assert_allclose(np.linalg.norm(way, axis=1), f.particles.lam[:, 0])
        np.testing.assert_allclose(way @ y[3:], f.particles.lam[:, 0])
        np.testing.assert_allclose(cloud.positions[row], y[:3] + f.particles.w @ way, atol=1e-9)
        heaviest = cloud.swarm.positions[own][np.argmax(f.particles.w)]
        np.testing.assert_array_equal(label_places(cloud)[row], heaviest)
        assert (cloud.scales[row] == 0.0).all(), "no ellipsoid hides its particles"
        sizes = cloud.swarm.grains(1.0).scales[own, 0]
        heavy = f.particles.w > 0.02 * f.particles.w.max()
        volume = sizes[heavy] ** 3 / f.particles.w[heavy]
        np.testing.assert_allclose(volume, volume[0])


def particle_count(f: Feature) -> int:
    return 0 if f.particles is None else len(f.particles.w)


def own_keys(f: Feature) -> set[tuple[int, int]]:
    return {(f.label, k) for k in range(particle_count(f))}


def test_a_marker_is_drawn_on_its_carrier() -> None:
    world = world_of("house")
    offset = np.array([0.2, -0.1, 0.5])
    marker = Feature(
        99, EuclideanPoint(), "camera", world.features[1].pose0, frozen([0, 0]), 7, 0,
        carrier="robot", offset=frozen(offset),
    )  # fmt: skip
    clouds = Clouds()
    before = clouds.of(world, 0.95, 0.0)
    marked = replace(world, features={**world.features, 99: marker})
    cloud = clouds.of(marked, 0.95, 0.0)
    xp = world.xp("robot")
    expected = xp[:3] + quaternion.matrix(xp[3:]) @ offset
    np.testing.assert_allclose(cloud.positions[cloud.labels.index(99)], expected)
    assert len(cloud.labels) == len(before.labels) + 1


def test_the_outline_of_a_line_goes_round_both_ends_and_along_it() -> None:
    cloud = Clouds().of(world_of("house"), 0.95, 0.01)
    white = outline(cloud, 3)
    k = int(np.flatnonzero(cloud.lines.rows == 3)[0])
    np.testing.assert_array_equal(white[-1], cloud.lines.ends[k])
    near = [np.linalg.norm(white[:-1] - end, axis=-1).min() for end in cloud.lines.ends[k]]
    assert len(white) == 2 * 144 + 1 and max(near) < 2.0
    swarm = Clouds().of(world_of("particles"), 0.95, 0.01)
    assert len(outline(swarm, int(swarm.swarm.rows[0]))) >= 1
    assert len(outline(swarm, 0)) == 144


def test_true_lines_and_ground_are_known_to_a_simulation_only() -> None:
    p = shown("house")
    assert geo.true_segments(p, "z").shape == (23, 2, 3)
    assert geo.true_segments(replace(p, trace=None), "z").shape == (0, 2, 3)
    assert geo.ground_mesh(p.experiment.source) is None
