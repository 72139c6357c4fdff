"""The kept past: checkpoints to recompute from, and the latest frames whole, under a byte budget.

Everything between two checkpoints is recomputed: sources and the filter are pure, so the numbers
come out the same bit for bit. When the budget is full every other checkpoint goes, the distance
doubles, and every frame of the run can still be reached.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

from scene_core.filter.ports import Image
from scene_core.filter.records import Trace
from scene_core.filter.world import World
from scene_core.session.edits import Settings


@dataclass(frozen=True)
class Moment:
    """Everything needed to go on from the end of a frame."""

    frame: int
    """The last completed frame; -1 before the first."""
    world: World
    state: Any
    """Of the source."""
    settings: Settings
    """In force during that frame."""


class History:
    """Moments of one run by frame: a third of the budget for whole frames, the rest checkpoints."""

    def __init__(self, budget: int, spacing: int = 10) -> None:
        self._budget = budget
        self._spacing = spacing
        self._checkpoints: OrderedDict[int, Moment] = OrderedDict()
        self._checkpoint_bytes = 0
        self._recent: OrderedDict[int, tuple[Moment, Trace]] = OrderedDict()
        self._recent_bytes = 0
        self.last = -1
        """The last frame that was computed under the present settings."""

    @property
    def bytes(self) -> int:
        """An estimate of what is held: arrays only, those shared between frames counted twice."""
        return self._checkpoint_bytes + self._recent_bytes

    def add(self, moment: Moment, trace: Trace | None) -> None:
        """Remember the end of a frame."""
        self.last = max(self.last, moment.frame)
        if (moment.frame + 1) % self._spacing == 0:
            if moment.frame in self._checkpoints:
                self._checkpoint_bytes -= moment_bytes(self._checkpoints[moment.frame])
            self._checkpoints[moment.frame] = moment
            self._checkpoint_bytes += moment_bytes(moment)
            while self._checkpoint_bytes > self._budget * 2 // 3 and self._thin():
                pass
        if trace is not None:
            self._forget_recent(moment.frame)
            self._recent[moment.frame] = (moment, trace)
            self._recent_bytes += trace_bytes(trace)
            while self._recent_bytes > self._budget // 3 and len(self._recent) > 1:
                self._forget_recent(next(iter(self._recent)))

    def whole(self, frame: int) -> tuple[Moment, Trace] | None:
        """A frame that is still kept with all its phases."""
        return self._recent.get(frame)

    def before(self, frame: int) -> Moment:
        """The latest kept moment at or before the end of `frame`."""
        frames = sorted(self._checkpoints)
        best = self._checkpoints[frames[bisect_right(frames, frame) - 1]]
        recent = [f for f in self._recent if best.frame < f <= frame]
        return self._recent[max(recent)][0] if recent else best

    def truncate(self, frame: int) -> None:
        """Forget everything after the end of `frame`: it was computed under other settings."""
        self.last = min(self.last, frame)
        for f in [f for f in self._checkpoints if f > frame]:
            self._checkpoint_bytes -= moment_bytes(self._checkpoints.pop(f))
        for f in [f for f in self._recent if f > frame]:
            self._forget_recent(f)

    def _thin(self) -> bool:
        """Double the distance of the checkpoints; False when only the first is left."""
        if len(self._checkpoints) <= 2:
            return False
        self._spacing *= 2
        for f in [f for f in self._checkpoints if (f + 1) % self._spacing]:
            self._checkpoint_bytes -= moment_bytes(self._checkpoints.pop(f))
        return True

    def _forget_recent(self, frame: int) -> None:
        if frame in self._recent:
            self._recent_bytes -= trace_bytes(self._recent.pop(frame)[1])


def moment_bytes(moment: Moment) -> int:
    """Bytes of a moment's arrays (a lower bound: the feature records are shared between frames)."""
    return world_bytes(moment.world) + 200 * len(moment.world.features)


def trace_bytes(trace: Trace) -> int:
    """Bytes of a frame's worlds, predictions and images, each array once."""
    worlds = {id(w.gauss): w for w in (trace.start, *(r.world for r in trace.records))}
    total = sum(world_bytes(w) for w in worlds.values())
    for record in trace.records:
        for p in record.predictions:
            total += p.h.nbytes + p.E.nbytes + p.R.nbytes + sum(H.nbytes for H in p.H.values())
        total += 600 * (len(record.associations) + len(record.matches))
    for raw in trace.frame.raw.values():
        total += raw.pixels.nbytes if isinstance(raw, Image) else raw.z.nbytes
    return total


def world_bytes(world: World) -> int:
    return world.gauss.P.nbytes + world.gauss.x.nbytes
