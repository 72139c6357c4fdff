"""The picture of a table of correlations: its cells, the names beside them, the colour bar."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from web_panels.correlation_table import GROUPS, Table
from web_panels.painter import FONT
from web_panels.style import RGB, C

WIDTH, HEIGHT = 860, 640
"""Of the picture: what the docked panel has room for, twice."""
LEFT, TOP, SIDE = 104, 34, 580
"""Where the square of the map lies in it."""
LEADER = 14
"""Between a name and the rows it is for, px."""
APART = 16
"""From one name to the next one below it, px."""
LONGEST = 9
"""Characters of a name that have room."""
GROUND, LINES = (18, 22, 29), (58, 68, 84)
BLANK = np.full((HEIGHT, WIDTH, 3), GROUND, np.uint8)
LOW, ZERO, HIGH = (np.array(c, float) for c in ((64, 140, 255), (24, 29, 38), (255, 170, 60)))


@cache
def ramp(signed: bool) -> np.ndarray:
    """Colours (256, 3) of -1 to 1 or of 0 to 1.

    Plain correlations are often small, canonical ones often near 1: each is spread where it is.
    """
    v = np.linspace(-1.0 if signed else 0.0, 1.0, 256)[:, None]
    strength = np.sqrt(np.abs(v)) if signed else v**3
    end = np.where(v < 0, LOW, HIGH)
    return (ZERO + (end - ZERO) * strength).round().astype(np.uint8)


def picture(table: Table, selected: int | None) -> np.ndarray:
    """RGB heat map with names, block borders, a colour bar, and a frame about the selected one."""
    n = len(table.values)
    edge = np.round(np.arange(n + 1) * SIDE / n).astype(int)
    canvas = np.full((HEIGHT, WIDTH, 3), GROUND, np.uint8)
    scaled = (table.values + 1.0) * 127.5 if table.signed else table.values * 255.0
    index = np.round(scaled).astype(np.uint8)
    cells: np.ndarray = cv2.resize(index, (SIDE, SIDE), interpolation=cv2.INTER_NEAREST)
    colours = ramp(table.signed)[np.asarray(cells, dtype=np.intp)]
    canvas[TOP : TOP + SIDE, LEFT : LEFT + SIDE] = colours
    if table.signed:
        for _, first, _, _ in table.names:
            _grid(canvas, int(edge[first]))
    names = [
        _Name(name, (int(edge[first]) + int(edge[first + count])) // 2, label, label == selected)
        for name, first, count, label in table.names
    ]
    _names_beside(canvas, names)
    _names_above(canvas, names)
    for _, first, count, label in table.names:
        if label is not None and label == selected:
            a, b = int(edge[first]), int(edge[first + count])
            corners = (
                (LEFT, TOP + a),
                (LEFT + SIDE, TOP + b),
                (LEFT + a, TOP),
                (LEFT + b, TOP + SIDE),
            )
            cv2.rectangle(canvas, *corners[:2], C["white"], 2)
            cv2.rectangle(canvas, *corners[2:], C["white"], 2)
    _key(canvas, table)
    return canvas


def _grid(canvas: np.ndarray, at: int) -> None:
    cv2.line(canvas, (LEFT, TOP + at), (LEFT + SIDE, TOP + at), LINES, 1)
    cv2.line(canvas, (LEFT + at, TOP), (LEFT + at, TOP + SIDE), LINES, 1)


def _text(canvas: np.ndarray, words: str, at: tuple[int, int], colour: RGB, scale: float) -> None:
    cv2.putText(canvas, words, at, FONT, scale, colour, 1, cv2.LINE_AA)


@dataclass(frozen=True)
class _Name:
    text: str
    middle: int
    """Of its rows, px from the first one."""
    label: int | None
    chosen: bool

    @property
    def colour(self) -> RGB:
        chosen = self.chosen and self.label is not None
        return C["white"] if chosen else C["estimate"] if self.label is None else C["ink"]


def wanted(names: list[_Name], room: int) -> list[_Name]:
    """As many names as there is room for, in order: all that are no landmarks', the selected one,
    and every second, third, ... of the landmarks."""
    must = [n for n in names if n.label is None or n.chosen]
    rest = [n for n in names if n.label is not None and not n.chosen]
    every = next(k for k in range(1, len(names) + 2) if len(must) + len(rest) / k <= room)
    return sorted([*must, *rest[every - 1 :: every]], key=lambda n: n.middle)


def spread(at: list[int], apart: int, end: int) -> list[int]:
    """Increasing places moved as little as it takes to be `apart`, none below `end`."""
    out: list[int] = []
    for y in at:
        out.append(max(y, out[-1] + apart) if out else y)
    limit = end
    for i in reversed(range(len(out))):
        out[i] = min(out[i], limit)
        limit = out[i] - apart
    return out


def _names_beside(canvas: np.ndarray, names: list[_Name]) -> None:
    """Left of the rows; a line leads to those whose name had to give way to others."""
    shown = wanted(names, SIDE // APART)
    places = spread([n.middle for n in shown], APART, SIDE - 4)
    for n, y in zip(shown, places, strict=True):
        text = n.text if len(n.text) <= LONGEST else n.text[: LONGEST - 1] + "."
        (w, h), _ = cv2.getTextSize(text, FONT, 0.5, 1)
        right = LEFT - 6 - LEADER
        _text(canvas, text, (right - w, TOP + y + h // 2), n.colour, 0.5)
        ends = (right + 4, TOP + y), (LEFT - 3, TOP + n.middle)
        if abs(y - n.middle) > 3:
            cv2.line(canvas, *ends, LINES, 1, cv2.LINE_AA)


def _names_above(canvas: np.ndarray, names: list[_Name]) -> None:
    """Above the columns, those short names that do not touch each other: the selected one first,
    then robots', then landmarks'."""
    taken: list[tuple[int, int]] = []
    for n in sorted(names, key=lambda n: (not n.chosen, n.label is not None, n.middle)):
        (w, _), _ = cv2.getTextSize(n.text, FONT, 0.5, 1)
        a, b = n.middle - w // 2 - 4, n.middle + w // 2 + 4
        if len(n.text) < 4 and all(b < low or a > high for low, high in taken):
            taken.append((a, b))
            _text(canvas, n.text, (LEFT + a + 4, TOP - 8), n.colour, 0.5)


def _key(canvas: np.ndarray, table: Table) -> None:
    """The colour bar, and what the names mean."""
    x, y, height = LEFT + SIDE + 24, TOP, 300
    column = np.linspace(255, 0, height).round().astype(np.intp)
    canvas[y : y + height, x : x + 18] = ramp(table.signed)[column][:, None]
    ticks = ("+1", "0", "-1") if table.signed else ("1", "0.5", "0")
    for words, at in zip(ticks, (12, height // 2 + 6, height), strict=True):
        _text(canvas, words, (x + 28, y + at), C["dim"], 0.6)
    named = {x for name, _, _, label in table.names if label is None for x in name.split()}
    rows = [(short, words) for short, words, _ in GROUPS if short in named]
    for i, (short, words) in enumerate([*rows, ("7", "landmark")]):
        at = y + height + 48 + 34 * i
        _text(canvas, short, (x, at), C["estimate"] if i < len(rows) else C["ink"], 0.7)
        _text(canvas, words, (x + 34, at), C["dim"], 0.68)
