"""Partial features: weights, mixtures, pruning, and how one takes its place in the state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from scene_core.arrays import frozen
from scene_core.filter.associate import judged
from scene_core.filter.birth import initialise
from scene_core.filter.correct import correct
from scene_core.filter.expect import predictions
from scene_core.filter.gaussian import Gaussian, dense
from scene_core.filter.groups import groups
from scene_core.filter.manage import convert_ready, delete_failing
from scene_core.filter.observe import observe, residual, sensor_state
from scene_core.filter.particles import alone, hypotheses, nearest, open_predictions, reweighted
from scene_core.filter.ports import Detection, Match
from scene_core.filter.settle import CURVED, WIDER, curvature, placed, settled
from scene_core.filter.world import Feature, World
from scene_core.models.base import Particles
from scene_core.models.features.anchored_homogeneous import AnchoredHomogeneous
from scene_core.models.features.range_ring_2d import PlanarRangeRing
from scene_core.models.features.ray_particles import RayWithParticles
from tests.filter.worlds import camera_world, management

PIXEL = np.array([170.0, 100.0])


def open_world(seed: int = 1, **parameters: object) -> tuple[World, int]:
    """Three known points and a feature that was just born, seen from a little farther left."""
    world = camera_world(seed, points=3, rays=0, whole=False)
    ray = RayWithParticles(**parameters)  # type: ignore[arg-type]
    world = replace(world, policies=replace(world.policies, landmark=ray))
    world, event = initialise(world, "eye", Detection(PIXEL, 9))
    assert event.label is not None
    x = world.gauss.x.copy()
    x[1] += 0.15
    # Sharper than the fixture's: a pose is known to millimetres.
    gauss = Gaussian(frozen(x), frozen(1e-3 * world.gauss.P), world.gauss.layout)
    return replace(world, gauss=gauss), event.label


def textbook(world: World, label: int) -> tuple[np.ndarray, np.ndarray]:
    """h_k and E_k of every particle, one after the other, from dense Jacobians."""
    f, n = world.features[label], world.gauss.x.size
    assert f.particles is not None
    at = sensor_state(world, "eye")
    sensor, y = at.mount.sensor, world.gauss.mean(f.block)
    h, E = [], []
    for lam in f.particles.lam:
        X_W, by_y, _ = f.model.point(y, lam)
        X_S, by_xws, by_XW = sensor.space.to_local(at.xws, X_W)
        z, by_XS, _ = sensor.project(X_S, at.k)
        assert by_XS is not None and by_y is not None
        H = np.zeros((2, n))
        H[:, at.columns] = by_XS @ by_xws @ at.dxws_by_dx
        H[:, world.gauss.layout[f.block].slice] = by_XS @ by_XW @ by_y
        h.append(z)
        E.append(H @ world.gauss.P @ H.T)
    return np.array(h), np.array(E)


def seen(world: World, label: int, depth: float) -> np.ndarray:
    f, at = world.features[label], sensor_state(world, "eye")
    X_W = f.model.point(world.gauss.mean(f.block), np.array([depth])).X
    return at.mount.sensor.project(at.mount.sensor.space.to_local(at.xws, X_W).X, at.k).h


def match(label: int, z: np.ndarray) -> Match:
    return Match("eye", label, z, 1.0, 1.0)


def cloud(feature: Feature) -> Particles:
    assert feature.particles is not None
    return feature.particles


OWN = np.array([[3.0, 1.0], [1.0, 8.0]])
"""The covariance that a measurement brings itself."""


@pytest.mark.parametrize("own", [None, OWN], ids=["the sensor's", "its own"])
def test_weights_are_those_of_a_looped_bayes_update(own: np.ndarray | None) -> None:
    world, label = open_world()
    z = seen(world, label, 2.0) + np.array([0.4, -0.3])
    after = cloud(reweighted(world, "eye", [replace(match(label, z), R=own)])[label])
    h, E = textbook(world, label)
    R = world.mounts["eye"].sensor.R(h) if own is None else np.broadcast_to(own, E.shape)
    before = cloud(world.features[label])
    w = np.array(
        [w * multivariate_normal.pdf(z, h[k], E[k] + R[k]) for k, w in enumerate(before.w)]
    )
    keep = w >= world.features[label].model.prune * w.mean()
    assert 1 < keep.sum() < len(w)
    np.testing.assert_array_equal(after.lam, before.lam[keep])
    np.testing.assert_allclose(after.w, w[keep] / w[keep].sum(), rtol=1e-6)


def test_matches_are_held_against_all_particles_at_once_each_by_its_own_noise() -> None:
    world, first = open_world()
    world, event = initialise(world, "eye", Detection(PIXEL + 30.0, 10))
    second = event.label
    assert second is not None
    # One has fewer particles than the other, and the coarse one is not the last.
    after = reweighted(world, "eye", [match(second, seen(world, second, 2.0))])
    world = replace(world, features={**world.features, **after})
    found = [
        replace(match(first, seen(world, first, 1.0) + 9.0), R=OWN),
        match(second, seen(world, second, 2.0) + 5.0),
    ]
    d2 = nearest(world, "eye", found)
    for one in found:
        h, E = textbook(world, one.label)
        assert one.z is not None
        R = world.mounts["eye"].sensor.R(h) if one.R is None else one.R
        S, nu = E + R, one.z - h
        each = [n @ np.linalg.inv(s) @ n for n, s in zip(nu, S, strict=True)]
        assert d2[one.label] == pytest.approx(min(each), rel=1e-9)
    verdicts = judged(world, "eye", predictions(world, "eye"), found)
    assert [v.d2 for v in verdicts] == [d2[first], d2[second]]


def test_an_error_that_is_repeated_counts_once() -> None:
    """Three matches from one place: their joint density has E in every block, R on the diagonal."""
    world, label = open_world()
    z = seen(world, label, 2.0) + np.array([[0.9, -0.3], [1.1, 0.2], [0.7, 0.1]])
    (h, E), before = textbook(world, label), cloud(world.features[label])
    R = world.mounts["eye"].sensor.R(h)
    for one in z:
        world = replace(
            world, features={**world.features, **reweighted(world, "eye", [match(label, one)])}
        )
    after = cloud(world.features[label])
    where = [int(np.flatnonzero(before.lam == lam)[0]) for lam in after.lam]
    joint = np.array(
        [
            multivariate_normal.pdf(
                z.ravel(), np.tile(h[k], 3), np.tile(E[k], (3, 3)) + np.kron(np.eye(3), R[k])
            )
            for k in where
        ]
    )
    np.testing.assert_allclose(after.w, joint / joint.sum(), rtol=1e-6)


@pytest.mark.parametrize("uniform_in", ["depth", "inverse depth"])
def test_the_mixture_has_the_moments_of_its_samples(uniform_in: str) -> None:
    world, label = open_world(uniform_in=uniform_in, min_depth=1.0)
    group = groups(world, [label])[0]
    at = sensor_state(world, "eye")
    p, hyp = open_predictions(world, at, group), hypotheses(world, at, group)
    rng = np.random.default_rng(0)
    k = rng.choice(hyp.w.shape[1], size=40000, p=hyp.w[0])
    L = np.linalg.cholesky(hyp.S[0, k])
    z = hyp.h[0, k] + (L @ rng.standard_normal((len(k), 2, 1)))[..., 0]
    S = p.E[0] + p.R[0]
    sd = np.sqrt(np.diag(S))
    np.testing.assert_allclose(p.h[0], z.mean(axis=0), atol=4 * sd.max() / np.sqrt(len(k)))
    np.testing.assert_allclose(S / np.outer(sd, sd), np.cov(z.T) / np.outer(sd, sd), atol=0.04)


def test_a_match_changes_weights_and_not_the_state() -> None:
    world, label = open_world()
    z = seen(world, label, 2.0)
    found = [match(label, z)]
    verdicts = judged(world, "eye", predictions(world, "eye"), found)
    assert verdicts[0].verdict == "accepted" and "of the nearest particle" in verdicts[0].why
    after, _, _ = correct(world, "eye", found, verdicts)
    # Without a match the state is put on its constraints all the same.
    without, _, _ = correct(world, "eye", [], ())
    np.testing.assert_array_equal(after.gauss.x, without.gauss.x)
    np.testing.assert_array_equal(after.gauss.P, without.gauss.P)
    assert len(cloud(after.features[label]).w) < len(cloud(world.features[label]).w)
    assert after.features[label].updates == 1


def collapsed(world: World, label: int, depth: float, sd: float) -> World:
    lam = depth + sd * np.linspace(-2.0, 2.0, 60)[:, None]
    w = np.exp(-0.5 * ((lam[:, 0] - depth) / sd) ** 2)
    f = replace(world.features[label], particles=Particles(frozen(lam), frozen(w / w.sum())))
    return replace(world, features={**world.features, label: f})


def test_the_covariance_of_a_settled_point_is_that_of_its_samples() -> None:
    world, label = open_world(seed=4)
    world = collapsed(world, label, 2.0, 0.05)
    f, rng = world.features[label], np.random.default_rng(1)
    gauss = placed(world.gauss, f)
    n = 40000
    x = rng.multivariate_normal(world.gauss.x, world.gauss.P, size=n)
    lam = rng.choice(cloud(f).lam[:, 0], p=cloud(f).w, size=n)[:, None]
    at = world.gauss.layout[f.block].slice
    samples = np.concatenate([x[:, : at.start], f.model.settle(x[:, at], lam).y], axis=1)
    P = np.cov(samples.T)
    sd = np.sqrt(np.diag(P))
    np.testing.assert_allclose(gauss.P / np.outer(sd, sd), P / np.outer(sd, sd), atol=0.03)
    np.testing.assert_allclose(gauss.x, samples.mean(axis=0), atol=5 * sd.max() / np.sqrt(n))


def test_settling_is_a_change_of_state_and_a_dense_textbook_update() -> None:
    world, label = open_world(seed=5)
    world = collapsed(world, label, 2.0, 0.1)
    z = seen(world, label, 2.02) + np.array([0.2, 0.1])
    after, events = convert_ready(world, "eye", [match(label, z)])
    assert [e.kind for e in events] == ["converted"]
    assert "anchored homogeneous" in events[0].text
    by_itself = settled(world, "eye", match(label, z))
    assert by_itself is not None
    np.testing.assert_array_equal(after.gauss.x, by_itself.gauss.x)
    f = after.features[label]
    assert f.particles is None and isinstance(f.model, AnchoredHomogeneous) and not f.learnt
    told, _ = alone(world, "eye", match(label, z))
    prior = placed(world.gauss, replace(world.features[label], particles=told), WIDER)
    there = replace(world, gauss=prior, features={**world.features, label: f})
    at = sensor_state(there, "eye")
    found = residual(at, observe(at, groups(there, [label])[0], prior.x), z[None])
    H = dense([found.rows], prior.x.size)
    K = prior.P @ H.T @ np.linalg.inv(H @ prior.P @ H.T + found.R[0])
    expected = prior.P - K @ H @ prior.P
    own = after.gauss.layout[f.block].slice
    unit = f.model.normalise((prior.x + K @ found.nu[0])[own])
    assert unit.jacobian is not None
    P = unit.jacobian @ expected[own, own] @ unit.jacobian.T
    np.testing.assert_allclose(after.gauss.P[own, own], P, rtol=1e-6, atol=1e-10)
    np.testing.assert_allclose(after.gauss.x[own], unit.value, rtol=1e-9)


def test_a_cloud_that_does_not_collapse_is_given_up_with_the_reason() -> None:
    world, label = open_world()
    world = management(world, open_attempts=12)
    f = world.features[label]
    old = replace(f, attempts=12, matches=12, updates=12)
    after, events = delete_failing(replace(world, features={**world.features, label: old}))
    assert label not in after.features and f.block not in after.gauss.layout
    assert events[0].text == f"{label} deleted: still open after 12 searches"
    few = replace(f, particles=Particles(frozen([[1.0], [3.0]]), frozen([0.5, 0.5])))
    after, events = delete_failing(replace(world, features={**world.features, label: few}))
    assert label not in after.features
    assert events[0].text == f"{label} deleted: only 2 of its particles are left"
    assert label in delete_failing(world)[0].features


def test_rays_keep_the_length_one_while_others_are_measured() -> None:
    world, label = open_world(seed=7)
    gauss = Gaussian(world.gauss.x, frozen(100.0 * world.gauss.P), world.gauss.layout)
    world = replace(world, gauss=gauss)
    expected = predictions(world, "eye")
    complete = next(p for p in expected if p.particles is None)
    found = [match(k, complete.h[i] + 3.0) for k, i in complete.row.items()]
    after, _, _ = correct(world, "eye", found, judged(world, "eye", expected, found))
    u = after.gauss.mean(world.features[label].block)[3:]
    assert not np.array_equal(u, world.gauss.mean(world.features[label].block)[3:])
    assert np.linalg.norm(u) == pytest.approx(1.0, abs=1e-12)


def test_what_the_mean_of_the_particles_does_not_predict_leaves_the_feature_open() -> None:
    world, label = open_world(seed=5)
    world = collapsed(world, label, 2.0, 0.1)
    z, across = seen(world, label, 2.0), np.array([0.0, 1.0])
    for off, stays in ((1.0, False), (60.0, True)):
        after, events = convert_ready(world, "eye", [match(label, z + off * across)])
        assert (after is world) == stays and len(events) == (not stays), off
    # The gate is that of what is going to be updated: of a measurement as coarse as it says.
    coarse = replace(match(label, z + 60.0 * across), R=900.0 * np.eye(2))
    after, events = convert_ready(world, "eye", [coarse])
    assert [e.kind for e in events] == ["converted"]
    before, now = world.gauss.mean("robot:cam"), after.gauss.mean("robot:cam")
    trusted = settled(world, "eye", replace(coarse, R=1e4 * np.eye(2)))
    assert trusted is not None
    moved = np.linalg.norm(trusted.gauss.mean("robot:cam") - before)
    assert 0.0 < moved < np.linalg.norm(now - before)


def test_one_that_settles_leaves_the_others_rays_at_length_one() -> None:
    world, label = open_world(seed=7)
    world, event = initialise(world, "eye", Detection(PIXEL + 40.0, 10))
    other = event.label
    assert other is not None
    x, A = world.gauss.x, np.random.default_rng(2).standard_normal((world.gauss.x.size,) * 2)
    world = replace(world, gauss=replace(world.gauss, P=frozen(4e-5 * A @ A.T)))
    world = collapsed(world, label, 2.0, 0.1)
    z = seen(world, label, 2.0) + 1.0
    after, events = convert_ready(world, "eye", [match(label, z)])
    assert len(events) == 1
    u = after.gauss.mean(world.features[other].block)[3:]
    assert not np.allclose(u, x[world.gauss.layout[world.features[other].block].slice][3:])
    assert np.linalg.norm(u) == pytest.approx(1.0, abs=1e-12)


def test_features_of_several_kinds_are_converted_in_one_frame() -> None:
    """The first one changes where the others stand in the state."""
    world, label = open_world(seed=5)
    world, event = initialise(
        replace(world, policies=replace(world.policies, landmark=RayWithParticles(ratio=0.2))),
        "eye",
        Detection(PIXEL + 20.0, 10),
    )
    other = event.label
    assert other is not None and len(groups(world, [label, other])) == 2
    for one in (label, other):
        world = collapsed(world, one, 2.0, 0.1)
    found = [match(one, seen(world, one, 2.0)) for one in (label, other)]
    after, events = convert_ready(world, "eye", found)
    assert [e.label for e in events] == [label, other]
    assert isinstance(after.features[label].model, AnchoredHomogeneous)
    assert isinstance(after.features[other].model, AnchoredHomogeneous)


def test_what_was_learnt_before_decides_nothing_that_can_not_be_undone() -> None:
    """A wrong common error, as after a turn, changes weights, but not who is pruned."""
    world, label = open_world()
    z = seen(world, label, 2.0)
    after = reweighted(world, "eye", [match(label, z)])[label]
    past = after.learnt["eye"]
    wrong = replace(after, learnt={"eye": replace(past, b=frozen(past.b + 40.0))})
    world = replace(world, features={**world.features, label: after})
    misled = replace(world, features={**world.features, label: wrong})
    clouds = [cloud(reweighted(w, "eye", [match(label, z)])[label]) for w in (world, misled)]
    np.testing.assert_array_equal(clouds[0].lam, clouds[1].lam)
    assert not np.allclose(clouds[0].w, clouds[1].w, rtol=1e-3)
    assert nearest(misled, "eye", [match(label, z)]) == pytest.approx(
        nearest(world, "eye", [match(label, z)])
    )


@pytest.mark.parametrize("aside", [0.5, 2.2, 5.0])
def test_mirror_images_in_one_cloud_are_curved(aside: float) -> None:
    """Ranges seen from ahead fall with b^2: with b = N(+-aside, 1) sd on both sides of the way
    nothing is linear; on one side, N(aside, 1), curved / linear = 1 / (2 aside^2)."""
    ring, sd = PlanarRangeRing(), 0.01
    b = sd * np.linspace(-10.0, 10.0, 401)
    one = np.exp(-0.5 * (b / sd - aside) ** 2)
    both = one + one[::-1]
    for w, share in ((one, 0.5 / aside**2), (both, np.inf)):
        told = Particles(b[:, None], w / w.sum())
        found = curvature(ring, told, (b**2)[:, None])
        assert (found > 1e6) if np.isinf(share) else found == pytest.approx(share, rel=1e-3)
    assert 0.5 / 2.2**2 == pytest.approx(CURVED, rel=0.05)
