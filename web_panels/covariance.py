"""The correlation of the whole state as a picture with the names of its blocks.

A small state is shown number by number, a large one block by block: the largest canonical
correlation of every pair. Below it, what the selected landmark knows of all others.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import viser

from scene_core.arrays import Mat
from scene_core.filter.groups import rows_of
from scene_core.filter.world import Gaussian, World
from scene_core.geometry.correlation import (
    block_correlations,
    correlation,
    largest_canonical_correlations,
)
from scene_core.session.published import Published
from web_panels.painter import FONT
from web_panels.panel import Page, Post
from web_panels.style import HEX, RGB, C, block, escape

ROWS = 64
"""States up to this size are shown number by number."""
BLOCKS = 40
"""At most this many blocks of a large state are shown."""
NAMES = 20
"""Beyond this many blocks only some of them are named."""
WIDTH, HEIGHT = 860, 640
"""Of the picture: what the docked panel has room for, twice."""
LEFT, TOP, SIDE = 62, 34, 596
"""Where the square of the map lies in it."""
GROUND = (18, 22, 29)
LOW, ZERO, HIGH = (np.array(c, float) for c in ((64, 140, 255), (24, 29, 38), (255, 170, 60)))


@dataclass(frozen=True)
class Part:
    """Rows of the state that get one name."""

    name: str
    rows: slice
    label: int | None
    """Of a feature; None for a robot, a pose or a calibration."""


GROUPS = (
    ("r", "position", ("x", "y", "z")),
    ("q", "orientation", ("qw", "qx", "qy", "qz")),
    ("v", "velocity", ("vx", "vy", "vz")),
    ("w", "angular rate", ("wx", "wy", "wz")),
)
"""Runs of labels of a robot's state that are named together."""


RUNS = frozenset(short for short, _, _ in GROUPS)


def parts_of(world: World) -> list[Part]:
    """The named rows of the state, robots first, as they lie in it."""
    out: list[Part] = []
    robots = {r.block: r for r in world.robots.values()}
    features = {f.block: label for label, f in world.features.items()}
    for b in world.gauss.layout.blocks:
        if b.name in robots:
            out += _robot_parts(robots[b.name].motion.state_labels, b.start)
        elif b.name in features:
            label = features[b.name]
            out.append(Part(str(label), b.slice, label))
        else:
            out.append(Part(b.name.split(":", 1)[1], b.slice, None))
    return out


def _robot_parts(labels: tuple[str, ...], start: int) -> list[Part]:
    out, i = [], 0
    while i < len(labels):
        name, size = labels[i], 1
        for short, _, run in GROUPS:
            if len(run) > 1 and labels[i : i + len(run)] == run:
                name, size = short, len(run)
        out.append(Part(name, slice(start + i, start + i + size), None))
        i += size
    return out


def merged(parts: list[Part]) -> list[Part]:
    """Single components that follow each other as one part."""
    out: list[Part] = []
    for p in parts:
        last = out[-1] if out else None
        single = p.label is None and p.rows.stop - p.rows.start == 1
        if last is not None and single and last.label is None and last.rows.stop == p.rows.start:
            if all(len(word) < 3 for word in last.name.split()) and last.name not in RUNS:
                rows = slice(last.rows.start, p.rows.stop)
                out[-1] = Part(f"{last.name} {p.name}", rows, None)
                continue
        out.append(p)
    return out


@dataclass(frozen=True)
class Table:
    """What the picture shows: values in [-1, 1] and, for every name, its rows in them."""

    values: Mat
    names: tuple[tuple[str, int, int, int | None], ...]
    """Name, first row, number of rows, label."""
    what: str
    signed: bool
    """From -1 to 1, else from 0 to 1."""


