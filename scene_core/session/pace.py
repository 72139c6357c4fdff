"""When the next frame is due, and how fast frames really come."""

from __future__ import annotations

import math
from time import monotonic

LATE_S = 0.25
"""A run that is later than this gives up catching up: the real-time factor says so."""


class Pace:
    """The clock of a run that is played at a speed."""

    def __init__(self) -> None:
        self._due = monotonic()
        self._done: list[tuple[float, float]] = []
        """Wall time and seconds of data of the latest frames."""

    def wait(self, speed: float) -> float:
        """Seconds until the next frame is due."""
        return self._due - monotonic() if math.isfinite(speed) else 0.0

    def frame_done(self, rate: float, speed: float) -> None:
        now = monotonic()
        self._done = [*self._done[-59:], (now, 1.0 / rate)]
        self._due = max(self._due + 1.0 / (rate * speed), now - LATE_S)

    @property
    def factor(self) -> float:
        """Seconds of data per second of wall time, over the latest frames."""
        if len(self._done) < 2:
            return 0.0
        elapsed = self._done[-1][0] - self._done[0][0]
        return sum(dt for _, dt in self._done[1:]) / elapsed if elapsed > 0 else 0.0
