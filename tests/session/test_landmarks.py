"""Errors of mapped landmarks: of those that are finished, were not given, and have a truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scene_core.filter.ports import Truth
from scene_core.session import presets
from scene_core.session.landmarks import landmark_errors
from scene_core.session.session import Session


def test_the_errors_are_distances_by_identity() -> None:
    session = Session(presets.build("nomad"))
    for _ in range(2):
        session.advance()
    trace = session.advance()
    world = session.world
    first, *others = world.features.values()
    at = world.gauss.mean(first.block)
    truth = Truth({}, {}, (at + np.array([3.0, 4.0]))[None], np.array([first.appearance]))
    np.testing.assert_allclose(landmark_errors(world, truth), [5.0])
    given = replace(world, features={first.label: replace(first, known=True)})
    assert len(landmark_errors(given, truth)) == 0
    assert len(others) > 1 and len(landmark_errors(world, trace.frame.truth)) == len(others) + 1
    assert len(landmark_errors(world, None)) == 0


def test_rays_are_not_counted_before_they_have_become_points() -> None:
    session = Session(presets.build("cloister"))
    for _ in range(29):
        session.advance()
    trace = session.advance()
    finished = [f for f in session.world.features.values() if f.model.successor() is None]
    assert 0 < len(finished) < len(session.world.features)
    assert len(landmark_errors(session.world, trace.frame.truth)) == len(finished)
