"""`scene run`: an experiment from its start to its end, and the figures of it."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import monotonic, perf_counter
from typing import Annotated

import tyro

from scene_core.filter.ports import EndOfData
from scene_core.params import ParamError
from scene_core.session.cli_source import SourceOptions, experiment_from
from scene_core.session.failures import explain
from scene_core.session.report import report, summary
from scene_core.session.session import Session
from scene_core.session.start import resting

DEFAULT_FRAMES = 1000
"""Length of a run whose source has no end, when --frames is not given."""


@dataclass(frozen=True)
class Run:
    """Run an experiment without the page, as fast as possible."""

    source: Annotated[SourceOptions, tyro.conf.OmitArgPrefixes] = field(
        default_factory=SourceOptions
    )
    frames: int | None = None
    """Stop after this many frames; else at the scenario's or the recording's end, or after 1000."""
    json: str = ""
    """Write the figures to this file, or to standard output with -."""
    metrics_from: int = 0
    """Leave the frames before this one out of errors, NEES and NIS."""


def run(options: Run) -> None:
    """Run, then write or print the figures."""
    experiment = experiment_from(options.source)
    if options.frames is not None:
        if options.frames < 1:
            raise ParamError(f"--frames {options.frames}: give a whole number of at least 1")
        experiment = replace(experiment, frames=options.frames)
    elif experiment.frames is None and experiment.source.frame_count is None:
        experiment = replace(experiment, frames=DEFAULT_FRAMES)
    for why in resting(experiment.estimator).values():
        print(f"scene: {why}", file=sys.stderr)
    session = Session(experiment)
    count = session.frame_count
    if options.metrics_from < 0 or (count is not None and options.metrics_from >= count):
        raise ParamError(
            f"--metrics-from {options.metrics_from}: give a frame from 0 to {(count or 1) - 1}"
        )
    if options.json not in ("", "-") and not Path(options.json).parent.is_dir():
        raise ParamError(f"--json {options.json}: there is no folder {Path(options.json).parent}")
    seconds = _advance_to_the_end(session, count)
    figures = report(session, seconds, options.metrics_from)
    if not options.json:
        print(summary(figures, session.metrics.totals()), flush=True)
        return
    text = json.dumps(figures, indent=2, allow_nan=False)
    if options.json == "-":
        print(text, flush=True)
        return
    try:
        Path(options.json).write_text(text + "\n", encoding="utf-8")
    except OSError as e:
        raise ParamError(f"--json {options.json}: can not be written: {e.strerror}") from e


class RunError(Exception):
    """A run that broke off: the message is one sentence, `details` a traceback or nothing."""

    def __init__(self, text: str, details: str) -> None:
        super().__init__(text)
        self.details = details


def _advance_to_the_end(session: Session, count: int | None) -> float:
    """Run until the data end; returns the seconds it took."""
    bar = Progress(count)
    start = perf_counter()
    try:
        while True:
            session.advance()
            bar.show(session)
    except EndOfData:
        return perf_counter() - start
    except Exception as e:
        # Whatever a model raises becomes a sentence that says which frame it was.
        text, details = explain(e)
        raise RunError(f"frame {session.frame + 1}: {text}", details) from e
    finally:
        bar.clear()


class Progress:
    """One line on a terminal; nothing elsewhere."""

    WIDTH = 30

    def __init__(self, count: int | None) -> None:
        self._count = count
        self._is_on = sys.stderr.isatty()
        self._start = self._shown = monotonic()

    def show(self, session: Session) -> None:
        now = monotonic()
        if not self._is_on or now - self._shown < 0.1:
            return
        self._shown = now
        done = session.frame + 1
        bar = ""
        if self._count:
            filled = math.floor(self.WIDTH * done / self._count)
            bar = f"[{'#' * filled}{'.' * (self.WIDTH - filled)}] "
        of = f" of {self._count}" if self._count else ""
        rate, features = done / (now - self._start), len(session.world.features)
        line = f"{bar}frame {done}{of}, {rate:.0f} frames/s, {features} features"
        print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self._is_on:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
