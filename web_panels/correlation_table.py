"""Which correlations are shown, and what their rows are called."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from scene_core.arrays import Mat
from scene_core.filter.world import World
from scene_core.geometry.correlation import block_correlations, correlation

ROWS = 64
"""States up to this size are shown number by number."""
BLOCKS = 40
"""At most this many blocks of a large state are shown."""


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
    ("ba", "accel. bias", ("bax", "bay", "baz")),
    ("bg", "gyro bias", ("bgx", "bgy", "bgz")),
)
"""Runs of labels of a robot's state that are named together."""
RUNS = frozenset(short for short, _, _ in GROUPS)


def parts_of(world: World) -> list[Part]:
    """The named rows of the state, robots first, as they lie in it."""
    out: list[Part] = []
    robots = {r.block: r for r in world.robots.values()}
    features = {f.block: label for label, f in world.features.items()}
    others = [b.name for b in world.gauss.layout.blocks if b.name not in (*robots, *features)]
    kinds = Counter(name.rpartition(":")[2] for name in others)
    for b in world.gauss.layout.blocks:
        if b.name in robots:
            whose = f" {robots[b.name].id}" if len(robots) > 1 else ""
            out += _robot_parts(robots[b.name].motion.state_labels, b.start, whose)
        elif b.name in features:
            label = features[b.name]
            out.append(Part(str(label), b.slice, label))
        else:
            owner, _, kind = b.name.split(":", 1)[1].rpartition(":")
            out.append(Part(kind if kinds[kind] == 1 else f"{owner} {kind}", b.slice, None))
    return out


def _robot_parts(labels: tuple[str, ...], start: int, whose: str) -> list[Part]:
    """Runs of components under one name; foot:x, foot:y, foot:z are those of the foot."""
    out, i = [], 0
    while i < len(labels):
        of, _, plain = labels[i].rpartition(":")
        name, size = plain, 1
        for short, _, run in GROUPS:
            if labels[i : i + len(run)] == tuple(f"{of}:{x}" if of else x for x in run):
                name, size = short, len(run)
        name = f"{of} {name}".strip() + whose
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
