"""A frame that is being stepped through: what it began with, and the phases that are done."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

from scene_core.filter.ports import EndOfData, Frame, SourceError
from scene_core.filter.records import Event, PhaseRecord, Trace
from scene_core.filter.step import step
from scene_core.filter.world import World
from scene_core.session.config import Experiment
from scene_core.session.edits import Settings
from scene_core.session.history import Moment
from scene_core.session.swap import reconfigure


@dataclass
class OpenFrame:
    """A frame some phases of which are done."""

    frame: Frame
    start: World
    state: Any
    """Of the source, after the frame."""
    settings: Settings
    phases: Iterator[PhaseRecord]
    expected: int
    """How many phases it should have."""
    source_ms: float
    notes: tuple[str, ...] = ()
    """What a swap at its start kept and restarted."""
    records: list[PhaseRecord] = field(default_factory=list)

    @property
    def is_complete(self) -> bool:
        return len(self.records) >= self.expected

    def next_phase(self) -> PhaseRecord:
        """Compute one more phase. Raises what a model or the source raises."""
        record = next(self.phases)
        if not self.records and self.notes:
            swaps = tuple(Event(self.frame.index, "swap", note) for note in self.notes)
            record = replace(record, events=swaps + record.events)
        self.records.append(record)
        return record

    def trace(self, complete: bool) -> Trace:
        return Trace(self.frame, self.start, tuple(self.records), complete)


def opened(at: Moment, settings: Settings, before: Experiment, now: Experiment) -> OpenFrame:
    """The frame after a moment, which was computed with the experiment `before`, under settings
    that come down to the experiment `now`.

    Raises EndOfData, ParamError where the settings do not suit the estimate, and SourceError.
    """
    index = at.frame + 1
    if now.frames is not None and index >= now.frames:
        raise EndOfData
    reached = reconfigure(at.world, before.estimator, now.estimator)
    t0 = perf_counter()
    frame, state = now.source.advance(at.state, index)
    source_ms = 1e3 * (perf_counter() - t0)
    unknown = [m for m in frame.raw if m not in reached.world.mounts]
    if unknown:
        known = ", ".join(reached.world.mounts)
        raise SourceError(
            f"the input comes from a sensor '{unknown[0]}' the estimator does not have (it has "
            f"{known}): give them the same name"
        )
    return OpenFrame(
        frame=frame,
        start=reached.world,
        state=state,
        settings=settings,
        phases=step(reached.world, frame, now.source),
        expected=2 + 5 * len(frame.raw),
        source_ms=source_ms,
        notes=reached.notes,
    )
