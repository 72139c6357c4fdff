"""Why something can not be measured."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntFlag
from functools import cache


class Fault(IntFlag):
    """Why a feature can not be measured; zero means measurable (Scene's visibility test)."""

    NONE = 0
    BEHIND = 1
    """Behind the sensor, or on the wrong side of a projection."""
    OUTSIDE = 2
    """Outside the image, the field of view or the reach of the sensor."""
    SCALE = 4
    """Seen from much nearer or farther than when it was initialised."""
    ANGLE = 8
    """Seen from a much different direction than when it was initialised."""
    UNCERTAIN = 16
    """The search region is too large to be searched."""
    INFEASIBLE = 32
    """An internal measurement that has no meaning in this state."""


FAULT_WORDS: Mapping[Fault, str] = {
    Fault.BEHIND: "behind the sensor",
    Fault.OUTSIDE: "outside the field of view",
    Fault.SCALE: "seen from too different a distance",
    Fault.ANGLE: "seen from too different a direction",
    Fault.UNCERTAIN: "search region too large",
    Fault.INFEASIBLE: "not feasible in this state",
}


@cache
def words(fault: int) -> str:
    """The reasons in `fault` as a phrase, empty when measurable."""
    return ", ".join(text for bit, text in FAULT_WORDS.items() if fault & bit)
