"""Which files of a folder are run: those whose text says that they declare a model."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from scene_core.models import registry
from scene_core.models.declared import declares_models
from scene_core.models.library import Library

EXAMPLES = Path(__file__).parents[2] / "examples"
FROM = "from scene_core.models.base import Sensor\n"


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path
    registry.add(registry.Added())


@pytest.mark.parametrize(
    "text",
    [
        f"{FROM}class A(Sensor): ...",
        "from scene_core.models.base import Sensor as S\nclass A(S): ...",
        "from scene_core.models.motion.arm import Arm\nclass A(Arm): ...",
        "import scene_core.models.base\nclass A(scene_core.models.base.Sensor): ...",
        "import scene_core.models.base as b\nclass A(b.Sensor): ...",
        "import scene_core\nclass A(scene_core.models.base.Sensor): ...",
        "import scene_core as sc\nclass A(sc.models.base.Sensor): ...",
        "from scene_core import models\nclass A(models.base.Sensor): ...",
        "from scene_core.models.base import *\nclass A(Sensor): ...",
        f"{FROM}class A(int, Sensor): ...",
        f"{FROM}class A(Sensor[int]): ...",
        f"{FROM}if True:\n    class A(Sensor): ...",
        f"{FROM}class A(Sensr): ...",
        f"{FROM}Base = Sensor\nclass A(Base): ...",
        f"{FROM}class A(Sensor):\n    def f(self:\n",
    ],
)
def test_a_class_of_a_model_says_so(folder: Path, text: str) -> None:
    file = folder / "mine.py"
    file.write_text(text, encoding="utf-8")
    assert declares_models(file)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "print('hello')",
        "x = (",
        "class A(Sensor): ...",
        f"{FROM}print(Sensor)",
        f"{FROM}class A: ...",
        f"{FROM}class A(Exception): ...",
        f"{FROM}class A: ...\nclass B(A): ...",
        f"{FROM}from typing import NamedTuple, Generic\nclass A(NamedTuple): ...\n"
        "class B(Generic[int]): ...",
        f"{FROM}import enum, collections\nclass A(enum.IntFlag): ...\n"
        "class B(collections.namedtuple('B', 'x')): ...",
        "from scene_core.models_of_mine import Sensor\nclass A(Sensor): ...",
        "from .models import Sensor\nclass A(Sensor): ...",
        "import scene_core\nclass A(scene_core.params.Spec): ...",
        "import numpy\nclass A(numpy.ndarray): ...",
    ],
)
def test_a_script_does_not(folder: Path, text: str) -> None:
    file = folder / "script.py"
    file.write_text(text, encoding="utf-8")
    assert not declares_models(file)


def test_every_example_is_what_it_is_called() -> None:
    there = {path.name: declares_models(path) for path in EXAMPLES.glob("*.py")}
    assert there == {name: name.startswith("my_") for name in there} and len(there) > 6


def test_scripts_beside_models_are_not_run(folder: Path) -> None:
    trace = folder / "it ran"
    (folder / "script.py").write_text(f"{FROM}open({str(trace)!r}, 'w')", encoding="utf-8")
    (folder / "mine.py").write_bytes((EXAMPLES / "my_sensor.py").read_bytes())
    library = Library(folder)
    assert [f.name for f in library.files] == ["mine.py"] and library.others == ("script.py",)
    (folder / "script.py").write_text(f"{FROM}open({str(trace)!r}, 'w')#", encoding="utf-8")
    said = library.refresh() + library.refresh()
    assert said == ("script.py declares no model: it was not run",) and not trace.exists()
    (folder / "script.py").unlink()
    assert library.refresh() == () and library.others == ()


def test_a_file_that_becomes_a_model_is_loaded_and_one_that_ceases_keeps_its_version(
    folder: Path,
) -> None:
    file, model = folder / "mine.py", (EXAMPLES / "my_sensor.py").read_bytes()
    file.write_bytes(b"x = 1")
    library = Library(folder)
    assert library.files == () and library.others == ("mine.py",)
    file.write_bytes(model)
    assert library.refresh() + library.refresh() == (
        "mine.py was saved: 'turned bearing' conforms",
    )
    file.write_bytes(b"1 / 0")
    (said,) = library.refresh() + library.refresh()
    assert said.startswith("mine.py defines no model") and "'turned bearing' stays" in said
    assert "turned bearing" in registry.models("sensors") and library.others == ()
