"""The observation chain: its Jacobians, its covariances, batches, and warps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene_core.arrays import frozen
from scene_core.filter.expect import predictions
from scene_core.filter.gaussian import dense
from scene_core.filter.observe import (
    groups,
    innovation_covariance,
    observe,
    rows,
    sensor_state,
)
from scene_core.filter.warp import warps
from scene_core.filter.world import Gaussian, World
from tests.filter.worlds import camera_world


def chain(world: World, x: np.ndarray) -> np.ndarray:
    """All predicted measurements as one vector, of a state x."""
    moved = replace(world, gauss=Gaussian(frozen(x), world.gauss.P, world.gauss.layout))
    at = sensor_state(moved, "eye")
    return np.concatenate([observe(at, g, x).h.ravel() for g in groups(moved)])


@pytest.mark.parametrize("whole", [True, False], ids=["all in the state", "robot and map only"])
def test_whole_chain_against_central_differences(whole: bool) -> None:
    world = camera_world(seed=3, whole=whole)
    x = world.gauss.x
    at = sensor_state(world, "eye")
    H = dense([rows(at, observe(at, g, x)) for g in groups(world)], x.size)
    numeric = np.empty_like(H)
    for i in range(x.size):
        h = 1e-6 * max(1.0, abs(x[i]))
        plus, minus = x.copy(), x.copy()
        plus[i] += h
        minus[i] -= h
        numeric[:, i] = (chain(world, plus) - chain(world, minus)) / (2 * h)
    np.testing.assert_allclose(H, numeric, rtol=2e-5, atol=2e-4)


def test_innovation_covariance_is_the_dense_one() -> None:
    world = camera_world(seed=4)
    x, P = world.gauss.x, world.gauss.P
    at = sensor_state(world, "eye")
    for group in groups(world):
        seen = observe(at, group, x)
        E = innovation_covariance(P, rows(at, seen))
        H = dense([rows(at, seen)], x.size)
        for i in range(len(E)):
            Hi = H[2 * i : 2 * i + 2]
            np.testing.assert_allclose(E[i], Hi @ P @ Hi.T, rtol=1e-9, atol=1e-9)


def test_a_batch_equals_its_members_one_by_one() -> None:
    world = camera_world(seed=5, points=6, rays=5)
    at = sensor_state(world, "eye")
    for group in groups(world):
        batch = observe(at, group, world.gauss.x)
        for i, label in enumerate(group.labels):
            single = observe(at, groups(world, [label])[0], world.gauss.x)
            np.testing.assert_allclose(single.h[0], batch.h[i], rtol=1e-13)
            np.testing.assert_allclose(single.H_own[0], batch.H_own[i], rtol=1e-11, atol=1e-11)
            np.testing.assert_allclose(
                single.H_shared[0], batch.H_shared[i], rtol=1e-11, atol=1e-11
            )


def test_predictions_cover_every_feature_once_and_name_their_blocks() -> None:
    world = camera_world(seed=6)
    preds = predictions(world, "eye")
    labels = [label for p in preds for label in p.labels]
    assert sorted(labels) == sorted(world.features)
    for p in preds:
        assert list(p.H) == ["robot:cam", "mount:eye:pose", "mount:eye:calib", "feature"]
        assert p.H["robot:cam"].shape == (len(p.labels), 2, 13)
        np.testing.assert_allclose(p.S, p.E + p.R)


def test_warp_of_the_first_view_is_the_identity_and_half_the_distance_doubles_it() -> None:
    world = camera_world(seed=7, points=1, rays=0, whole=False)
    at = sensor_state(world, "eye")
    seen = observe(at, groups(world)[0], world.gauss.x)
    feature = replace(world.features[1], pose0=frozen(at.xws), z0=frozen(seen.h[0]))
    world = replace(world, features={1: feature})
    np.testing.assert_allclose(warps(world, at, [1])[0], np.eye(2), atol=1e-3)
    y = world.gauss.mean("feature:1")
    nearer = at.xws.copy()
    nearer[:3] += 0.5 * (y - at.xws[:3])
    A = warps(world, replace(at, xws=nearer), [1])[0]
    np.testing.assert_allclose(A, 2.0 * np.eye(2), atol=5e-3)
