"""Points and lines in one update: the same as the dense textbook filter, and their whole life."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.associate import judged
from scene_core.filter.birth import initialise
from scene_core.filter.correct import correct
from scene_core.filter.expect import predictions
from scene_core.filter.extents import extended
from scene_core.filter.groups import groups
from scene_core.filter.manage import convert_ready
from scene_core.filter.observe import observe, residual, sensor_state
from scene_core.filter.ports import Detection, Match
from scene_core.filter.world import Gaussian, World
from scene_core.geometry.numdiff import central_differences
from scene_core.models import registry, segments
from scene_core.models.base import FeatureModel
from scene_core.models.features.anchored_plucker_line import AnchoredPluckerLine
from scene_core.models.features.inverse_depth_line import InverseDepthLine
from scene_core.models.features.plucker_line import PluckerLine
from tests.filter.worlds import camera_world, without_new

LINES = [c for c in registry.models("features").values() if c.shape == "segment"]
SEEN = np.array([[60.0, 50.0, 250.0, 90.0], [80.0, 200.0, 90.0, 40.0], [200.0, 60.0, 230.0, 190.0]])
"""Segments in the image."""
each_line = pytest.mark.parametrize("line", LINES, ids=lambda c: c.name)


def world_with(line: FeatureModel, seed: int) -> World:
    """Points and three lines, all correlated, everything in the state; nothing new is started and
    nothing rejected."""
    world = without_new(camera_world(seed=seed, points=3, rays=1))
    gate = replace(world.policies.gate, confidence=0.999999)
    policies = replace(world.policies, line=line, gate=gate)
    world = replace(world, policies=policies)
    for i, z in enumerate(SEEN):
        world, _ = initialise(world, "eye", Detection(z, 100 + i, shape="segment"))
    features = {k: replace(f, appearance=k) for k, f in world.features.items()}
    # As after some updates: the distances are known better than by the prior alone.
    rng, g = np.random.default_rng(seed), world.gauss
    K = 0.02 * rng.standard_normal((g.x.size, 40))
    P = np.linalg.inv(np.linalg.inv(g.P + 1e-6 * np.eye(g.x.size)) + K @ K.T * 1e4)
    P = 0.5 * (P + P.T)
    return replace(world, features=features, gauss=Gaussian(g.x, frozen(P), g.layout))


def measured(world: World, rng: np.random.Generator) -> dict[int, Vec]:
    """What is seen of all features, the ends of the lines somewhere along them."""
    z = {}
    for p in predictions(world, "eye"):
        for i, label in enumerate(p.labels):
            if p.ends is None:
                z[label] = p.h[i] + 0.4 * rng.standard_normal(2)
            else:
                a, b = p.ends[i].reshape(2, 2)
                ends = [a + s * (b - a) for s in (0.1, 0.7)]
                z[label] = np.concatenate(ends) + 0.4 * rng.standard_normal(4)
    return z


def nu_of(world: World, x: Vec, label: int, z: Vec) -> Vec:
    """Innovation of one feature as a function of the whole state."""
    moved = replace(world, gauss=Gaussian(x, world.gauss.P, world.gauss.layout))
    at, f = sensor_state(moved, "eye"), world.features[label]
    sensor = at.mount.sensor
    X = f.model.primitive(moved.gauss.mean(f.block)).X
    if f.model.shape == "point":
        return z - sensor.project(sensor.space.to_local(at.xws, X).X, at.k).h
    n = segments.normal(segments.to_local(sensor.space, at.xws, X)[0]).n
    return segments.end_distances(sensor, n, z, at.k).nu


def noise_of(world: World, x: Vec, label: int, z: Vec) -> Mat:
    """Its covariance from the measurement's."""
    moved = replace(world, gauss=Gaussian(x, world.gauss.P, world.gauss.layout))
    f = world.features[label]
    sd = moved.mounts["eye"].sensor.R(z.reshape(-1, 2))
    if f.model.shape == "point":
        return sd[0]
    J = central_differences(lambda z: nu_of(world, x, label, z), (z,), 0)
    R = np.zeros((4, 4))
    R[:2, :2], R[2:, 2:] = sd
    return J @ R @ J.T


