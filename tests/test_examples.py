"""Every example runs, and shows what its first line promises."""

from __future__ import annotations

import re
import runpy
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scene_core.models import registry
from scene_core.models.features.inverse_depth_2d import PlanarInverseDepth
from scene_core.models.library import Library
from scene_core.session import presets
from scene_core.session.cli import main
from scene_core.session.commands import SwapModel
from scene_core.session.config import MountSettings
from scene_core.session.session import Session

EXAMPLES = Path(__file__).parent.parent / "examples"


def output(name: str, argument: int, capsys: pytest.CaptureFixture[str]) -> str:
    runpy.run_path(str(EXAMPLES / name))["main"](argument)
    return capsys.readouterr().out


def test_the_first_run_stays_inside_its_bounds(capsys: pytest.CaptureFixture[str]) -> None:
    text = output("01_first_run.py", 40, capsys)
    assert text.count(" inside") == 6 and "OUTSIDE" not in text


def test_a_model_wrong_on_purpose_leaves_the_band(capsys: pytest.CaptureFixture[str]) -> None:
    text = output("02_wrong_on_purpose.py", 60, capsys)
    right, wrong = (float(line.split()[-1]) for line in text.splitlines()[1:])
    assert right < 14.45 < wrong


def test_an_experiment_of_ones_own_is_estimated(capsys: pytest.CaptureFixture[str]) -> None:
    text = output("03_own_experiment.py", 60, capsys)
    pairs = re.findall(r"estimate ([-+.\d]+)  truth ([-+.\d]+)", text)
    assert len(pairs) == 3
    assert all(abs(float(a) - float(b)) < 0.1 for a, b in pairs)


def test_a_frame_by_phases_names_every_decision(capsys: pytest.CaptureFixture[str]) -> None:
    text = output("04_phases.py", 20, capsys)
    phases = ("predict", "internal", "select", "search", "associate", "update", "manage")
    assert [line.split()[0] for line in text.splitlines() if line[0] != " "][:-1] == list(phases)
    assert re.search(r"accepted, .*d2 = [\d.]+ < [\d.]+ \(2 DoF", text)


MINE = ["my_motion.py", "my_sensor.py", "my_landmark.py"]


@pytest.mark.parametrize("name", MINE)
def test_a_model_of_ones_own_conforms(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    main(["check", str(EXAMPLES / name)])
    out = capsys.readouterr().out
    assert "conforms" in out and "numeric: " in out and out.endswith("All conform.\n")
    assert ("unbatched: " in out) == (name == "my_sensor.py")
    assert len((EXAMPLES / name).read_text(encoding="utf-8").splitlines()) < 40


@pytest.fixture
def mine(tmp_path: Path) -> Iterator[None]:
    for name in MINE:
        (tmp_path / name).write_bytes((EXAMPLES / name).read_bytes())
    Library(tmp_path)
    yield
    registry.add(registry.Added())


def test_ones_own_motion_and_landmark_take_over_in_the_middle(mine: None) -> None:
    session = Session(presets.build("nomad"))
    for _ in range(10):
        session.advance()
    session.apply(SwapModel("estimator.robots.nomad.motion", "differential drive"))
    session.apply(SwapModel("estimator.policies.landmark", "polar point"))
    features = len(session.world.features)
    for _ in range(100):
        session.advance()
    assert session.world.robots["nomad"].motion.name == "differential drive"
    assert {"2-D point", "polar point"} <= {f.model.name for f in session.world.features.values()}
    assert len(session.world.features) > features and session.metrics.totals()


def test_ones_own_sensor_finds_out_how_it_is_turned(mine: None) -> None:
    sensor = registry.model_class("sensors", "turned bearing")()
    experiment = presets.build("nomad")
    (name,) = experiment.estimator.mounts
    believed = experiment.estimator.mounts[name]
    mount = MountSettings(sensor, believed.robot, believed.pose, calib_sd={"turn": 0.1})
    true = replace(experiment.source.mounts[name], sensor=sensor, calib={"turn": 0.15})
    policies = replace(experiment.estimator.policies, landmark=PlanarInverseDepth())
    estimator = replace(experiment.estimator, mounts={name: mount}, policies=policies)
    source = replace(experiment.source, mounts={name: true})
    session = Session(replace(experiment, estimator=estimator, source=source))
    for _ in range(150):
        session.advance()
    block = session.world.mounts[name].calib_block
    error = session.world.gauss.mean(block)[0] - 0.15
    sd = float(np.sqrt(session.world.gauss.cov(block)[0, 0]))
    assert sd < 0.05 and abs(error) < 4.0 * sd


def test_no_example_is_left_out() -> None:
    tested = re.findall(r'"((?:\d\d|my)_\w+\.py)"', Path(__file__).read_text(encoding="utf-8"))
    assert sorted(set(tested)) == sorted(path.name for path in EXAMPLES.glob("*.py"))
