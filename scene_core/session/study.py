"""Statistics over seeds: is the filter as sure as it may be? `make consistency` shows the table."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import tyro
from threadpoolctl import threadpool_limits

from scene_core.filter.ports import EndOfData
from scene_core.geometry.ellipses import chi2_band
from scene_core.session import presets
from scene_core.session.config import Experiment
from scene_core.session.edits import with_seed
from scene_core.session.report import report
from scene_core.session.session import Session

FRAMES = {"room": 900, "cloister": 400, "gyro": 450, "line": 300, "nomad": 600}
"""How long one run of each scenario is."""
LIMITS: dict[str, tuple[float, float]] = {"cloister": (0.0, 7.5)}
"""Where the NEES averaged over run and seeds must lie; else the 95 % interval of the mean of as
many independent values as there are seeds, which is strict: it counts a whole run as one value."""


@dataclass(frozen=True)
class Outcome:
    """One run."""

    seed: int
    figures: dict[str, Any]
    calibrations: dict[str, tuple[float, float, float]]
    """Estimate, sd and truth at the end by name."""


@dataclass(frozen=True)
class Study:
    """Runs of one experiment that differ in their seed."""

    name: str
    outcomes: tuple[Outcome, ...]
    limits: tuple[float, float] | None = None
    """Where the mean NEES must lie; None: its 95 % interval over the seeds."""

    def values(self, name: str) -> np.ndarray:
        """A figure of every run; NaN where it is unknown."""
        return np.array(
            [math.nan if o.figures[name] is None else o.figures[name] for o in self.outcomes]
        )

    @property
    def nees(self) -> float:
        """NEES averaged over the runs and the seeds."""
        return float(np.nanmean(self.values("nees_mean")))

    @property
    def nees_band(self) -> tuple[float, float]:
        """Where `nees` must lie."""
        dof = int(np.nanmax(self.values("nees_dof")))
        return self.limits or chi2_band(dof, len(self.outcomes))

    @property
    def is_consistent(self) -> bool:
        lo, hi = self.nees_band
        return lo <= self.nees <= hi and all(inside for *_, inside in self.calibrations())

    def calibrations(self) -> Iterable[tuple[str, float, tuple[float, float], bool]]:
        """By estimated component: the sum over the seeds of the squared normalised error at the
        end, its 95 % interval, and whether it lies inside."""
        known = [
            name
            for name, (_, sd, true) in self.outcomes[0].calibrations.items()
            if math.isfinite(true) and sd > 0
        ]
        n = len(self.outcomes)
        for name in known:
            ends = np.array([o.calibrations[name] for o in self.outcomes])
            total = float((((ends[:, 0] - ends[:, 2]) / ends[:, 1]) ** 2).sum())
            lo, hi = chi2_band(n)
            yield name, total, (lo, hi), lo <= total <= hi


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
        try:
            while frames is None or session.frame + 1 < frames:
                session.advance()
        except EndOfData:
            pass
        ends = session.metrics.series().calibrations
        calibrations = {
            name: (float(x[-1]), float(sd[-1]), math.nan if true is None else float(true[-1]))
            for name, (x, sd, true) in ends.items()
        }
        outcomes.append(Outcome(seed, report(session, math.inf), calibrations))
        done(outcomes[-1])
    return Study(experiment.name, tuple(outcomes), LIMITS.get(experiment.name))


HEAD = (
    f"{'scenario':<10}{'seeds':>6}{'NEES':>8}{'must lie in':>16}{'NIS':>7}"
    f"{'end error, median':>20}{'worst':>9}  consistent"
)


def row(s: Study) -> str:
    """One line of the table, and one more for every calibration that is estimated."""
    lo, hi = s.nees_band
    ends = s.values("pos_end_m")
    rows = [
        f"{s.name:<10}{len(s.outcomes):>6}{s.nees:>8.2f}{f'{lo:.2f} to {hi:.2f}':>16}"
        f"{np.nanmean(s.values('nis_mean')):>7.2f}{f'{np.median(ends):.4f} m':>20}"
        f"{ends.max():>7.3f} m  {'yes' if s.is_consistent else 'NO'}"
    ]
    for name, total, (low, high), inside in s.calibrations():
        rows.append(
            f"  {name}: squared normalised error {total:.1f}, must lie in {low:.1f} to {high:.1f}"
            f"{'' if inside else '  NO'}"
        )
    return "\n".join(rows)


@dataclass(frozen=True)
class Options:
    """Statistics of the scenarios over seeds. Exit code 1 when one is inconsistent."""

    names: tyro.conf.Positional[tuple[str, ...]] = ("cloister", "gyro", "line", "nomad", "room")
    """Scenarios."""
    seeds: int = 20
    """Seeds 0 to this, less one."""
    frames: int = 0
    """Frames of every run; 0: as many as each scenario is known for."""


def main(options: Options) -> int:
    """Print the table as it grows."""
    threadpool_limits(1)
    print(HEAD, flush=True)
    good = True
    for name in options.names:
        experiment = presets.build(name)

        def progress(outcome: Outcome, name: str = name) -> None:
            if sys.stderr.isatty():
                print(f"\r\x1b[K{name}, seed {outcome.seed}", end="", file=sys.stderr, flush=True)

        result = study(
            experiment, range(options.seeds), options.frames or FRAMES.get(name), progress
        )
        if sys.stderr.isatty():
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
        print(row(result), flush=True)
        good &= result.is_consistent
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
