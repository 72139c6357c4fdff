"""Two limits of one thing: one that is moved past the other takes it along."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from scene_core.params import Spec
from scene_core.session.commands import SetParam, SetParams

GAP = 0.05
"""How far ahead of a length the other one is kept, as a part of it."""
LEAST_GAP = 0.01
"""The same ahead of zero, in SI units."""
GESTURE_S = 2.0
"""What comes sooner than this after the last edit belongs to it: a drag, or a number half typed."""


def partners(specs: Iterable[Spec]) -> dict[str, Spec]:
    """The limit beside each parameter that has one, by the parameter's path."""
    by_path = {spec.path: spec for spec in specs}
    out = {}
    for spec in by_path.values():
        upper = by_path.get(f"{spec.path.rpartition('.')[0]}.{spec.below}") if spec.below else None
        if upper is not None:
            out |= {spec.path: upper, upper.path: spec}
    return out


class Limit:
    """One of two limits as somebody edits it. The other one comes back where it was when this one
    does so in the same gesture: of 150, typed, 1 and 15 were not meant."""

    def __init__(self, spec: Spec, other: Spec) -> None:
        self.spec, self.other = spec, other
        self._was: float | None = None
        """The other one when the gesture began."""
        self._is_moved = False
        self._edited = 0.0

    def edit(self, value: Any, there: float) -> SetParam | SetParams:
        """The command that gives the limit a value (SI) while the other one is at `there`."""
        if not isinstance(value, (int, float)):
            return SetParam(self.spec.path, value)
        now = time.monotonic()
        if self._was is None or now - self._edited > GESTURE_S:
            self._was, self._is_moved = there, False
        self._edited = now
        along = self._along(value, self._was)
        self._is_moved = self._is_moved or along != self._was
        if not self._is_moved:
            return SetParam(self.spec.path, value)
        return SetParams(((self.spec.path, value), (self.other.path, along)))

    def _along(self, value: float, was: float) -> float:
        """The other limit: as it was where that is in order, else just ahead, within its range;
        what is too near is refused."""
        is_lower, whole = self.spec.below == self.other.name, isinstance(self.spec.value, int)
        low, high = (value, was) if is_lower else (was, value)
        # Numbers of things may be equal, lengths may not.
        if low < high or (whole and low == high):
            return was
        along = value
        if not whole:
            gap = GAP * abs(value) or LEAST_GAP
            along = float(f"{value + (gap if is_lower else -gap):.3g}")
        along = along if self.other.lo is None else max(along, type(along)(self.other.lo))
        return along if self.other.hi is None else min(along, type(along)(self.other.hi))
