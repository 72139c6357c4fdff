"""Where the tests find recordings, and which tests need a browser."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
RECORDINGS = Path(os.environ.get("SCENE_RECORDINGS") or ROOT.parent / "shared" / "data")


def find_recording(name: str) -> Path:
    """Return the path of a file or folder among the recordings; skip the test when it is absent."""
    path = RECORDINGS / name
    if not path.exists():
        pytest.skip(f"no recording {name!r} in {RECORDINGS}: set SCENE_RECORDINGS to their folder")
    return path


@pytest.fixture(scope="session")
def recordings() -> Callable[[str], Path]:
    """`recordings("victoria_park")` is the path of a real recording."""
    return find_recording


@pytest.fixture(scope="session")
def golden() -> Callable[[str], Path]:
    """`golden("slamtb_functions.json")` is the path of reference values from elsewhere."""
    return lambda name: find_recording(f"golden/{name}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if (ROOT / "tests" / "browser") in item.path.parents:
            item.add_marker("browser")
