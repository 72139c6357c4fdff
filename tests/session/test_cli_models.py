"""`scene check` and `scene models`: reports for people, a list for programs, and exit codes."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from scene_core.models import registry
from scene_core.session import presets, toml_io
from scene_core.session.cli_models import pairs, table
from scene_core.session.commands import SwapModel
from scene_core.session.session import Session
from tests.session.test_cli import run

EXAMPLES = Path(__file__).parents[2] / "examples"
LANDMARK = "estimator.policies.landmark"
WRONG = """
from dataclasses import dataclass
import numpy as np
from scene_core.models.base import Transition
from scene_core.models.motion.unicycle import PlanarUnicycle

@dataclass(frozen=True)
class Wrong(PlanarUnicycle):
    name = "wrong"

    def f(self, xv, u, dt, k):
        return Transition(super().f(xv, u, dt, k).fv, np.eye(3) * 2.0)
"""


@pytest.fixture(autouse=True)
def only_built_in() -> Iterator[None]:
    yield
    registry.add(registry.Added())


def test_check_names_the_worst_entry_and_fails(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "wrong.py"
    file.write_text(WRONG, encoding="utf-8")
    code, out, err = run(capsys, "check", str(file))
    assert code == 1 and err == ""
    assert "wrong (motion): does not conform" in out and out.endswith("Not all conform.\n")
    assert re.search(r"FAIL f has .*dfv_by_dxv\[\d, \d\] is .*, central differences give ", out)
    assert "note numeric: dfv_by_dk, dfv_by_du by central differences" in out
    named = WRONG.replace('"wrong"', '"impulse"').replace("np.eye(3) * 2.0", "None")
    file.write_text(named, encoding="utf-8")
    code, out, _ = run(capsys, "check", str(file))
    assert code == 1 and "impulse (motion): conforms" in out
    assert "wrong.py, line 8: 'impulse' is the name of a built-in model: give it another" in out
    file.write_text("x = (", encoding="utf-8")
    code, out, _ = run(capsys, "check", str(file))
    assert code == 1 and out.startswith("wrong.py, line 1: '(' was never closed")


@pytest.mark.parametrize(
    ("args", "complaint"),
    [
        ("check", "check what? give a file with a model of your own, or --all"),
        ("check /nowhere.py", "/nowhere.py: there is no such file"),
        (f"check {EXAMPLES}", "examples: that is a folder; give a file in it"),
        (f"models --models {EXAMPLES}/my_motion.py", "my_motion.py: that is a file, not a folder;"),
        ("models --models /nowhere", "--models /nowhere: there is no such folder"),
        ("run --preset line --models /nowhere", "--models /nowhere: there is no such folder"),
    ],
)
def test_what_does_not_fit_is_one_sentence(
    args: str, complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run(capsys, *args.split())
    assert code == 2 and out == "" and err.count("\n") == 1 and complaint in err


def test_check_all_reports_every_built_in_model(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    few = {"motion": "1-D velocity", "sensors": "1-D distance", "features": "1-D point"}
    there = {k: {n: registry.built_in(k)[n]} for k, n in few.items()} | {"internal": {}}
    monkeypatch.setattr(registry, "built_in", lambda kind: there[kind])
    code, out, _ = run(capsys, "check", "--all")
    assert code == 0 and out.endswith("All conform.\n")
    assert [line for line in out.splitlines() if line.endswith(": conforms")] == [
        f"{name} ({kind}): conforms" for kind, name in few.items()
    ]


def test_the_list_has_every_model_and_every_pair(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "models", "--json")
    assert code == 0 and err == ""
    there = json.loads(out)
    keys = ["motion", "sensors", "landmarks", "internal", "policies", "presets", "pairs"]
    assert list(there) == keys and there == table()
    assert "impulse" in there["motion"] and "inverse depth" in there["landmarks"]
    assert there["presets"] == list(presets.PRESETS)
    assert "sequential" in there["policies"]["update"]
    assert len(there["pairs"]) == len(there["sensors"]) * len(there["landmarks"])


def test_pairs_say_why_not() -> None:
    by_name = {(p["sensor"], p["landmark"]): p for p in pairs()}
    assert by_name["pinhole", "inverse depth"]["supported"] is True
    assert by_name["pinhole", "inverse depth"]["reason"] == ""
    partly = by_name["pinhole", "Euclidean point"]
    assert partly["supported"] is True and partly["reason"].startswith("observing only: 'pinhole'")
    never = by_name["1-D distance", "Euclidean point"]
    assert never["supported"] is False and "measures 1-D points" in never["reason"]
    assert all(p["reason"] for p in by_name.values() if not p["supported"])


def test_the_table_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "models")
    assert code == 0 and out.startswith("motion\n") and "  update: stacked, sequential" in out
    assert "pinhole + Euclidean point: observing only" in out


def test_scripts_among_the_models_are_one_line_and_are_not_run(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A file that is given by name is tried all the same."""
    code, _, err = run(capsys, "models", "--models", str(EXAMPLES))
    others = "4 files declare no model and were not run (01_first_run.py, 02_wrong_on_purpose.py, "
    assert code == 0 and err.count("\n") == 1 and others in err
    script = tmp_path / "script.py"
    script.write_text("raise SystemExit('never')", encoding="utf-8")
    code, out, err = run(capsys, "models", "--models", str(tmp_path))
    assert code == 0 and err.endswith("1 file declares no model and was not run (script.py)\n")
    code, out, _ = run(capsys, "check", str(script))
    assert code == 1 and out.startswith("script.py, line 1: SystemExit: never")


def test_what_a_file_prints_is_not_in_the_list(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    loud = (EXAMPLES / "my_landmark.py").read_text("utf-8") + "\nprint('here I am')\n"
    (tmp_path / "loud.py").write_text(loud, encoding="utf-8")
    code, out, err = run(capsys, "models", "--json", "--models", str(tmp_path))
    assert code == 0 and "polar point" in json.loads(out)["landmarks"] and err == "here I am\n"


def test_a_run_with_a_model_of_ones_own(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "landmark.py").write_bytes((EXAMPLES / "my_landmark.py").read_bytes())
    broken = WRONG.replace("@dataclass", "1 / 0\n@dataclass")
    (folder / "broken.py").write_text(broken, encoding="utf-8")
    code, out, err = run(capsys, "models", "--json", "--models", str(folder))
    assert code == 0 and "polar point" in json.loads(out)["landmarks"]
    assert err == "scene: broken.py, line 7: ZeroDivisionError: division by zero\n"
    session = Session(presets.build("nomad"))
    session.apply(SwapModel(LANDMARK, "polar point"))
    settings = tmp_path / "mine.toml"
    toml_io.save(settings, session.settings.experiment)
    args = ("run", "--config", str(settings), "--frames", "20", "--json", "-")
    code, _, err = run(capsys, *args, "--models", str(tmp_path))
    assert code == 2 and "one of your own needs --models" in err
    code, out, err = run(capsys, *args, "--models", str(folder))
    assert code == 0 and err.startswith("scene: broken.py")
    assert json.loads(out)["frames"] == 20
