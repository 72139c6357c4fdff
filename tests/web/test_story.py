"""The words about a feature: every way through a frame has its sentence and its remedy."""

from dataclasses import replace

import numpy as np
import pytest

from scene_core.filter.policies import Management, Selection, Vision
from scene_core.filter.records import Event
from scene_core.models.base import FAULT_WORDS, Fault
from scene_core.params import schema
from tests.web.traces import (
    MOUNT,
    accepted,
    associating,
    changed,
    cloister,
    judged,
    pictured,
    predicted,
    record,
    searched,
    until,
)
from web_panels import story as story_module
from web_panels.phase_card import card_html
from web_panels.story import interesting, place, story
from web_panels.style import escape


@pytest.mark.parametrize("fault", list(FAULT_WORDS))
def test_every_fault_is_named_with_what_lets_the_feature_be_measured_again(fault):
    label = accepted(cloister()).label
    told = story(predicted(cloister(), label, fault=fault), MOUNT, label)
    assert told.state == "out"
    assert FAULT_WORDS[fault] in told.text
    assert "measured again" in told.text


def test_two_faults_are_both_named():
    label = accepted(cloister()).label
    told = story(predicted(cloister(), label, fault=Fault.SCALE | Fault.ANGLE), MOUNT, label)
    assert "distance" in told.text and "direction" in told.text
    assert told.chip == "not measurable"


def test_accepted_says_where_how_far_and_against_which_gate():
    a = accepted(cloister())
    told = story(cloister(), MOUNT, a.label)
    assert (told.state, told.chip) == ("accepted", "accepted")
    assert a.d2 is not None and a.gate is not None
    assert f"d2 = {a.d2:.1f} &lt; {a.gate:.2f} (2 DoF, 98.89 %)" in told.text
    assert place(cloister().world.mounts[MOUNT].sensor, a.h) in told.text
    assert f"{a.d2**0.5:.1f} sigma" in told.text


def test_rejected_is_left_out_and_can_be_redone():
    a = accepted(cloister())
    told = story(judged(cloister(), a.label, verdict="rejected", d2=12.44), MOUNT, a.label)
    assert told.state == "rejected"
    assert "d2 = 12.4 &gt; 9.00" in told.text
    assert "<kbd>R</kbd>" in told.text and "left out" in told.text
    assert "repeated" not in told.text


def test_a_match_rejected_by_the_others_is_not_said_to_be_outside_its_own_gate():
    a = accepted(cloister())
    why = "disagrees with the other matches: d2 = 31.0 > 9.21 given them"
    trace = judged(cloister(), a.label, verdict="rejected", d2=1.5, why=why)
    told = story(trace, MOUNT, a.label)
    assert told.state == "rejected"
    assert "d2 = 1.5 &lt; 9.00" in told.text and escape(why) in told.text
    assert ", so it is left out" not in told.text
    assert escape(why) in card_html(until(trace, "update"))


@pytest.mark.parametrize(("runner_up", "suspicious"), [(0.88, True), (0.5, False), (None, False)])
def test_a_rejected_match_with_an_equal_rival_looks_like_repeated_texture(runner_up, suspicious):
    label = accepted(cloister()).label
    trace = searched(
        pictured(cloister()), label, score=0.9, runner_up=runner_up, positions=40, threshold=0.8
    )
    told = story(judged(trace, label, verdict="rejected", d2=20.0), MOUNT, label)
    assert ("repeated texture" in told.text) is suspicious
    assert "40 positions" in told.text and "0.90" in told.text and "0.80" in told.text


@pytest.mark.parametrize(("positions", "words"), [(1, "1 position:"), (2, "2 positions:")])
def test_positions_are_counted_in_words(positions, words):
    label = accepted(cloister()).label
    told = story(searched(pictured(cloister()), label, positions=positions), MOUNT, label)
    assert f"Searched at {words}" in told.text


@pytest.mark.parametrize(
    ("kind", "positions", "words"),
    [
        ("identity", 1, "Recognised by its identity"),
        ("search", 1, "The only measurement in its gate"),
        ("search", 3, "Of 3 measurements in its gate, the nearest"),
    ],
)
def test_a_matched_point_is_told_without_a_correlation(kind, positions, words):
    label = accepted(cloister()).label
    trace = searched(associating(cloister(), kind), label, positions=positions)
    told = story(trace, MOUNT, label)
    assert words in told.text and "NCC" not in told.text


