"""Robots that are one model: errors of each of them, and markers on one that the other sees."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scene_core import params
from scene_core.filter.expect import predictions
from scene_core.filter.gaussian import dense
from scene_core.filter.groups import groups
from scene_core.filter.observe import observe, rows, sensor_state
from scene_core.filter.ports import Points, SourceError
from scene_core.filter.world import Gaussian, World
from scene_core.geometry.ellipses import chi2_band
from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import TWO_D
from scene_core.params import ParamError
from scene_core.session import study
from scene_core.session.commands import SwapModel
from scene_core.session.config import Experiment
from scene_core.session.presets_particles import cooperation, pair
from scene_core.session.session import Session
from scene_core.session.start import initial_world
from scene_core.session.swap import reconfigure
from scene_core.session.true_motion import with_true_motion

MOTION = "estimator.robots.pair.motion"


@pytest.fixture(scope="module")
def ran() -> Session:
    session = Session(pair())
    for _ in range(40):
        session.advance()
    return session


def test_every_body_has_its_errors_and_its_nees(ran: Session) -> None:
    assert ran.trace is not None and ran.trace.frame.truth is not None
    world, truth, series = ran.world, ran.trace.frame.truth, ran.metrics.series().robots
    assert list(series) == ["pair", "pair second"]
    P, xv = world.gauss.cov("robot:pair"), world.gauss.mean("robot:pair")
    for name, body, own in (("pair", "base", [0, 1, 3]), ("pair second", "second", [4, 5, 7])):
        true, r = truth.at("pair", body), series[name]
        assert true is not None and r.error is not None and r.nees is not None
        e = xv[own] - true
        assert np.linalg.norm(r.error[-1, :2]) == pytest.approx(np.linalg.norm(e[:2]))
        assert r.error[-1, 2] == pytest.approx(e[2])
        assert r.nees[-1] == pytest.approx(e @ np.linalg.solve(P[np.ix_(own, own)], e))
        np.testing.assert_allclose(r.position[-1, [2, 0]], xv[own[:2]])


def test_both_are_as_wrong_as_they_believe() -> None:
    result = study.study(pair(), range(2), 150)
    assert result.robots == ("pair", "pair second")
    for body in result.robots:
        lo, hi = chi2_band(3, 2, 0.999)
        assert lo <= result.nees(body) <= hi


def test_the_light_is_that_of_the_robot_that_is_least_consistent(ran: Session) -> None:
    calm = ran.metrics.light()
    assert calm.state == "consistent" and calm.text.startswith("NEES of pair ")
    sure = params.put(pair(), f"{MOTION}.second.sd_steer", 0.0)
    sure = params.put(sure, f"{MOTION}.second.sd_v", 0.001)
    session = Session(sure)
    for _ in range(40):
        session.advance()
    light = session.metrics.light()
    assert light.state == "overconfident" and light.text.startswith("NEES of pair second ")
    assert " above " in light.text


def test_the_second_is_known_again_when_it_is_seen_again() -> None:
    session = Session(pair())
    for _ in range(190):
        session.advance()
    sd = np.linalg.norm(session.metrics.series().robots["pair second"].sd[:, :2], axis=1)
    alone, met = sd[140:160].max(), sd[170:].min()
    assert alone > 0.15 and met < 0.05
    gauss = session.world.gauss
    assert np.abs(gauss.cov("robot:pair")[:2, 4:6]).max() > 1e-6, "what one knows, both know"


def test_a_body_that_is_swapped_away_leaves_and_comes_back() -> None:
    base = pair()
    single = replace(base, estimator=replace(base.estimator, markers={}))
    session = Session(replace(single, source=replace(single.source, markers={})))  # type: ignore[type-var]
    for model in ("double", "planar nomad", "double"):
        if model != session.world.robots["pair"].motion.name:
            session.apply(SwapModel(MOTION, model))
        for _ in range(4):
            session.advance()
        names = ["pair"] if model == "planar nomad" else ["pair", "pair second"]
        assert list(session.metrics.series().robots) == names
    r = session.metrics.series().robots["pair second"]
    known = np.isfinite(r.sd).all(axis=1)
    assert len(r.sd) == 12 and known.tolist() == [True] * 4 + [False] * 4 + [True] * 4


def test_no_robot_is_called_like_a_body_of_another() -> None:
    e: Any = pair()
    double = e.estimator.robots["pair"]
    one = replace(double, motion=double.motion.first, start={})
    both = {"pair": double, "pair second": one}
    words = "estimator.robots.pair second: a body of another robot is called 'pair second'"
    with pytest.raises(ParamError, match=words):
        initial_world(replace(e, estimator=replace(e.estimator, robots=both)))
    two = {"pair": one, "pair second": one}
    alone = replace(e.estimator, robots=two, markers={})
    world = initial_world(replace(e, estimator=alone))
    with pytest.raises(ParamError, match=words):
        reconfigure(world, alone, replace(alone, robots=both))


def h_of(x: np.ndarray) -> np.ndarray:
    """Range and bearing of the lamp from the first robot, written out for the pair's state."""
    z, xx = x[4] + 0.2 * np.cos(x[7]) - x[0], x[5] + 0.2 * np.sin(x[7]) - x[1]
    return np.array([np.hypot(z, xx), np.arctan2(xx, z) - x[3]])


