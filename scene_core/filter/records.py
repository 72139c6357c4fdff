"""What a frame leaves behind: every number and every decision, with its reason.

These are the filter's own values. The page draws them and computes none of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.ports import Frame, Match
from scene_core.filter.world import Label, World
from scene_core.models.base import Shape, words

Phase = Literal["predict", "internal", "select", "search", "associate", "update", "manage"]
Verdict = Literal["accepted", "rejected", "no match", "not selected"]


@dataclass(frozen=True)
class Predictions:
    """Predicted measurements of all features of one model by one mount; rows follow `labels`."""

    mount: str
    model: str
    labels: tuple[Label, ...]
    h: Vec
    """(N, m)"""
    H: Mapping[str, Mat]
    """Jacobian (N, m, size) by role: a block name of the state, or "feature" for each one's own."""
    E: Mat
    """H P H' (N, m, m)"""
    R: Mat
    """Measurement noise (N, m, m); S = E + R."""
    fault: np.ndarray
    """Fault flags (N,); zero: measurable."""
    score: Vec
    """Selection score (N,)."""
    selected: np.ndarray
    """(N,) bool."""
    shape: Shape = "point"
    """Of segments h (N, 3) is the normal of the plane through line and sensor, H its Jacobian, and
    E, R (N, 2, 2) are those of the distances of both expected ends from it."""
    ends: Vec | None = None
    """Where both ends of a segment are expected (N, 4)."""
    particles: tuple[Vec, Vec] | None = None
    """Of partial features: the prediction (N, K, m) and the weight (N, K) of every particle; h, E
    and R are then those of the mixture, and H that of the heaviest particle."""

    @property
    def S(self) -> Mat:
        return self.E + self.R

    @cached_property
    def row(self) -> Mapping[Label, int]:
        """Row of a label."""
        return {label: i for i, label in enumerate(self.labels)}


@dataclass(frozen=True)
class Association:
    """One feature's outcome in one frame, by one mount."""

    mount: str
    label: Label
    verdict: Verdict
    h: Vec
    S: Mat
    z: Vec | None = None
    nu: Vec | None = None
    d2: float | None = None
    gate: float | None = None
    """The value d2 was held against: chi2 quantile of (dof, confidence)."""
    dof: int = 0
    confidence: float = 0.0
    score: float | None = None
    runner_up: float | None = None
    why: str = ""
    """The reason in words."""
    wrong: bool | None = None
    """In simulation: the match is not the landmark it was taken for."""


@dataclass(frozen=True)
class InternalUpdate:
    """An internal measurement and its gate."""

    instrument: str
    hv: Vec
    zv: Vec
    nu: Vec
    S: Mat
    d2: float
    gate: float
    accepted: bool
    why: str = ""


@dataclass(frozen=True)
class Event:
    """Something worth a line: born, converted, deleted, rejected, refused."""

    frame: int
    kind: Literal["born", "converted", "deleted", "rejected", "no match", "swap", "error", "info"]
    text: str
    label: Label | None = None


@dataclass(frozen=True)
class PhaseRecord:
    """One phase: the world after it, and everything it decided."""

    phase: Phase
    mount: str | None
    world: World
    ms: float
    predictions: tuple[Predictions, ...] = ()
    matches: tuple[Match, ...] = ()
    associations: tuple[Association, ...] = ()
    internals: tuple[InternalUpdate, ...] = ()
    events: tuple[Event, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)
    """Numbers of the phase's equation, for the page's step-by-phase card."""


@dataclass(frozen=True)
class Trace:
    """A frame and what came of it: all phases, or those up to where it was stopped."""

    frame: Frame
    start: World
    """State before the frame."""
    records: tuple[PhaseRecord, ...]
    complete: bool

    @property
    def world(self) -> World:
        return self.records[-1].world if self.records else self.start

    def predictions(self, mount: str) -> tuple[Predictions, ...]:
        """The predictions of a mount, as they stood when features were selected."""
        return next(
            (r.predictions for r in self.records if r.mount == mount and r.phase == "select"), ()
        )

    def associations(self, mount: str | None = None) -> tuple[Association, ...]:
        """Outcomes of the features that a mount searched (all mounts when None)."""
        return tuple(
            a
            for r in self.records
            if r.phase == "update" and mount in (None, r.mount)
            for a in r.associations
        )

    def outcome(self, mount: str, label: Label) -> Association | None:
        """What a mount did with a feature this frame, with the reason when it was not searched.

        A view made on demand: building one for every feature would cost as much as the filter.
        """
        for a in self.associations(mount):
            if a.label == label:
                return a
        for record in self.records:
            if record.mount != mount or record.phase != "select":
                continue
            for p in record.predictions:
                i = p.row.get(label)
                if i is not None and not p.selected[i]:
                    larger = f"{int(record.numbers['budget'])} features have a larger score"
                    why = words(int(p.fault[i])) or larger
                    return Association(mount, label, "not selected", p.h[i], p.S[i], why=why)
        return None

    @property
    def events(self) -> tuple[Event, ...]:
        return tuple(e for r in self.records for e in r.events)