def table_of(world: World, selected: int | None) -> Table:
    """Correlations number by number when they fit, else canonical ones block by block."""
    parts = parts_of(world)
    n = world.gauss.layout.size
    if n <= ROWS:
        names = tuple((p.name, p.rows.start, p.rows.stop - p.rows.start, p.label) for p in parts)
        return Table(correlation(world.gauss.P), names, f"{n} rows", signed=True)
    parts = merged(parts)
    shown = parts[:BLOCKS]
    mine = next((p for p in parts[BLOCKS:] if p.label == selected and selected is not None), None)
    if mine is not None:
        shown = [*shown[:-1], mine]
    values = block_correlations(world.gauss.P, [p.rows for p in shown])
    names = tuple((p.name, i, 1, p.label) for i, p in enumerate(shown))
    rest = f"{len(shown)} of {len(parts)}" if len(parts) > len(shown) else f"{len(shown)}"
    return Table(values, names, f"canonical · {rest} blocks", signed=False)


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
    every = max(1, -(-len(table.names) // NAMES))
    for k, (name, first, count, label) in enumerate(table.names):
        a, b = int(edge[first]), int(edge[first + count])
        if table.signed:
            _grid(canvas, a)
        chosen = label is not None and label == selected
        if chosen or label is None or k % every == 0:
            colour = C["white"] if chosen else C["estimate"] if label is None else C["ink"]
            _name(canvas, name, (a + b) // 2, colour, b - a)
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
    colour = (58, 68, 84)
    cv2.line(canvas, (LEFT, TOP + at), (LEFT + SIDE, TOP + at), colour, 1)
    cv2.line(canvas, (LEFT + at, TOP), (LEFT + at, TOP + SIDE), colour, 1)


def _text(canvas: np.ndarray, words: str, at: tuple[int, int], colour: RGB, scale: float) -> None:
    cv2.putText(canvas, words, at, FONT, scale, colour, 1, cv2.LINE_AA)


def _name(canvas: np.ndarray, name: str, middle: int, colour: RGB, room: int) -> None:
    text = name if len(name) <= 7 else name[:6] + "."
    scale = min(0.6 if len(text) < 4 else 0.5, max(0.5, room / 24.0))
    (w, h), _ = cv2.getTextSize(text, FONT, scale, 1)
    _text(canvas, text, (LEFT - 6 - w, TOP + middle + h // 2), colour, scale)
    if len(text) < 4:
        _text(canvas, text, (LEFT + middle - w // 2, TOP - 8), colour, scale)


def _key(canvas: np.ndarray, table: Table) -> None:
    """The colour bar, and what the names mean."""
    x, y, height = LEFT + SIDE + 26, TOP, 300
    column = np.linspace(255, 0, height).round().astype(np.intp)
    canvas[y : y + height, x : x + 18] = ramp(table.signed)[column][:, None]
    ticks = ("+1", "0", "-1") if table.signed else ("1", "0.5", "0")
    for words, at in zip(ticks, (12, height // 2 + 6, height), strict=True):
        _text(canvas, words, (x + 28, y + at), C["dim"], 0.6)
    named = {name for name, _, _, label in table.names if label is None}
    rows = [(short, words) for short, words, _ in GROUPS if short in named]
    for i, (short, words) in enumerate([*rows, ("7", "landmark")]):
        at = y + height + 48 + 34 * i
        _text(canvas, short, (x, at), C["estimate"] if i < len(rows) else C["ink"], 0.62)
        _text(canvas, words, (x + 28, at), C["dim"], 0.56)


def others_html(world: World, selected: int | None) -> str:
    """The largest canonical correlation of the selected landmark with each other one."""
    if selected is None or selected not in world.features:
        return block(
            '<span class="d">Select a landmark to read its largest canonical correlation with '
            "every other one: click it in a sensor's picture or in the map.</span>"
        )
    layout = world.gauss.layout
    labels = [k for k in world.features if k != selected]
    P, (mine, *rows) = rows_of(world, [selected, *labels])
    rho = largest_canonical_correlations(P, mine, rows)
    order = np.argsort(-rho, kind="stable")
    cells = "".join(_cell(labels[i], float(rho[i])) for i in order)
    robots = "".join(
        f'<tr><td>{escape(r.id)}</td><td class="d" style="text-align:left">robot</td>'
        f"<td>{_with(P, mine, layout[r.block].slice):.3f}</td></tr>"
        for r in world.robots.values()
    )
    return block(
        f'<div class="row" style="margin-top:6px"><span class="h">Landmark {selected} with</span>'
        '<span class="d">largest canonical correlation</span></div>'
        f"<table>{robots}</table>"
        '<div style="display:grid;grid-template-columns:repeat(auto-fill,minmax(76px,1fr));'
        f'gap:2px 10px;margin-top:4px">{cells}</div>'
    )


def _with(P: Mat, a: slice, b: slice) -> float:
    return float(largest_canonical_correlations(P, a, [b])[0])


def _cell(label: int, rho: float) -> str:
    return (
        f'<div class="row" style="gap:4px"><span class="d">{label}</span><span>'
        f'<svg width="26" height="7"><rect width="26" height="7" fill="var(--rule)"/>'
        f'<rect width="{26 * rho:.1f}" height="7" fill="{HEX["unselected"]}"/></svg> '
        f"{rho:.2f}</span></div>"
    )


class Covariance:
    """The Covariance tab."""

    rate_hz = 2.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self._shown: tuple[Gaussian | None, int | None] = (None, None)

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.head = server.gui.add_html(block("No state yet: press <kbd>Space</kbd>."))
        blank = np.full((HEIGHT, WIDTH, 3), GROUND, np.uint8)
        self.image = server.gui.add_image(blank, format="jpeg", jpeg_quality=88)
        self.others = server.gui.add_html("")

    def render(self, p: Published) -> None:
        if p.trace is None:
            return
        world = p.trace.world
        gauss, selected = self._shown
        if world.gauss is gauss and p.selected == selected:
            return
        self._shown = (world.gauss, p.selected)
        table = table_of(world, p.selected)
        self.page.between()
        canvas = picture(table, p.selected)
        self.page.between()
        self.image.image = canvas
        self.page.between()
        self.others.content = others_html(world, p.selected)
        head = block(
            '<div class="row" style="padding-bottom:4px;white-space:nowrap"><b>Correlation of the '
            f'state</b><span class="d">{table.what}</span></div>'
        )
        if head != self.head.content:
            self.head.content = head
