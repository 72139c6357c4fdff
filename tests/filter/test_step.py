"""A frame: order of the phases, immutability, and every decision with its reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene_core import params
from scene_core.arrays import frozen
from scene_core.filter.birth import initialise, initialise_at
from scene_core.filter.expect import predictions
from scene_core.filter.manage import delete
from scene_core.filter.observe import groups, observe, sensor_state
from scene_core.filter.policies import Update
from scene_core.filter.ports import Control, Detection, Frame, Points
from scene_core.filter.predict import predict, robot_motion
from scene_core.filter.records import Trace
from scene_core.filter.step import step
from scene_core.filter.world import Gaussian, World
from scene_core.session import presets
from scene_core.session.start import initial_world
from tests.filter.worlds import ToySource, camera_world, management, without_new


def seen_from(world: World, noise: float = 0.0) -> Points:
    """What the camera of `world` sees of its own features, with their labels as identities."""
    at = sensor_state(world, "eye")
    z, ids = [], []
    for group in groups(world):
        h = observe(at, group, world.gauss.x).h
        z.append(h)
        ids += list(group.labels)
    out = np.concatenate(z)
    return Points(out + noise * np.random.default_rng(0).standard_normal(out.shape), np.array(ids))


def identified(world: World) -> World:
    features = {k: replace(f, appearance=k) for k, f in world.features.items()}
    return replace(world, features=features)


def still_frame(raw: Points, index: int = 0) -> Frame:
    return Frame(index, index / 30, 0.0, {}, {"eye": raw})


def run(world: World, frame: Frame) -> Trace:
    return Trace(frame, world, tuple(step(world, frame, ToySource())), complete=True)


def test_phases_come_in_order_and_no_world_is_changed() -> None:
    world = without_new(identified(camera_world(seed=1)))
    before = (world.gauss.x.copy(), world.gauss.P.copy())
    trace = run(world, still_frame(seen_from(world, 0.5)))
    assert [r.phase for r in trace.records] == [
        "predict", "internal", "select", "search", "associate", "update", "manage",
    ]  # fmt: skip
    np.testing.assert_array_equal(world.gauss.x, before[0])
    np.testing.assert_array_equal(world.gauss.P, before[1])
    for record in trace.records:
        assert not record.world.gauss.P.flags.writeable


@pytest.mark.parametrize("kind", ["stacked", "sequential"])
def test_a_perfect_measurement_moves_nothing_and_shrinks_everything(kind: str) -> None:
    world = without_new(identified(camera_world(seed=2, whole=False)))
    policies = replace(world.policies, update=replace(world.policies.update, kind=kind))
    world = replace(world, policies=policies)
    after = run(world, still_frame(seen_from(world))).world
    np.testing.assert_allclose(after.gauss.x, world.gauss.x, atol=1e-6)
    for block in world.gauss.layout.blocks:
        now = np.trace(after.gauss.cov(block.name))
        assert now < np.trace(world.gauss.cov(block.name)), block.name


def test_the_budget_takes_the_largest_scores() -> None:
    world = without_new(identified(camera_world(seed=3, points=8, rays=0, whole=False)))
    selection = replace(world.policies.selection, budget=3)
    world = replace(world, policies=replace(world.policies, selection=selection))
    trace = run(world, still_frame(seen_from(world)))
    p = trace.predictions("eye")[0]
    assert p.selected.sum() == 3
    assert p.score[p.selected].min() >= p.score[~p.selected & (p.fault == 0)].max()
    assert len(trace.associations("eye")) == 3
    for i, label in enumerate(p.labels):
        outcome = trace.outcome("eye", label)
        assert outcome is not None
        if not p.selected[i] and not p.fault[i]:
            assert outcome.verdict == "not selected"
            assert outcome.why == "3 features have a larger score"


@pytest.mark.parametrize("kind", ["stacked", "sequential"])
def test_an_outlier_is_rejected_with_its_distance_and_leaves_no_trace(kind: str) -> None:
    world = without_new(identified(camera_world(seed=4, points=5, rays=0, whole=False)))
    policies = replace(world.policies, update=replace(world.policies.update, kind=kind))
    world = replace(world, policies=policies)
    raw = seen_from(world)
    z = raw.z.copy()
    z[2] += 400.0
    bad = run(world, still_frame(Points(z, raw.ids)))
    label = int(raw.ids[2])
    verdict = next(a for a in bad.associations() if a.label == label)
    assert verdict.verdict == "rejected" and verdict.d2 is not None and verdict.gate is not None
    assert verdict.d2 > verdict.gate and "2 DoF, 99 %" in verdict.why
    keep = np.arange(len(raw.z)) != 2
    without = run(world, still_frame(Points(raw.z[keep], raw.ids[keep])))
    np.testing.assert_allclose(bad.world.gauss.x, without.world.gauss.x, atol=1e-12)
    np.testing.assert_allclose(bad.world.gauss.P, without.world.gauss.P, atol=1e-12)
    assert any(e.kind == "rejected" and e.label == label for e in bad.events)


def test_counters_and_deletion_of_what_is_never_found() -> None:
    world = management(identified(camera_world(seed=5, points=3, rays=0)), min_attempts=4)
    world = without_new(world)
    raw = seen_from(world)
    lost = Points(raw.z[1:], raw.ids[1:])
    events = []
    for i in range(5):
        trace = run(world, still_frame(lost, i))
        events += trace.events
        world = trace.world
    gone = int(raw.ids[0])
    assert gone not in world.features and f"feature:{gone}" not in world.gauss.layout
    assert any(e.kind == "deleted" and "0 of 4 searches" in e.text for e in events)
    assert all(f.matches == f.attempts == 5 for f in world.features.values())


def test_known_features_are_kept_unless_told_otherwise() -> None:
    world = identified(camera_world(seed=5, points=3, rays=0))
    known = {k: replace(f, known=True) for k, f in world.features.items()}
    world = without_new(management(replace(world, features=known), min_attempts=2))
    nothing = Points(np.zeros((0, 2)), np.zeros(0, int))
    for i in range(4):
        world = run(world, still_frame(nothing, i)).world
    assert len(world.features) == 3
    world = management(world, delete_known=True)
    assert not run(world, still_frame(nothing, 4)).world.features


def test_deleting_marginalises() -> None:
    world = camera_world(seed=6)
    less = delete(world, [2])
    for name in ("robot:cam", "feature:1", "feature:5"):
        np.testing.assert_array_equal(less.gauss.cov(name), world.gauss.cov(name))


def test_a_new_feature_is_predicted_where_it_was_seen() -> None:
    """Noiseless lands on truth: h(initialise(z)) = z, and S there is at least R."""
    world = camera_world(seed=7, points=0, rays=0)
    z = np.array([100.0, 80.0])
    world, event = initialise(world, "eye", Detection(z, 7))
    assert event.kind == "born" and world.next_label == 2
    p = predictions(world, "eye")[0]
    np.testing.assert_allclose(p.h[0], z, atol=1e-6)


def test_initialisation_covariance_against_sampling() -> None:
    """P_yy and P_yx of a new feature agree with central differences of the whole construction."""
    world = camera_world(seed=8, points=0, rays=0)
    z = np.array([150.0, 90.0])
    born, _ = initialise(world, "eye", Detection(z, 1))
    n = world.gauss.x.size

    def y_of(x: np.ndarray, pixel: np.ndarray) -> np.ndarray:
        moved = replace(world, gauss=Gaussian(frozen(x), world.gauss.P, world.gauss.layout))
        return initialise(moved, "eye", Detection(pixel, 1))[0].gauss.mean("feature:1")

    J = np.empty((6, n))
    for i in range(n):
        h = 1e-6 * max(1.0, abs(world.gauss.x[i]))
        e = np.zeros(n)
        e[i] = h
        J[:, i] = (y_of(world.gauss.x + e, z) - y_of(world.gauss.x - e, z)) / (2 * h)
    expected = J @ world.gauss.P
    np.testing.assert_allclose(born.gauss.P[n:, :n], expected, rtol=1e-4, atol=1e-6)
    inner = J @ world.gauss.P @ J.T
    extra = born.gauss.cov("feature:1") - inner
    assert np.linalg.eigvalsh(extra).min() > -1e-6
    assert extra[5, 5] == pytest.approx(world.policies.landmark.prior()[1][0, 0], rel=1e-3)


def test_a_click_starts_a_feature_or_says_why_not() -> None:
    world = camera_world(seed=9, points=1, rays=0)
    frame = still_frame(Points(np.zeros((0, 2)), np.zeros(0, int)))
    same, event = initialise_at(world, frame, ToySource(), "eye", (10.0, 10.0))
    assert same is world and "point at a measurement" in event.text
    click = ToySource(clicks=(Detection(np.array([10.0, 10.0]), 9),))
    more, event = initialise_at(world, frame, click, "eye", (10.0, 10.0))
    assert len(more.features) == 2 and event.kind == "born"
    same, event = initialise_at(more, frame, click, "eye", (10.0, 10.0))
    assert same is more and event.text.startswith("no feature started: this is feature 2 already")
    full = management(world, max_features=1)
    same, event = initialise_at(full, frame, click, "eye", (10.0, 10.0))
    assert same is full and "map is full" in event.text


def test_prediction_composes_intervals() -> None:
    """Two intervals in one frame are two frames with one interval each."""
    world = without_new(camera_world(seed=10, points=1, rays=0))
    halves = (Control(0.1), Control(0.2))
    once = run(world, Frame(0, 0.0, 0.3, {"cam": halves}, {})).world
    twice = run(world, Frame(0, 0.0, 0.1, {"cam": halves[:1]}, {})).world
    twice = run(twice, Frame(1, 0.0, 0.2, {"cam": halves[1:]}, {})).world
    np.testing.assert_allclose(once.gauss.x, twice.gauss.x, atol=1e-12)
    np.testing.assert_allclose(once.gauss.P, twice.gauss.P, atol=1e-10)


def test_stacked_update_is_the_dense_textbook_one() -> None:
    world = without_new(identified(camera_world(seed=11, points=4, rays=2)))
    world = replace(
        world,
        policies=replace(world.policies, gate=replace(world.policies.gate, confidence=0.999999)),
    )
    raw = seen_from(world, 0.3)
    trace = run(world, still_frame(raw))
    x, P = world.gauss.x, world.gauss.P
    H, nu, R = [], [], []
    z = dict(zip(raw.ids.tolist(), raw.z, strict=True))
    for p in trace.predictions("eye"):
        for i, label in enumerate(p.labels):
            if trace.associations()[0] is None or not p.selected[i]:
                continue
            row = np.zeros((2, x.size))
            for role, J in p.H.items():
                name = f"feature:{label}" if role == "feature" else role
                row[:, world.gauss.layout[name].slice] = J[i]
            H.append(row)
            nu.append(z[label] - p.h[i])
            R.append(p.R[i])
    Hd, nud = np.concatenate(H), np.concatenate(nu)
    Rd = np.zeros((len(nud),) * 2)
    for i, block in enumerate(R):
        Rd[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = block
    K = P @ Hd.T @ np.linalg.inv(Hd @ P @ Hd.T + Rd)
    expected = x + K @ nud
    after = trace.records[5].world.gauss.x
    points = np.concatenate([world.gauss.layout[f"feature:{i}"].indices for i in range(1, 5)])
    np.testing.assert_allclose(after[points], expected[points], atol=1e-8)
    np.testing.assert_allclose(after[:3], expected[:3], atol=1e-8)


def test_the_numbers_of_the_prediction_add_up() -> None:
    world = camera_world(seed=3)
    controls = {"cam": (Control(0.02), Control(0.05))}
    moved, numbers = predict(world, Frame(1, 0.07, 0.07, controls, {}))
    block = world.gauss.layout["robot:cam"]
    motion = robot_motion(world.robots["cam"], world.gauss.mean("robot:cam"), np.zeros(0),
                          controls["cam"])  # fmt: skip
    FPF = motion.F @ world.gauss.P[block.slice, block.slice] @ motion.F.T
    assert numbers["cam: trace F P F'"] == pytest.approx(np.trace(FPF), rel=1e-9)
    assert numbers["cam: trace G U G' + Q"] == pytest.approx(np.trace(motion.Q), rel=1e-12)
    after = np.trace(moved.gauss.cov("robot:cam"))
    assert numbers["cam: trace P after"] == pytest.approx(after, rel=1e-12)


def test_iterating_a_linear_measurement_changes_nothing() -> None:
    """On a line h is linear, so a second linearisation says what the first one said."""
    experiment = presets.build("line")
    worlds = []
    for kind in ("stacked", "iterated"):
        estimator = params.replace(experiment.estimator, "policies.update.kind", kind)
        world = initial_world(replace(experiment, estimator=estimator))
        state = experiment.source.start()
        for index in range(20):
            frame, state = experiment.source.advance(state, index)
            world = Trace(frame, world, tuple(step(world, frame, experiment.source)), True).world
        worlds.append(world)
    np.testing.assert_allclose(worlds[1].gauss.x, worlds[0].gauss.x, atol=1e-12)
    np.testing.assert_allclose(worlds[1].gauss.P, worlds[0].gauss.P, atol=1e-12)


def test_more_linearisations_converge() -> None:
    world = without_new(identified(camera_world(seed=12, points=6, rays=0, whole=False)))
    ends = []
    for count in (6, 7):
        update = Update("iterated", iterations=count)
        w = replace(world, policies=replace(world.policies, update=update))
        ends.append(run(w, still_frame(seen_from(world, 2.0))).world.gauss.x)
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-6)
