"""What is kept of the frames that a run has computed: moments to go back to, figures, events."""

from __future__ import annotations

from collections import deque
from itertools import islice

from scene_core.filter.records import Event, Trace
from scene_core.session.alignment import Alignment
from scene_core.session.history import History, Moment
from scene_core.session.metrics import Metrics

KEPT_EVENTS = 2000
SHOWN_EVENTS = 200


class Past:
    """The books of a run. A frame that is computed again comes out the same and is entered once."""

    def __init__(self, start: Moment, align: Alignment, history_bytes: int) -> None:
        self.history = History(history_bytes)
        self.history.add(start, None)
        self.metrics = Metrics(align)
        self._events: deque[Event] = deque(maxlen=KEPT_EVENTS)
        self._events_until = -1
        """The last frame whose events are in."""

    def enter(self, at: Moment, trace: Trace, source_ms: float) -> None:
        """A complete frame, or one to which something was added."""
        # First what uses the models: if one of them raises, the books are as before the frame.
        self.metrics.add(trace, source_ms)
        self.history.add(at, trace)
        if at.frame > self._events_until:
            self._events_until = at.frame
            for record in trace.records:
                self._events.extend(record.events)

    def events(self, frame: int) -> tuple[Event, ...]:
        """Up to a frame, newest first, at most SHOWN_EVENTS."""
        past = (event for event in reversed(self._events) if event.frame <= frame)
        return tuple(islice(past, SHOWN_EVENTS))

    def forget_after(self, frame: int) -> None:
        """Something new after the end of a frame: what was computed later is void."""
        self.history.truncate(frame)
        self._forget_told(frame)

    def enter_anew(self, at: Moment, trace: Trace, source_ms: float) -> None:
        """The frame that was entered last, with more to it."""
        self._forget_told(at.frame - 1)
        self.enter(at, trace, source_ms)

    def _forget_told(self, frame: int) -> None:
        self.metrics.truncate(frame)
        self._events_until = min(self._events_until, frame)
        while self._events and self._events[-1].frame > frame:
            self._events.pop()