def dense(world: World, x: Vec, P: Mat, labels: list[int], z: dict[int, Vec]) -> tuple[Vec, Mat]:
    """x + K nu, (I - K H) P, with every Jacobian by central differences."""
    nu = np.concatenate([nu_of(world, x, k, z[k]) for k in labels])
    H = np.concatenate(
        [-central_differences(lambda x, k=k: nu_of(world, x, k, z[k]), (x,), 0) for k in labels]
    )
    R = np.zeros((nu.size, nu.size))
    for i, k in enumerate(labels):
        R[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = noise_of(world, x, k, z[k])
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    return x + K @ nu, (np.eye(x.size) - K @ H) @ P


def normalised(world: World, x: Vec, P: Mat, labels: list[int]) -> tuple[Vec, Mat]:
    """The robot and the features that were measured back on their constraints."""
    layout, motion = world.gauss.layout, world.robots["cam"].motion
    own = {f"feature:{k}": world.features[k].model.normalise for k in labels}
    x, J = x.copy(), np.eye(x.size)
    pose = world.mounts["eye"].sensor.space.normalise
    for name, function in {"robot:cam": motion.normalise, "mount:eye:pose": pose, **own}.items():
        at = layout[name].slice
        result = function(x[at])
        if result is not None:
            J[at, at] = central_differences(lambda v, f=function: f(v)[0], (x[at],), 0)
            x[at] = result[0]
    return x, J @ P @ J.T


@pytest.mark.parametrize(
    ("kind", "line"),
    [*(("stacked", line) for line in LINES), ("sequential", PluckerLine)],
    ids=lambda v: getattr(v, "name", v),
)
def test_points_and_lines_are_updated_as_in_the_textbook(kind: str, line: type) -> None:
    world = world_with(line(), seed=3)
    update = replace(world.policies.update, kind=kind)
    world = replace(world, policies=replace(world.policies, update=update))
    z = measured(world, np.random.default_rng(1))
    matches = [Match("eye", label, ends, 1.0, 0.0) for label, ends in z.items()]
    verdicts = judged(world, "eye", predictions(world, "eye"), matches)
    after, verdicts, _ = correct(world, "eye", matches, verdicts)
    assert [a.verdict for a in verdicts] == ["accepted"] * 7
    order = [a.label for a in verdicts]
    x, P = world.gauss.x, world.gauss.P
    for labels in [order] if kind == "stacked" else [[k] for k in order]:
        x, P = normalised(world, *dense(world, x, P, labels, z), labels)
    np.testing.assert_allclose(after.gauss.x, x, rtol=1e-5, atol=2e-6)
    np.testing.assert_allclose(after.gauss.P, P, rtol=1e-4, atol=1e-3 * P.diagonal().max())


@each_line
def test_a_new_line_is_expected_where_it_was_seen(line: type) -> None:
    world = world_with(line(), seed=5)
    found = [p for p in predictions(world, "eye") if p.ends is not None]
    assert len(found) == 1 and not found[0].fault.any()
    assert found[0].ends is not None
    np.testing.assert_allclose(found[0].ends[:, :2], SEEN[:, :2], atol=1e-3)
    np.testing.assert_allclose(found[0].ends[:, 2:], SEEN[:, 2:], atol=1e-3)


def test_ends_are_neither_needed_nor_believed() -> None:
    """The same line measured elsewhere along it says the same."""
    world = world_with(InverseDepthLine(), seed=7)
    at = sensor_state(world, "eye")
    group = groups(world, [5])[0]
    seen = observe(at, group, world.gauss.x)
    a, b = SEEN[0, :2], SEEN[0, 2:]
    slid = np.concatenate([a + 0.3 * (b - a), a + 0.9 * (b - a)])
    for z in (SEEN[0], slid):
        np.testing.assert_allclose(residual(at, seen, z[None]).nu, 0.0, atol=2e-4)


def known(world: World, label: int, sd: float = 1e-6) -> World:
    """The same world with a feature that is all but certain."""
    g = world.gauss
    P, at = g.P.copy(), g.layout[world.features[label].block].slice
    P[at, :] = P[:, at] = 0.0
    P[at, at] = sd**2 * np.eye(at.stop - at.start)
    return replace(world, gauss=Gaussian(g.x, frozen(P), g.layout))


def ends_of(world: World, label: int) -> Vec:
    """Where both ends of a segment are in the image."""
    found = next(p for p in predictions(world, "eye") if label in p.row)
    assert found.ends is not None
    return found.ends[found.row[label]]


def part(z: Vec, a: float, b: float) -> Vec:
    first, second = z.reshape(2, 2)
    return np.concatenate([first + s * (second - first) for s in (a, b)])


@each_line
def test_the_ends_of_a_line_not_yet_known_are_those_last_measured(line: type) -> None:
    world = world_with(line(), seed=9)
    half = extended(world, "eye", [5], [part(SEEN[0], 0.1, 0.6)])
    np.testing.assert_allclose(ends_of(half, 5), part(SEEN[0], 0.1, 0.6), atol=0.01)


@each_line
def test_a_known_line_only_grows(line: type) -> None:
    world = known(world_with(line(), seed=9), 5)
    same = extended(world, "eye", [5], [part(SEEN[0], 0.1, 0.6)])
    np.testing.assert_allclose(ends_of(same, 5), SEEN[0], atol=0.01)
    longer = extended(world, "eye", [5], [part(SEEN[0], 0.3, 1.15)])
    np.testing.assert_allclose(ends_of(longer, 5), part(SEEN[0], 0.0, 1.15), atol=0.1)


@each_line
def test_the_ends_of_many_lines_are_those_of_each_by_itself(line: type) -> None:
    world = known(world_with(line(), seed=9), 5)
    z = {7: part(SEEN[2], -0.2, 0.7), 5: part(SEEN[0], -0.2, 0.7), 6: part(SEEN[1], -0.2, 0.7)}
    together = extended(world, "eye", list(z), list(z.values())).features
    for label, one in z.items():
        alone = extended(world, "eye", [label], [one]).features[label].extent
        assert together[label].extent == pytest.approx(alone, rel=1e-9)
        assert alone != world.features[label].extent


def test_a_line_that_changes_its_parametrisation_keeps_line_and_ends() -> None:
    world = known(world_with(AnchoredPluckerLine(linearity=0.1), seed=9), 5, 1e-4)
    after, events = convert_ready(world, "eye", [Match("eye", 5, SEEN[0], 1.0, 1.0)])
    assert [e.kind for e in events] == ["converted"]
    assert isinstance(after.features[5].model, PluckerLine)
    before, now = (next(p for p in predictions(w, "eye") if 5 in p.row) for w in (world, after))
    np.testing.assert_allclose(ends_of(after, 5), ends_of(world, 5), atol=1e-6)
    S = [p.S[p.row[5]] for p in (before, now)]
    np.testing.assert_allclose(S[1], S[0], rtol=1e-6)
