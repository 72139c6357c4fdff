"""Verdicts on matches: every distance is that of the dense textbook, whatever is judged with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene_core.arrays import frozen
from scene_core.filter.associate import judged
from scene_core.filter.birth import initialise
from scene_core.filter.expect import predictions
from scene_core.filter.gaussian import dense
from scene_core.filter.groups import groups
from scene_core.filter.observe import observe, residual, sensor_state
from scene_core.filter.ports import Detection, Match
from scene_core.filter.world import Gaussian, World
from scene_core.models.features.anchored_plucker_line import AnchoredPluckerLine
from scene_core.models.features.inverse_depth_line import InverseDepthLine
from tests.filter.worlds import camera_world

SEEN = np.array([[60.0, 50.0, 250.0, 90.0], [80.0, 200.0, 90.0, 40.0], [200.0, 60.0, 230.0, 190.0]])
OWN = np.diag([4.0, 9.0, 1.0, 2.0])
"""A covariance [px^2] that a measurement brings along."""


def world_of_lines() -> World:
    """Points, and three lines of two models, all correlated."""
    world = camera_world(seed=5, points=2, rays=1)
    for i, z in enumerate(SEEN):
        line = InverseDepthLine() if i == 1 else AnchoredPluckerLine()
        world = replace(world, policies=replace(world.policies, line=line))
        world, _ = initialise(world, "eye", Detection(z, 100 + i, shape="segment"))
    g, rng = world.gauss, np.random.default_rng(5)
    K = 0.01 * rng.standard_normal(g.P.shape)
    return replace(world, gauss=Gaussian(g.x, frozen(g.P + K @ K.T), g.layout))


@pytest.mark.parametrize("own", [None, OWN], ids=["the sensor's noise", "noise of its own"])
def test_lines_are_judged_together_as_each_by_itself(own: np.ndarray | None) -> None:
    world = world_of_lines()
    seen = predictions(world, "eye")
    lines = [label for p in seen if p.shape == "segment" for label in p.labels]
    assert len(lines) == 3
    z = dict(zip(sorted(lines), SEEN + np.array([0.5, -1.0, 2.0, 0.3]), strict=True))
    # Only one of them brings its own covariance; the order is not that of the models.
    found = [
        Match("eye", label, z[label], 1.0, 1.0, R=own if label == max(lines) else None)
        for label in sorted(lines, reverse=True)
    ]
    at, x = sensor_state(world, "eye"), world.gauss.x
    for match, verdict in zip(found, judged(world, "eye", seen, found), strict=True):
        group = groups(world, [match.label])[0]
        R = None if match.R is None else match.R[None]
        one = residual(at, observe(at, group, x), z[match.label][None], R)
        H = dense([one.rows], x.size)
        S = H @ world.gauss.P @ H.T + one.R[0]
        assert verdict.label == match.label
        np.testing.assert_allclose(verdict.S, S, rtol=1e-9)
        expected = one.nu[0] @ np.linalg.solve(S, one.nu[0])
        assert verdict.d2 == pytest.approx(expected, rel=1e-9)