@pytest.mark.parametrize("ratio", [0.5, 0.0])
def test_no_match_gives_the_reason_and_when_it_will_be_forgotten(ratio):
    label = accepted(cloister()).label
    trace = searched(pictured(cloister()), label, z=None, score=0.61, positions=212, threshold=0.8)
    trace = judged(
        trace, label, verdict="no match", z=None, nu=None, d2=None, why="best NCC below 0.80"
    )
    policies = replace(trace.world.policies, management=Management(min_match_ratio=ratio))
    last = replace(trace.records[-1], world=replace(trace.world, policies=policies))
    told = story(replace(trace, records=(*trace.records[:-1], last)), MOUNT, label)
    assert told.state == "nomatch"
    assert "212 positions" in told.text and "best NCC below 0.80" in told.text
    assert ("forgotten when fewer than" in told.text) == (ratio > 0)


def test_not_selected_gives_rank_and_budget():
    trace = cloister()
    label = next(
        k
        for p in trace.predictions(MOUNT)
        for k, fault, chosen in zip(p.labels, p.fault, p.selected, strict=True)
        if not fault and not chosen
    )
    told = story(trace, MOUNT, label)
    assert told.state == "unselected"
    measurable = int(record(trace, "select").numbers["measurable"])
    assert f"of {measurable}" in told.text and "10 are measured" in told.text


def test_a_match_known_to_be_wrong_is_said_to_be_so():
    label = accepted(cloister()).label
    assert "the match is wrong" in story(judged(cloister(), label, wrong=True), MOUNT, label).text
    assert "the match is right" in story(judged(cloister(), label, wrong=False), MOUNT, label).text


@pytest.mark.parametrize(
    ("phase", "words"),
    [("predict", "Not predicted"), ("select", "searched next"), ("search", "meets the gate next")],
)
def test_a_frame_stopped_half_way_says_what_comes_next(phase, words):
    label = accepted(cloister()).label
    told = story(until(cloister(), phase), MOUNT, label)
    assert words in told.text
    assert "<kbd>P</kbd>" in told.text


def test_a_new_feature_is_measured_from_the_next_frame_on():
    trace = cloister()
    label = max(trace.world.features)
    start = {k: f for k, f in trace.start.features.items() if k != label}
    trace = replace(trace, start=replace(trace.start, features=start))
    told = story(trace, MOUNT, label)
    assert told.state == "partial" and "Started in this frame" in told.text


@pytest.mark.parametrize("kind", ["converted", "deleted"])
def test_what_management_did_is_added(kind):
    label = accepted(cloister()).label
    event = Event(12, kind, f"{label} <i>because</i>", label)
    told = story(changed(cloister(), "manage", events=(event,)), MOUNT, label)
    assert "&lt;i&gt;because&lt;/i&gt;" in told.text
    assert (told.chip == "deleted") is (kind == "deleted")


def test_a_mount_that_did_not_fire_and_a_feature_that_is_not_there():
    trace = cloister()
    silent = replace(trace, frame=replace(trace.frame, raw={}))
    assert "gave no data" in story(silent, MOUNT, accepted(trace).label).text
    assert "no feature 999" in story(trace, MOUNT, 999).text


def test_parameters_named_in_the_words_exist():
    labels = {s.label for part in (Selection(), Management(), Vision()) for s in schema(part)}
    source = open(story_module.__file__, encoding="utf8").read()
    for word in ("Select, max", "Search, max"):
        assert f"'{word}'" in source
        assert word in labels


def test_the_interesting_feature_is_rejected_then_missed_then_farthest():
    trace = cloister()
    labels = [a.label for a in trace.associations() if a.verdict == "accepted"]
    farthest = max((a for a in trace.associations() if a.d2 is not None), key=lambda a: a.d2 or 0)
    assert interesting(trace) == farthest.label
    missed = judged(trace, labels[3], verdict="no match")
    assert interesting(missed) == labels[3]
    assert interesting(judged(missed, labels[5], verdict="rejected")) == labels[5]


def test_places_have_units_and_angles_are_in_degrees():
    from scene_core.models.sensors.range_bearing import RangeBearing

    assert place(RangeBearing(), np.array([3.25, np.pi / 6])) == "r 3.250 m, b 30.0°"
    sensor = cloister().world.mounts[MOUNT].sensor
    assert place(sensor, np.array([-20.0, 8.04]), plus=True) == "(−20.0, +8.0) px"
