"""What the scenarios with particles show: rings, arcs, a turn; clouds that become points."""

from __future__ import annotations

from collections import Counter

import numpy as np

from scene_core.session.landmarks import landmark_errors
from scene_core.session.presets_particles import particles, ranges
from scene_core.session.session import Session


def advanced(session: Session, frames: int) -> Counter[str]:
    """Events by kind of the next frames."""
    kinds: Counter[str] = Counter()
    for _ in range(frames):
        session.advance()
        assert session.trace is not None
        kinds.update(e.kind for e in session.trace.events)
    return kinds


def sides(session: Session) -> list[set[bool]]:
    """Of every ring, on which sides of the robot's first way, along x at z = 3, it still is."""
    world, out = session.world, []
    for f in world.features.values():
        if f.particles is not None:
            at = f.model.point(world.gauss.mean(f.block), f.particles.lam).X
            out.append({bool(side) for side in at[:, 0] > 3.0})
    return out


def test_a_range_has_two_sides_until_the_robot_turns() -> None:
    session = Session(ranges())
    before = advanced(session, 70)
    two = [len(s) == 2 for s in sides(session)]
    assert len(two) >= 6 and np.mean(two) > 0.7
    after = advanced(session, 110)
    assert before["converted"] <= 1 and after["converted"] >= 6
    errors = landmark_errors(session.world, session.trace.frame.truth if session.trace else None)
    assert len(errors) >= 6 and np.median(errors) < 0.15 and errors.max() < 0.6


def test_clouds_become_points_that_are_where_they_should_be() -> None:
    session = Session(particles())
    kinds = advanced(session, 120)
    assert kinds["converted"] >= 25 and kinds["deleted"] <= 2
    world, trace = session.world, session.trace
    assert trace is not None and trace.frame.truth is not None
    errors = landmark_errors(world, trace.frame.truth)
    sd = [
        float(np.sqrt(np.trace(world.gauss.cov(f.block))))
        for f in world.features.values()
        if f.model.successor() is None
    ]
    assert len(errors) == len(sd)
    assert np.mean((errors / sd) ** 2) < 3.0
