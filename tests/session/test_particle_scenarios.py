"""What the scenarios with particles show: rings, arcs, a turn; clouds that become points."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import numpy as np

from scene_core import params
from scene_core.models.features.anchored_homogeneous import AnchoredHomogeneous
from scene_core.session.config import Experiment
from scene_core.session.landmarks import landmark_errors
from scene_core.session.presets_particles import particles, ranges
from scene_core.session.session import Session
from scene_core.sources.drivers import Waypoints
from scene_core.sources.simulated import Simulation
from scene_core.sources.worlds import Field


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


def straight() -> Experiment:
    """The robot of the ranges goes straight on for 24 m, between two rows of beacons."""
    start = {"z": 0.4, "x": 20.0, "phi": -math.pi / 2}
    experiment = params.put(ranges(), "source.world", Field(rows=2, columns=18, step=2.4))
    simulation, estimator = experiment.source, experiment.estimator
    assert isinstance(simulation, Simulation)
    true = replace(simulation.robots["robot"], driver=Waypoints(((0.4, -100.0),)), start=start)
    believed = replace(estimator.robots["robot"], start=start)
    return replace(
        experiment,
        source=replace(simulation, robots={"robot": true}),
        estimator=replace(estimator, robots={"robot": believed}),
    )


def test_on_a_straight_way_no_ring_settles_however_long_it_is() -> None:
    session = Session(straight())
    kinds = advanced(session, 400)
    assert kinds["born"] == 8 and kinds["converted"] == 0
    rings = [f for f in session.world.features.values() if f.particles is not None]
    assert len(rings) == 8
    for f in rings:
        assert f.particles is not None
        at = f.model.point(session.world.gauss.mean(f.block), f.particles.lam).X
        # Both mirror images are alive after up to 200 matches.
        assert (at[:, 0] > 0.4).any() and (at[:, 0] < 0.4).any()
        assert f.matches == f.updates > 30


def test_clouds_become_points_that_are_where_they_should_be() -> None:
    session = Session(particles())
    kinds = advanced(session, 120)
    settled = [
        f
        for f in session.world.features.values()
        if f.model.successor() is None or isinstance(f.model, AnchoredHomogeneous)
    ]
    assert len(settled) >= 25 and kinds["deleted"] <= 2
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
