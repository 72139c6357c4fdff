"""The ellipsoids of the robots are the covariances of the places of all their bodies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import viser

from scene_core.geometry import quaternion
from scene_core.geometry.ellipses import sigma
from scene_core.geometry.embedding import embed_covariances
from scene_core.session.commands import SetParam
from scene_core.session.presets import build
from scene_core.session.session import Session
from tests.web.test_gate import free_port
from web_panels import map_geometry
from web_panels.map_places import Places, place_ellipsoids


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer(host="127.0.0.1", port=free_port(), verbose=False)
    yield server
    server.stop()


def after(preset: str, frames: int) -> Session:
    session = Session(build(preset))
    for _ in range(frames):
        session.advance()
    return session


@pytest.mark.parametrize("preset", ["line", "car", "cloister", "pair"])
@pytest.mark.parametrize("confidence", [0.68, 0.95])
def test_a_robots_ellipsoid_has_the_stated_content(preset: str, confidence: float) -> None:
    world = after(preset, 25).world
    bodies = map_geometry.bodies(world.robots)
    at, scales, wxyz = place_ellipsoids(world, bodies, confidence, 0.0)
    assert len(at) == len(bodies) == (2 if preset == "pair" else 1)
    for (name, hook), x, half, q in zip(bodies, at, scales, wxyz, strict=True):
        motion, block = world.robots[name].motion, world.robots[name].block
        J = motion.xp(world.gauss.mean(block), hook).dxp_by_dxv
        d = motion.space.d
        assert J is not None
        P = embed_covariances((J @ world.gauss.cov(block) @ J.T)[:d, :d], motion.space, world.up)
        sd = half / sigma(d, confidence)
        R = quaternion.matrix(q)
        np.testing.assert_allclose(R @ np.diag(sd**2) @ R.T, P, atol=1e-6 * P.max())
        np.testing.assert_allclose(x, map_geometry.robot_pose(world, name, hook)[:3])


def test_what_is_drawn_follows_the_filter_and_the_stated_confidence(
    server: viser.ViserServer,
) -> None:
    session = after("car", 5)
    places = Places(server.scene, session.world, 10.0)
    places.render(session.world, 0.95)
    early, ring = places.node.batched_scales.copy(), places.rings[0].points.copy()
    places.render(session.world, 0.5)
    assert places.node.batched_scales.max() < early.max()
    reach = np.linalg.norm(ring - places.node.batched_positions[0], axis=-1).max()
    assert reach == pytest.approx(early.max(), rel=1e-3)
    session.apply(SetParam("estimator.mounts.scanner.sensor.reach_max", 0.5))  # dead reckoning
    for _ in range(40):
        session.advance()
    places.render(session.world, 0.95)
    assert places.node.batched_scales.max() > early.max()