def world_of_two() -> World:
    """The pair at the start, with a full covariance."""
    world = initial_world(pair())
    A = 0.05 * np.random.default_rng(0).standard_normal((8, 8))
    return replace(world, gauss=Gaussian(world.gauss.x, A @ A.T, world.gauss.layout))


def test_h_of_a_marker_on_the_other_robot_of_one_model_is_by_both() -> None:
    world = world_of_two()
    x, at = world.gauss.x, sensor_state(world, "scanner")
    seen = observe(at, groups(world)[0], x)
    np.testing.assert_allclose(TWO_D.position(seen.h[0]), h_of(x), atol=1e-12)
    H = dense([rows(at, seen)], x.size)
    numeric = central_differences(h_of, (x,), 0)
    np.testing.assert_allclose(H, numeric, atol=1e-7)
    (p,) = predictions(world, "scanner")
    np.testing.assert_allclose(p.E[0], numeric @ world.gauss.P @ numeric.T, atol=1e-7)


def test_nobody_looks_for_a_marker_at_its_own_hook() -> None:
    world = world_of_two()
    scanner = replace(world.mounts["scanner"], hook="second")
    assert predictions(replace(world, mounts={"scanner": scanner}), "scanner") == ()
    frame, _ = pair().source.advance(pair().source.start(), 0)
    blind = params.put(pair(), "source.mounts.scanner.hook", "second").source
    raw, none = frame.raw["scanner"], blind.advance(blind.start(), 0)[0].raw["scanner"]
    assert isinstance(raw, Points) and isinstance(none, Points)
    assert raw.ids is not None and 1000 in raw.ids
    assert none.ids is not None and 1000 not in none.ids


def on_hook(side: str, hook: str) -> Experiment:
    e: Any = cooperation()
    half = getattr(e, side)
    lamp = replace(half.markers["lamp"], hook=hook)
    return replace(e, **{side: replace(half, markers={"lamp": lamp})})


def test_a_hook_that_is_not_there_is_named() -> None:
    words = r"markers\.lamp\.hook = 'roof': 'planar odometry' has the hooks base"
    with pytest.raises(ParamError, match=words):
        initial_world(on_hook("estimator", "roof"))
    with pytest.raises(SourceError, match=words):
        on_hook("source", "roof").source.start()


def test_a_model_without_the_hook_of_a_marker_is_refused() -> None:
    e: Any = pair()
    motion = e.estimator.robots["pair"].motion.first
    one = params.put(e, MOTION, motion)
    with pytest.raises(ParamError, match="marker 'lamp' is at the hook 'second', which 'planar n"):
        reconfigure(initial_world(e), e.estimator, one.estimator)
    with pytest.raises(ParamError, match="true marker 'lamp' is at the hook 'second'"):
        driven = params.put(e, "source.robots.pair.driver.controls", {"v": 0.3})
        with_true_motion(driven, driven, "pair", motion)
