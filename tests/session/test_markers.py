"""Markers in an experiment: built, simulated, saved, edited and refused; and what they are for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scene_core import params
from scene_core.filter.ports import Frame, Points, SourceError
from scene_core.params import ParamError
from scene_core.session.config import Experiment, MarkerSettings
from scene_core.session.edits import with_seed
from scene_core.session.presets_particles import cooperation
from scene_core.session.session import Session
from scene_core.session.start import initial_world
from scene_core.session.swap import reconfigure
from scene_core.session.toml_io import dumps, loads


def with_marker(**changes: Any) -> Experiment:
    e = cooperation()
    lamp = replace(e.estimator.markers["lamp"], **changes)
    return replace(e, estimator=replace(e.estimator, markers={"lamp": lamp}))


def run(experiment: Experiment, frames: int) -> Session:
    session = Session(experiment)
    for _ in range(frames):
        session.advance()
    return session


def _frame(session: Session) -> Frame:
    assert session.trace is not None
    return session.trace.frame


def test_settings_survive_the_file() -> None:
    assert loads(dumps(cooperation())) == cooperation()


def test_the_marker_is_a_plain_point_without_a_block() -> None:
    world = initial_world(cooperation())
    (f,) = world.features.values()
    assert f.carrier == "assistant" and f.appearance == 1000 and f.known
    assert f.model.state_labels == ("z", "x") and f.block == "robot:assistant"
    assert [b.name for b in world.gauss.layout.blocks] == ["robot:guide", "robot:assistant"]


def test_it_is_measured_where_it_is_and_only_by_others() -> None:
    session = run(cooperation(), 2)
    frame = _frame(session)
    raw = frame.raw["scanner"]
    assert isinstance(raw, Points) and raw.ids is not None and frame.truth is not None
    (row,) = np.flatnonzero(raw.ids == 1000)
    guide, assistant = frame.truth.xp["guide"], frame.truth.xp["assistant"]
    lamp = assistant[:2] + 0.2 * np.array([np.cos(assistant[2]), np.sin(assistant[2])])
    assert raw.z[row, 0] == pytest.approx(np.hypot(*(lamp - guide[:2])), abs=0.25)
    assert 1000 not in frame.truth.ids
    carried = params.put(session.experiment, "source.mounts.scanner.robot", "assistant")
    blind = run(params.put(carried, "estimator.mounts.scanner.robot", "guide"), 2)
    seen = _frame(blind).raw["scanner"]
    assert isinstance(seen, Points) and seen.ids is not None and 1000 not in seen.ids


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"robot": "nobody"}, "estimator.markers.lamp.robot = 'nobody': there is no such robot"),
        ({"robot": "guide"}, "no other robot has a sensor that measures 2-D points"),
        ({"position": (1.0,)}, "give 2 finite numbers"),
        ({"position": (1.0, 2.0, 3.0)}, "no other robot has a sensor that measures 3-D points"),
    ],
)
def test_a_marker_that_makes_no_sense_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ParamError, match=words):
        initial_world(with_marker(**changes))


def test_an_identity_belongs_to_one_thing() -> None:
    e = cooperation()
    twice = {**e.estimator.markers, "other": MarkerSettings("assistant", (0.0, 0.1), 1000)}
    with pytest.raises(ParamError, match="another marker or landmark has it already"):
        initial_world(replace(e, estimator=replace(e.estimator, markers=twice)))
    with pytest.raises(SourceError, match=r"identity = 3: another marker or landmark"):
        params.replace(e, "source.markers.lamp.identity", 3).source.start()


def test_moving_it_acts_at_once_and_adding_one_does_not() -> None:
    e = cooperation()
    world = run(e, 3).world
    moved = with_marker(position=(0.5, 0.1)).estimator
    after = reconfigure(world, e.estimator, moved).world
    np.testing.assert_array_equal(after.features[1].offset, [0.5, 0.1])
    with pytest.raises(ParamError, match="markers can not be added"):
        reconfigure(world, e.estimator, replace(e.estimator, markers={}))


def blind_error(experiment: Experiment, frames: int) -> tuple[float, float]:
    """Largest position error of the assistant, and the sd of its position at the end."""
    session = run(experiment, frames)
    r = session.metrics.series().robots["assistant"]
    assert r.error is not None
    return float(np.abs(r.error[:, :2]).max()), float(np.linalg.norm(r.sd[-1, :2]))


def test_a_blind_robot_is_kept_on_its_way_by_being_seen() -> None:
    """Never out of sight, with odometry three times as bad as in the scenario."""
    seen = cooperation()
    for side in ("source", "estimator"):
        seen = params.replace(seen, f"{side}.mounts.scanner.sensor.reach_max", 12.0)
        seen = params.replace(seen, f"{side}.robots.assistant.motion.rot_per_metre", 0.15)
    seen = params.replace(params.replace(seen, "source.world.rows", 3), "source.world.columns", 3)
    alone = replace(
        seen,
        estimator=replace(seen.estimator, markers={}),
        source=replace(seen.source, markers={}),  # type: ignore[type-var]
    )
    error, sd = blind_error(seen, 250)
    _, sd_alone = blind_error(alone, 250)
    assert error < 0.15 and sd < 0.05
    assert sd_alone > 10.0 * sd


def test_both_robots_are_consistent() -> None:
    values: dict[str, list[float]] = {"guide": [], "assistant": []}
    for seed in range(3):
        session = run(with_seed(replace(cooperation(), seed=seed), seed), 200)
        for name, r in session.metrics.series().robots.items():
            assert r.nees is not None
            values[name].append(float(np.nanmean(r.nees[1:])))
    for name, nees in values.items():
        assert 0.8 < np.mean(nees) < 6.5, (name, nees)
