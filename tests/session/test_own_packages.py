"""An installed package that announces models: they are listed, checked and run like any other."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from scene_core.models import registry
from scene_core.models.library import Library
from scene_core.session import presets, toml_io
from scene_core.session.commands import SwapModel
from scene_core.session.session import Session
from tests.session.test_cli import run

MOTION = (Path(__file__).parents[2] / "examples" / "my_motion.py").read_text("utf-8")
ENTRIES = """[scene.models]
a_wheels = wheels_of_mine
b_broken = wheels_of_mine.broken
c_wrong = wheels_of_mine.wrong:DifferentialDrive
d_nowhere = wheels_of_mine.nowhere
e_number = wheels_of_mine.broken_not:X
f_more = wheels_of_mine.more:DifferentialDrive
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Installed as an installer does it: a folder of modules, and one that says what it brings."""
    about = tmp_path / "wheels_of_mine-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: wheels-of-mine\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(ENTRIES)
    package = tmp_path / "wheels_of_mine"
    package.mkdir()
    for name, text in {
        "__init__": MOTION,
        "broken": "\nimport nunpy\n",
        "broken_not": "X = 3",
        "wrong": MOTION.replace('"differential', '"wrong').replace("2 / self", "-2 / self"),
        "more": MOTION.replace('"differential', '"another'),
    }.items():
        (package / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield
    registry.add(registry.Added())


def test_what_is_wrong_is_a_sentence_and_the_others_go_on(package: None) -> None:
    files = Library(None).files
    assert [f.problem for f in files if f.problem] == [
        "b_broken (wheels_of_mine.broken) can not be loaded: broken.py, line 2: "
        "ModuleNotFoundError: No module named 'nunpy'",
        "d_nowhere (wheels_of_mine.nowhere) can not be loaded: ModuleNotFoundError: No module "
        "named 'wheels_of_mine.nowhere'",
        "e_number (wheels_of_mine.broken_not:X) defines no model: derive a frozen dataclass from "
        "one of MotionModel, Sensor, FeatureModel, InternalMeasurementModel, not within a "
        "function, with a name that does not begin with _",
    ]
    models = {model.name: model for file in files for model in file.models}
    assert {name for name, model in models.items() if model.conforms} == {
        "differential drive",
        "another drive",
    }
    assert "Q has the negative eigenvalue" in models["wrong drive"].problem
    assert "wrong drive" in registry.refused("motion")
    for name in ("differential drive", "another drive"):
        report = models[name].report
        assert report is not None and report.ok and len(report.lines) > 10


def test_a_scenario_runs_with_it_without_any_folder(
    package: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Library(None)
    session = Session(presets.build("nomad"))
    session.apply(SwapModel("estimator.robots.nomad.motion", "another drive"))
    settings = tmp_path / "mine.toml"
    toml_io.save(settings, session.settings.experiment)
    registry.add(registry.Added())
    args = ("run", "--config", str(settings), "--frames", "15", "--json", "-")
    code, out, err = run(capsys, *args)
    assert code == 0 and json.loads(out)["frames"] == 15
    assert err.count("\n") == 4 and "wrong drive" in err
    code, out, _ = run(capsys, "models", "--json")
    assert code == 0 and "differential drive" in json.loads(out)["motion"]
