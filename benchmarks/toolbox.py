"""Our filter in the scenarios of Solà's toolbox: `python -m benchmarks.toolbox [--seeds N]`.

Each scenario is run as it is and with the axes carried through updates. The toolbox's own figures
were measured with its branch `ekf` in Octave, 400 frames, 3 or 5 seeds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import tyro
from threadpoolctl import threadpool_limits

from benchmarks.figures import machine
from scene_core import params
from scene_core.session import presets
from scene_core.session.config import Experiment
from scene_core.session.roles import LANDMARK, LINE, swapped
from scene_core.session.study import study

FRAMES = 400
INVARIANT = "estimator.policies.update.invariant"


@dataclass(frozen=True)
class Scenario:
    """One row, with the toolbox's own NEES (6 degrees of freedom) and error."""

    name: str
    preset: str
    theirs: tuple[tuple[float, float], ...]
    """NEES at the end and in the mean, for each robot."""
    end: tuple[float, ...]
    """Its error of the position in the last frame, m."""
    swap: tuple[str, str] | None = None
    """A landmark or line other than the preset's: role and name."""


SCENARIOS = (
    Scenario("points: inverse depth", "cloister", ((7.5, 8.8),), (0.014,)),
    Scenario(
        "points: anchored homogeneous",
        "cloister",
        ((8.0, 9.4),),
        (0.014,),
        (LANDMARK, "anchored homogeneous"),
    ),
    Scenario(
        "points: homogeneous",
        "cloister",
        ((201.8, 264.2),),
        (0.169,),
        (LANDMARK, "homogeneous point"),
    ),
    Scenario("two robots", "two_robots", ((5.5, 6.5), (8.8, 7.3)), (0.013, 0.014)),
    Scenario("two cameras on one robot", "two_cameras", ((6.4, 7.8),), (0.013,)),
    Scenario("omnidirectional camera", "omnidirectional", ((13.3, 10.3),), (0.023,)),
    Scenario("lines: Plücker", "house", ((39.7, 51.2),), (0.018,), (LINE, "Plücker line")),
    Scenario(
        "lines: anchored Plücker",
        "house",
        ((35.8, 29.9),),
        (0.019,),
        (LINE, "anchored Plücker line"),
    ),
    Scenario(
        "lines: inverse depth", "house", ((5.0, 5.2),), (0.009,), (LINE, "inverse depth line")
    ),
    Scenario("lines: homogeneous", "house", ((12.5, 13.9),), (0.012,), (LINE, "homogeneous line")),
    Scenario(
        "lines: anchored homogeneous",
        "house",
        ((8.1, 9.9),),
        (0.009,),
        (LINE, "anchored homogeneous line"),
    ),
)
HEAD = """\
| scenario | toolbox: NEES end, mean | end, m | ours: NEES end, mean | end, m \
| axes carried: NEES end, mean | end, m |
|---|---|---|---|---|---|---|"""
"""Of a Markdown table; `end` is the error of the position in the last frame."""


def experiment(scenario: Scenario, invariant: bool) -> Experiment:
    """The settings of a scenario."""
    base = presets.build(scenario.preset)
    role, name = scenario.swap or ("", "")
    after = base
    if role and params.get(base, role).name != name:
        after, _ = swapped(base, base, role, name)
    return params.replace(after, INVARIANT, invariant)


def row(scenario: Scenario, seeds: int) -> str:
    """A line of the table: means over the seeds, one value per robot; errors are medians."""
    cells = [
        scenario.name,
        "; ".join(f"{end:.1f}, {mean:.1f}" for end, mean in scenario.theirs),
        "; ".join(f"{end:.3f}" for end in scenario.end),
    ]
    for invariant in (False, True):
        cells += _ours(experiment(scenario, invariant), seeds)
    return f"| {' | '.join(cells)} |"


def _ours(settings: Experiment, seeds: int) -> Iterator[str]:
    result = study(settings, range(seeds), FRAMES)
    names = result.robots
    yield "; ".join(
        f"{np.mean(result.values(i, 'nees_end')):.1f}, {result.nees(i):.1f}" for i in names
    )
    yield "; ".join(f"{np.median(result.values(i, 'end')):.3f}" for i in names)


def main(seeds: int = 5) -> None:
    """Print the table as it grows.

    Args:
        seeds: Seeds 0 to this, less one.
    """
    threadpool_limits(1)
    print(machine() + f"; {seeds} seeds\n\n{HEAD}", flush=True)
    for scenario in SCENARIOS:
        print(row(scenario, seeds), flush=True)


if __name__ == "__main__":
    tyro.cli(main)
