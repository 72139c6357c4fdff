"""Statistics over seeds: is the filter as sure as it may be? `make consistency` prints a table."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from time import process_time
from typing import NamedTuple

import numpy as np
import tyro
from threadpoolctl import threadpool_limits

from scene_core.filter.ports import EndOfData
from scene_core.geometry.ellipses import chi2_band
from scene_core.session import presets
from scene_core.session.config import Experiment
from scene_core.session.edits import with_seed
from scene_core.session.published import RobotSeries
from scene_core.session.report import report
from scene_core.session.session import Session

CALIBRATION_INTERVAL = 0.999
"""Probability of the interval for one calibration; a scenario may estimate ten of them."""


class RobotOutcome(NamedTuple):
    """One robot in one run."""

    nees: float
    """Mean over the run."""
    nees_end: float
    dof: int
    rmse: float
    """Of the position over the run, m."""
    end: float
    """Error of the position in the last frame, m."""

    @classmethod
    def of(cls, series: RobotSeries) -> RobotOutcome:
        d = 3 if series.nees_dof == 6 else series.nees_dof - (series.nees_dof == 3)
        if series.nees is None or series.error is None:
            return cls(math.nan, math.nan, series.nees_dof, math.nan, math.nan)
        off = np.linalg.norm(series.error[:, :d], axis=1)
        rmse = math.sqrt(float(np.nanmean(off**2)))
        nees = series.nees[np.isfinite(series.nees)]
        mean, end = (float(nees.mean()), float(nees[-1])) if len(nees) else (math.nan, math.nan)
        return cls(mean, end, series.nees_dof, rmse, float(off[-1]))


@dataclass(frozen=True)
class Outcome:
    """One run."""

    seed: int
    robots: Mapping[str, RobotOutcome]
    calibrations: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    """Estimate, sd and truth at the end by name."""
    nis: float = math.nan
    """Mean d2 of the matches put to the gate, per degree of freedom."""
    ms: float = math.nan
    """Milliseconds per frame, the simulation included."""


class Calibration(NamedTuple):
    """An estimated component over the runs."""

    name: str
    nees: float
    """Mean over the seeds of the squared normalised error at the end."""
    band: tuple[float, float]
    """The interval it must lie in."""

    @property
    def is_consistent(self) -> bool:
        return self.band[0] <= self.nees <= self.band[1]


@dataclass(frozen=True)
class Study:
    """Runs of one experiment that differ in their seed."""

    name: str
    outcomes: tuple[Outcome, ...]
    reason: str = ""
    """Why something is outside its band, where that is known."""

    @property
    def robots(self) -> tuple[str, ...]:
        """Those with a truth to compare with."""
        first = self.outcomes[0].robots
        return tuple(i for i, r in first.items() if math.isfinite(r.nees))

    def values(self, robot: str, name: str) -> np.ndarray:
        """A figure of a robot in every run."""
        return np.array([getattr(o.robots[robot], name) for o in self.outcomes])

    def nees(self, robot: str) -> float:
        """NEES of a robot averaged over the runs and the seeds."""
        return float(np.nanmean(self.values(robot, "nees")))

    def nees_band(self, robot: str) -> tuple[float, float]:
        """Where it must lie: the 95 % interval of the mean of as many independent values as there
        are seeds, which is strict, for it counts a whole run as one value."""
        return chi2_band(self.outcomes[0].robots[robot].dof, len(self.outcomes))

    def calibrations(self) -> Iterable[Calibration]:
        """Estimated components whose truth is known."""
        n = len(self.outcomes)
        for name, (_, sd, true) in self.outcomes[0].calibrations.items():
            if math.isfinite(true) and sd > 0:
                ends = np.array([o.calibrations[name] for o in self.outcomes])
                mean = float((((ends[:, 0] - ends[:, 2]) / ends[:, 1]) ** 2).mean())
                yield Calibration(name, mean, chi2_band(1, n, CALIBRATION_INTERVAL))

    @property
    def is_consistent(self) -> bool:
        """Whether every robot and every calibration lies in its band; not where nobody knows."""
        bands = [(self.nees(i), self.nees_band(i)) for i in self.robots]
        known = bool(bands) and all(lo <= value <= hi for value, (lo, hi) in bands)
        return known and all(one.is_consistent for one in self.calibrations())


def study(
    experiment: Experiment,
    seeds: Sequence[int],
    frames: int | None = None,
    done: Callable[[Outcome], None] = lambda outcome: None,
) -> Study:
    """Run an experiment once per seed."""
    outcomes = []
    for seed in seeds:
        session = Session(with_seed(experiment, seed), history_bytes=0)
        start = process_time()
        with suppress(EndOfData):  # a run with an end of its own is complete there
            while frames is None or session.frame + 1 < frames:
                session.advance()
        outcomes.append(_outcome(session, seed, process_time() - start))
        done(outcomes[-1])
    return Study(experiment.name, tuple(outcomes))


def _outcome(session: Session, seed: int, seconds: float) -> Outcome:
    series, figures = session.metrics.series(), report(session, seconds)
    nis = figures["nis_mean"]
    return Outcome(
        seed,
        {i: RobotOutcome.of(robot) for i, robot in series.robots.items()},
        {
            name: (float(x[-1]), float(sd[-1]), math.nan if true is None else float(true[-1]))
            for name, (x, sd, true) in series.calibrations.items()
        },
        math.nan if nis is None else nis / figures["nis_dof"],
        1e3 * seconds / len(series.frames),
    )


HEAD = """\
| scenario | robot | seeds | NEES, mean | at the end | must lie in | NIS per DoF | rmse, m \
| end, median, m | calibration | ms per frame | in band |
|---|---|---|---|---|---|---|---|---|---|---|---|"""
"""Of a Markdown table. NEES `at the end` and rmse are means over the seeds."""


def rows(s: Study) -> str:
    """A line of the table for each robot."""
    calibrations = list(s.calibrations())
    worst = max(calibrations, key=lambda one: one.nees / one.band[1], default=None)
    found = "–" if worst is None else f"{np.mean([one.nees for one in calibrations]):.2f}"
    ms, nis = (np.mean([getattr(o, name) for o in s.outcomes]) for name in ("ms", "nis"))
    verdict = "yes" if s.is_consistent else "no: see below" if s.reason else "NO"
    lines = []
    for robot in s.robots:
        lo, hi = s.nees_band(robot)
        end, rmse = (np.nanmean(s.values(robot, name)) for name in ("nees_end", "rmse"))
        cells = (
            f"`{s.name}`",
            robot,
            str(len(s.outcomes)),
            f"{s.nees(robot):.2f}",
            f"{end:.2f}",
            f"{lo:.2f} to {hi:.2f}",
            f"{nis:.2f}",
            f"{rmse:.3f}",
            f"{np.median(s.values(robot, 'end')):.3f}",
            found,
            f"{ms:.1f}",
            verdict,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def complaints(s: Study) -> Iterable[str]:
    """What is out of its band, and the reason where there is one."""
    if s.is_consistent:
        return
    for one in s.calibrations():
        if not one.is_consistent:
            lo, hi = one.band
            yield (
                f"`{s.name}`: {one.name} has a squared normalised error of {one.nees:.2f}, must "
                f"lie in {lo:.2f} to {hi:.2f}."
            )
    if s.reason:
        yield f"`{s.name}`: {s.reason}"


@dataclass(frozen=True)
class Options:
    """Statistics of the scenarios over seeds. Exit code 1 when one is outside its band without a
    reason that is known."""

    names: tyro.conf.Positional[tuple[str, ...]] = field(default_factory=presets.loadable)
    """Scenarios."""
    seeds: int = 20
    """Seeds 0 to this, less one."""
    frames: int = 0
    """Frames of every run; 0: as many as each scenario is known for."""


def main(options: Options) -> int:
    """Print the table as it grows."""
    threadpool_limits(1)
    print(HEAD, flush=True)
    good, notes = True, []
    for name in options.names:
        preset, experiment = presets.named(name), presets.build(name)

        def progress(outcome: Outcome, name: str = name) -> None:
            if sys.stderr.isatty():
                print(f"\r\x1b[K{name}, seed {outcome.seed}", end="", file=sys.stderr, flush=True)

        frames = options.frames or preset.frames
        result = study(experiment, range(options.seeds), frames, progress)
        result = replace(result, reason=preset.reason)
        if sys.stderr.isatty():
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
        print(rows(result), flush=True)
        notes += complaints(result)
        good &= result.is_consistent or bool(result.reason)
    print("".join(f"\n- {note}" for note in notes))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
