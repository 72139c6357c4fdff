"""Frames for the panels' tests: a real run, and variations of its last frame."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any, Literal, cast

import numpy as np

from scene_core.filter.ports import Image, Match
from scene_core.filter.records import Association, Phase, PhaseRecord, Predictions, Trace
from scene_core.models.base import Fault
from scene_core.session.presets import PRESETS
from scene_core.session.published import Published
from scene_core.session.session import Session

MOUNT = "camera"


@cache
def cloister() -> Trace:
    """The thirteenth frame of the toolbox's experiment."""
    make = PRESETS["cloister"].make
    assert make is not None
    session = Session(make())
    for _ in range(13):
        session.advance()
    assert session.trace is not None
    return session.trace


def record(trace: Trace, phase: Phase) -> PhaseRecord:
    return next(r for r in trace.records if r.phase == phase)


def changed(trace: Trace, phase: Phase, **fields: Any) -> Trace:
    """The trace with one phase's record changed."""
    records = tuple(replace(r, **fields) if r.phase == phase else r for r in trace.records)
    return replace(trace, records=records)


def until(trace: Trace, phase: Phase) -> Trace:
    """The trace stopped after a phase."""
    end = [r.phase for r in trace.records].index(phase) + 1
    return replace(trace, records=trace.records[:end], complete=False)


def accepted(trace: Trace) -> Association:
    """Some accepted association."""
    return next(a for a in trace.associations() if a.verdict == "accepted")


def judged(trace: Trace, label: int, **fields: Any) -> Trace:
    """The trace with another outcome for a feature."""
    done = tuple(replace(a, **fields) if a.label == label else a for a in trace.associations())
    return changed(changed(trace, "associate", associations=done), "update", associations=done)


def searched(trace: Trace, label: int, **fields: Any) -> Trace:
    """The trace with another answer of the search for a feature."""
    found: tuple[Match, ...] = tuple(
        replace(m, **fields) if m.label == label else m for m in record(trace, "search").matches
    )
    return changed(trace, "search", matches=found)


def pictured(trace: Trace) -> Trace:
    """The trace as if its sensor had sent an image."""
    raw = {MOUNT: Image(np.zeros((480, 640), np.uint8))}
    return replace(trace, frame=replace(trace.frame, raw=raw))


def associating(trace: Trace, kind: Literal["identity", "search"]) -> Trace:
    """The trace of an estimator with another association."""
    policies = trace.world.policies
    policies = replace(policies, association=replace(policies.association, kind=kind))
    world = replace(trace.world, policies=policies)
    return changed(trace, trace.records[-1].phase, world=world)


def predicted(trace: Trace, label: int, fault: Fault | None = None, selected: bool = True) -> Trace:
    """The trace with a feature not measurable, or not selected."""
    out: list[Predictions] = []
    for p in record(trace, "select").predictions:
        if label in p.row:
            faults, chosen = np.array(p.fault), np.array(p.selected)
            faults[p.row[label]] = 0 if fault is None else int(fault)
            chosen[p.row[label]] = selected
            p = replace(p, fault=faults, selected=chosen)
        out.append(p)
    return changed(trace, "select", predictions=tuple(out))


def published(trace: Trace | None, **fields: Any) -> Published:
    """What panels read of a published state."""
    usual = dict(trace=trace, selected=None, mode="paused", run=1, seq=1)
    return cast(Published, SimpleNamespace(**{**usual, **fields}))
