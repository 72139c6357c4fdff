"""A filter that believes something wrong is found out: by its NEES, its NIS, or both."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest

from scene_core.filter.policies import Vision
from scene_core.filter.ports import Frame, Match, Query
from scene_core.session import presets
from scene_core.session.config import Experiment
from scene_core.session.edits import set_params
from scene_core.session.study import study
from scene_core.sources.simulated import Simulation

SEEDS = range(2)


@dataclass(frozen=True)
class Mistaken(Simulation):
    """From frame `since` on every landmark on a line is taken for its neighbour."""

    since: int = 0

    def search(self, frame: Frame, query: Query, vision: Vision) -> list[Match]:
        matches = list(super().search(frame, query, vision))
        if frame.index < self.since:
            return matches
        z = {m.label: m.z for m in matches if m.z is not None}
        places = {a: z[b] for a, b in pairwise(sorted(z, key=lambda label: float(z[label][0])))}
        return [replace(m, z=places.get(m.label), why="no neighbour") for m in matches]


def coarse_line(since: int) -> Experiment:
    """A sensor whose standard deviation is half the way between two landmarks: no gate can tell."""
    experiment = set_params(
        presets.build("line"),
        {
            "estimator.mounts.range.sensor.sd": 0.5,
            "source.mounts.range.sensor.sd": 0.5,
        },
    )
    given = {f.name: getattr(experiment.source, f.name) for f in dataclasses.fields(Simulation)}
    return replace(experiment, source=Mistaken(**given, since=since))


def outcome(experiment: Experiment, frames: int) -> tuple[float, float, float]:
    """NEES, the upper end of its band, and NIS per degree of freedom."""
    result = study(experiment, SEEDS, frames)
    (name,) = result.robots
    nis = float(np.mean([one.nis for one in result.outcomes]))
    return result.nees(name), result.nees_band(name)[1], nis


@pytest.mark.parametrize(
    ("factor", "of_band", "nis_within"),
    [
        (0.2, (2.0, math.inf), (5.0, math.inf)),
        (1.0, (0.0, 1.0), (0.8, 1.2)),
        (5.0, (0.0, 1.0), (0.0, 0.1)),
    ],
)
def test_wrong_noise_is_seen_by_the_nis(
    factor: float, of_band: tuple[float, float], nis_within: tuple[float, float]
) -> None:
    """The scanner of the corridor believed five times better than it is, and five times worse."""
    sensor = "estimator.mounts.scanner.sensor"
    sds = {f"{sensor}.sd_range": 0.03, f"{sensor}.sd_bearing": 0.01}
    believed = {path: factor * sd for path, sd in sds.items()}
    nees, high, nis = outcome(set_params(presets.build("corridor"), believed), 60)
    assert of_band[0] < nees / high < of_band[1]
    assert nis_within[0] < nis < nis_within[1]


def test_a_wrong_calibration_is_seen_by_the_nees() -> None:
    """A focal length 3 % too long: the map fits the images all the same, in another size."""
    right = presets.build("cloister")
    nees, high, nis = outcome(right, 40)
    assert nees < high and 0.8 < nis < 1.2
    sensor = "estimator.mounts.camera.sensor"
    wrong = set_params(right, {f"{sensor}.f_u": 330.0, f"{sensor}.f_v": 330.0})
    nees, high, nis = outcome(wrong, 40)
    assert nees > 1.5 * high and 0.8 < nis < 1.3


def test_wrong_associations_are_seen_by_both() -> None:
    nees, high, nis = outcome(coarse_line(since=100), 100)
    assert nees < high and 0.8 < nis < 1.2
    nees, high, nis = outcome(coarse_line(since=20), 100)
    assert nees > 1.5 * high and nis > 2.0
