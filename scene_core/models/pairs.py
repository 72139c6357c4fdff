"""Which models go together: every pair of two kinds, with the reason where one is refused.

What `scene models` lists, what the tests run and what the page of the documentation prints is this.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from scene_core.models import registry

Verdict = Literal["starts", "observes", "refused"]
MARKS: dict[Verdict, str] = {"starts": "yes", "observes": "observes", "refused": "–"}


@dataclass(frozen=True)
class Pair:
    """A sensor and a landmark parametrisation."""

    sensor: str
    landmark: str
    verdict: Verdict
    """starts: the sensor starts such landmarks and measures them. observes: it measures those that
    were started otherwise. refused: they have nothing to do with each other."""
    reason: str
    """Why not more than that; empty when it starts them."""


@dataclass(frozen=True)
class Fit:
    """A part and the motion model of the robot it is to be fitted to."""

    motion: str
    part: str
    reason: str
    """Why it can not be; empty when it can."""


def pairs() -> tuple[Pair, ...]:
    """Every sensor with every landmark parametrisation."""
    landmarks = _made("features")
    return tuple(_pair(s, f) for s in _made("sensors") for f in landmarks)


def carriers() -> tuple[Fit, ...]:
    """Every motion model with every sensor it may carry."""
    return _fits("sensors", registry.carriable)


def instruments() -> tuple[Fit, ...]:
    """Every motion model with every internal measurement."""
    return _fits("internal", lambda motion, internal: registry.runs_on(internal, motion))


def markdown() -> str:
    """The three tables as a page of the documentation."""
    found = pairs()
    landmarks = tuple(dict.fromkeys(p.landmark for p in found))
    verdicts = {(p.sensor, p.landmark): MARKS[p.verdict] for p in found}
    sensors = tuple(dict.fromkeys(p.sensor for p in found))
    partly = [(f"{p.sensor} + {p.landmark}", p.reason) for p in found if p.verdict == "observes"]
    refused = [(f"{p.sensor} + {p.landmark}", p.reason) for p in found if p.verdict == "refused"]
    return "\n".join(
        (
            HEAD,
            *_table("sensor", sensors, landmarks, lambda s, f: verdicts[s, f]),
            "\n### Observed only\n",
            *_reasons(partly),
            "\n### Refused\n",
            *_reasons(refused),
            CARRIERS,
            *_fit_tables(carriers(), "sensor"),
            INSTRUMENTS,
            *_fit_tables(instruments(), "instrument"),
            "",
        )
    )


HEAD = """\
# What goes with what

Made by `scene models --markdown`; the tests run every pair of these tables.

## Sensors and landmarks

**yes**: the sensor starts such landmarks and measures them. **observes**: it measures those that
another sensor started, or that were known or converted. –: refused, for the reason below.
"""
CARRIERS = """
## Robots and the sensors they carry

A position state is embedded upwards only, so a sensor needs at least the dimensions of its robot.
"""
INSTRUMENTS = """
## Robots and their instruments

An internal measurement runs on every motion model that has the components it needs.
"""


def _made(kind: str) -> list[Any]:
    return [cls() for cls in registry.models(kind).values()]


def _pair(sensor: Any, feature: Any) -> Pair:
    refused = registry.observable(sensor, feature)
    partly = registry.compatible(sensor, feature)
    verdict: Verdict = "refused" if refused else "observes" if partly else "starts"
    return Pair(sensor.name, feature.name, verdict, refused or partly or "")


def _fits(kind: str, reason: Callable[[Any, Any], str | None]) -> tuple[Fit, ...]:
    parts = _made(kind)
    return tuple(
        Fit(motion.name, part.name, reason(motion, part) or "")
        for motion in _made("motion")
        for part in parts
    )


def _fit_tables(fits: Sequence[Fit], what: str) -> list[str]:
    """Parts down, motion models across, then the reasons."""
    reasons = {(fit.part, fit.motion): fit.reason for fit in fits}
    parts = tuple(dict.fromkeys(fit.part for fit in fits))
    motions = tuple(dict.fromkeys(fit.motion for fit in fits))
    refused = [(f"{fit.part} + {fit.motion}", fit.reason) for fit in fits if fit.reason]
    cells = _table(what, parts, motions, lambda p, m: "–" if reasons[p, m] else "yes")
    return [*cells, "\n### Refused\n", *_reasons(refused)]


def _table(
    corner: str, rows: Sequence[str], columns: Sequence[str], cell: Callable[[str, str], str]
) -> list[str]:
    out = [_row((corner, *columns)), "|" + "---|" * (len(columns) + 1)]
    return out + [_row((row, *(cell(row, column) for column in columns))) for row in rows]


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _reasons(found: Sequence[tuple[str, str]]) -> list[str]:
    return [f"- {which}: {reason}" for which, reason in found] or ["None."]
