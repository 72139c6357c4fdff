"""Milliseconds a frame of every scenario, by phase, without the page."""

from __future__ import annotations

from collections import defaultdict
from time import perf_counter

from benchmarks.figures import spread, table
from scene_core.session import presets
from scene_core.session.session import Session

FRAMES = {"cloister": 400, "room": 300, "nomad": 300, "line": 300}
SKIP = 10
"""Frames at the start that warm caches up."""


def run(name: str, frames: int) -> None:
    session = Session(presets.build(name))
    phases: dict[str, list[float]] = defaultdict(list)
    estimator, whole = [], []
    for index in range(frames):
        t0 = perf_counter()
        trace = session.advance()
        t1 = perf_counter()
        if index < SKIP:
            continue
        for record in trace.records:
            phases[record.phase].append(record.ms)
        estimator.append(sum(record.ms for record in trace.records))
        whole.append(1e3 * (t1 - t0))
    count = len(session.world.features)
    rows = [(phase, spread(ms)) for phase, ms in phases.items()]
    rows.append(("all phases", spread(estimator)))
    rows.append(("with simulation, history and metrics", spread(whole)))
    table(f"{name}: {frames} frames, {count} landmarks at the end, ms a frame [10 %, 90 %]", rows)


def main() -> None:
    for name, frames in FRAMES.items():
        run(name, frames)
