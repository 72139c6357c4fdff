"""From the records of a frame to what is drawn: states, strings along rays, counts."""

from dataclasses import replace

import numpy as np
import pytest

from scene_core.models.base import Fault
from tests.web.traces import MOUNT, accepted, cloister, judged, predicted, published, record, until
from web_panels.marks import half_width, outcome, scene_of


def marks(trace, selected=None):
    scene = scene_of(published(trace, selected=selected), MOUNT)
    assert scene is not None
    return scene


def test_every_state_is_the_verdicts():
    label = accepted(cloister()).label
    for verdict, key in (
        ("accepted", "accepted"),
        ("rejected", "rejected"),
        ("no match", "nomatch"),
    ):
        mark = outcome(marks(judged(cloister(), label, verdict=verdict)).marks, label)
        assert mark is not None and mark.state == key


@pytest.mark.parametrize("fault", [Fault.BEHIND, Fault.OUTSIDE])
def test_what_is_not_in_view_is_not_drawn(fault):
    label = accepted(cloister()).label
    assert outcome(marks(predicted(cloister(), label, fault=fault)).marks, label) is None


def test_what_is_in_view_but_not_measurable_is_drawn_as_such():
    label = accepted(cloister()).label
    mark = outcome(marks(predicted(cloister(), label, fault=Fault.ANGLE)).marks, label)
    assert mark is not None and mark.state == "out"


def test_numbers_are_those_of_the_records():
    trace = cloister()
    for p in trace.predictions(MOUNT):
        for mark in marks(trace).marks:
            if mark.label in p.row and mark.S is not None:
                i = p.row[mark.label]
                np.testing.assert_array_equal(mark.h, p.h[i])
                np.testing.assert_array_equal(mark.S, p.S[i])


def test_a_half_done_frame_shows_what_is_known_so_far():
    label = accepted(cloister()).label
    assert marks(until(cloister(), "predict")).marks == ()
    chosen = outcome(marks(until(cloister(), "select")).marks, label)
    assert chosen is not None and chosen.state == "ink" and chosen.z is None
    found = outcome(marks(until(cloister(), "search")).marks, label)
    assert found is not None and found.state == "ink" and found.z is not None
    judged_now = outcome(marks(until(cloister(), "associate")).marks, label)
    assert judged_now is not None and judged_now.state == "accepted"


def test_a_born_feature_is_marked_where_it_was_seen():
    trace = cloister()
    label = max(trace.world.features)
    start = {k: f for k, f in trace.start.features.items() if k != label}
    mark = outcome(
        marks(
            replace(
                predicted(trace, label, fault=Fault.BEHIND),
                start=replace(trace.start, features=start),
            )
        ).marks,
        label,
    )
    assert mark is not None and mark.state == "partial"
    np.testing.assert_array_equal(mark.h, trace.world.features[label].z0)


def test_the_string_along_a_ray_is_the_conditional_distribution():
    """Averaged over the free component again, the string gives back h and S."""
    trace = cloister()
    seen = record(trace, "select")
    strings = [m for m in marks(trace).marks if m.string is not None]
    assert strings
    for m in strings:
        f = seen.world.features[m.label]
        i = f.model.state_labels.index("rho")
        sd = np.sqrt(seen.world.gauss.cov(f.block)[i, i])
        rho = seen.world.gauss.mean(f.block)[i]
        low = max(-2.0, -rho / sd)
        assert m.string is not None and m.S is not None
        slope = (m.string.h[-1] - m.string.h[0]) / (2.0 - low)
        np.testing.assert_allclose(m.string.S + np.outer(slope, slope), m.S, rtol=1e-6)
        np.testing.assert_allclose(m.string.h[0] - low * slope, m.h, rtol=1e-6)


def test_counts_are_of_what_is_drawn():
    scene = marks(cloister())
    assert scene.counts["accepted"] == sum(m.state == "accepted" for m in scene.marks)
    assert scene.counts["partial"] == sum(m.partial for m in scene.marks)


def test_ellipses_have_the_width_of_the_search_or_of_the_gate():
    world = cloister().world
    assert half_width(world, MOUNT) == pytest.approx(3.0, abs=1e-3)
    policies = world.policies
    searching = replace(policies.association, kind="search", search_sigma=2.5)
    other = replace(world, policies=replace(policies, association=searching))
    assert half_width(other, MOUNT) == 2.5


def test_nothing_is_drawn_before_the_first_frame_or_for_a_sensor_that_is_gone():
    assert scene_of(published(None), MOUNT) is None
    assert scene_of(published(cloister()), "lidar") is None
