"""The house's layers: the import contracts of `pyproject.toml` hold, and each can fail."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

LAYERS = ["arrays", "params", "geometry", "models", "filter", "sources", "session"]


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [Path(sys.executable).with_name("lint-imports"), "--no-cache", "--no-logo"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def empty_house(folder: Path) -> None:
    """Write the packages without their content, under the real contracts."""
    shutil.copy(ROOT / "pyproject.toml", folder)
    for package in ["web_panels", "scene_core", *(f"scene_core/{layer}" for layer in LAYERS)]:
        (folder / package).mkdir()
        (folder / package / "__init__.py").touch()


def test_the_contracts_hold() -> None:
    result = lint(ROOT)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("scene_core/sources/vision.py", "import cv2"),
        ("web_panels/image.py", "import cv2, viser, scene_core.session, scene_core.sources"),
        ("scene_core/session/cli.py", "import scene_core.arrays, scene_core.sources"),
    ],
)
def test_what_the_layers_allow(tmp_path: Path, module: str, line: str) -> None:
    empty_house(tmp_path)
    (tmp_path / module).write_text(line)
    result = lint(tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(
    ("module", "line", "contract"),
    [
        ("scene_core/models/bad.py", "import scene_core.filter", "Each layer"),
        ("scene_core/arrays/bad.py", "import scene_core.params", "Each layer"),
        ("scene_core/session/bad.py", "import web_panels", "complete without the page"),
        ("scene_core/sources/bad.py", "import viser", "complete without the page"),
        ("scene_core/filter/bad.py", "import cv2", "OpenCV"),
        ("scene_core/session/bad.py", "import cv2", "OpenCV"),
    ],
)
def test_what_the_layers_refuse(tmp_path: Path, module: str, line: str, contract: str) -> None:
    empty_house(tmp_path)
    (tmp_path / module).write_text(line)
    result = lint(tmp_path)
    assert result.returncode == 1
    broken = [row for row in result.stdout.splitlines() if row.endswith("BROKEN")]
    assert any(contract in row for row in broken), result.stdout + result.stderr
