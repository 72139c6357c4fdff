"""Every example runs, and shows what its first line promises."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

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


def test_no_example_is_left_out() -> None:
    tested = re.findall(r'"(\d\d_\w+\.py)"', Path(__file__).read_text(encoding="utf-8"))
    assert sorted(tested) == sorted(path.name for path in EXAMPLES.glob("*.py"))
