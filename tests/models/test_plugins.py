"""A user's files: loaded as often as they are saved, checked, and every fault is one sentence."""

from __future__ import annotations

import importlib.metadata
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from scene_core import params
from scene_core.models import plugins, registry
from scene_core.models.library import Library, Watcher, carried
from scene_core.models.plugins import load_file
from scene_core.params import ParamError

HEAD = """
from dataclasses import dataclass
import numpy as np
from scene_core.models.base import *
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.params import param

"""
MINE = '''@dataclass(frozen=True)
class Mine(PlanarUnicycle):
    name = "mine"
    extra: float = param(1.0, unit="m", lo=0.0, hi=9.0)
    """What it is for."""
'''


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path
    registry.add(registry.Added())


def write(folder: Path, text: str, name: str = "mine.py", head: str = HEAD) -> Path:
    file = folder / name
    file.write_text(head + text, encoding="utf-8")
    return file


def test_a_model_of_a_file_is_offered_beside_the_built_in_ones(folder: Path) -> None:
    write(folder, MINE)
    before = registry.models("motion")
    library = Library(folder)
    assert set(registry.models("motion")) == {*before, "mine"} and "mine" not in before
    model = registry.model_class("motion", "mine")()
    assert registry.kind_of(model) == "motion"
    (spec,) = [s for s in params.schema(model) if s.name == "extra"]
    assert spec.help == "What it is for."
    assert params.replace(model, "extra", 2.0) != model
    assert library.files[0].models[0].report is not None


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x = (", "mine.py, line 9: '(' was never closed"),
        ("1 / 0", "mine.py, line 9: ZeroDivisionError: division by zero"),
        ("import no_such_module", "mine.py, line 9: ModuleNotFoundError: No module named"),
        ("import sys; sys.exit(1)", "mine.py, line 9: SystemExit: 1"),
        ("raise KeyboardInterrupt", "mine.py, line 9: KeyboardInterrupt: "),
        ("x = 1", "mine.py defines no model: derive a frozen dataclass from one of MotionModel"),
        ("\0", "mine.py"),
    ],
)
def test_a_file_that_can_not_be_used_is_one_sentence(
    folder: Path, text: str, sentence: str
) -> None:
    file = load_file(write(folder, text))
    assert file.problem.startswith(sentence) and "\n" not in file.problem and not file.models


def test_a_file_that_is_no_text_is_one_sentence(folder: Path) -> None:
    (folder / "mine.py").write_bytes(b"\xff\xfe\x00")
    assert load_file(folder / "mine.py").problem.endswith(
        "mine.py is not a text file: give a Python file"
    )
    assert "can not be opened: No such file" in load_file(folder / "nowhere.py").problem


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("class A(PlanarUnicycle):\n    name = 'a'", "A is not frozen: write @dataclass"),
        (
            "@dataclass(frozen=True)\nclass A(MotionModel):\n    name = 'a'",
            "A is not complete: write Q, f, f_noisy, lift, redefine, xp",
        ),
        (
            "@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = 7",
            "A.name = 7: give a text",
        ),
        (
            f"@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = '{'a' * 99}'",
            "A.name is longer than 60 characters",
        ),
        (
            "@dataclass(frozen=True, kw_only=True)\nclass A(PlanarUnicycle):\n"
            "    name = 'a'\n    mass: float",
            "parameter 'mass' of A has no default: give it one, e.g. mass: float = param(0.1)",
        ),
        (
            "@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = 'a'\n"
            "    def __post_init__(self): raise ValueError('never')",
            "A can not be made: ValueError: never",
        ),
        (
            "@dataclass(frozen=True)\nclass A(RangeBearing):\n    name = 'a'\n"
            "    units = ('m', 'deg')",
            "'a' does not conform: units are known: units: no unit 'deg'; write e.g. m, rad",
        ),
        (
            "@dataclass(frozen=True)\nclass A(RangeBearing):\n    name = 'a'\n    units = ('m',)",
            "'a' does not conform: every label has a unit: 2 labels, 1 units",
        ),
        (
            "@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = 'a'\n"
            "    state_units = ('m', 'm')",
            "'a' does not conform: every label has a unit: 3 state_labels, 2 state_units",
        ),
        (
            "@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = 'a'\n"
            "    state_labels = ('z', 'z', 'phi')",
            "'a' does not conform: labels are different texts: state_labels has 'z' twice",
        ),
        (
            "@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = 'a'\n    space = '2-D'",
            "'a' does not conform: the space is 1-D, 2-D or 3-D: space is '2-D'; write ONE_D",
        ),
        (
            "@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = 'a'\n"
            "    slip: float = param(-1.0, lo=0.0)",
            "'a' does not conform: parameters start in their ranges: parameter slip = -1",
        ),
        (
            "@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = 'a'\n"
            "    def U(self, u, dt): return 1j * np.eye(2)",
            "'a' does not conform: Q, U and U_unknown are covariances: raised ModelError: mine.py, "
            "line 12: 'a'.U: U holds complex numbers",
        ),
        (
            "@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = 'a'\n"
            "    def U(self, u, dt): return u / [][0]",
            "'a' does not conform: Q, U and U_unknown are covariances: mine.py, line 12: raised "
            "IndexError: list index out of range",
        ),
        (
            "@dataclass(frozen=True)\nclass A(PlanarUnicycle):\n    name = 'impulse'",
            "'impulse' is the name of a built-in model: give it another",
        ),
    ],
)
def test_a_class_that_can_not_be_used_says_why_and_is_refused(
    folder: Path, text: str, sentence: str
) -> None:
    write(folder, text)
    write(folder, MINE, "other.py")
    library = Library(folder)
    (model,) = library.files[0].models
    line = 10 if text.startswith("@") else 9
    assert model.problem.startswith(f"mine.py, line {line}: {sentence}")
    assert not model.conforms and "\n" not in model.problem
    assert "mine" in registry.models("motion")
    assert registry.built_in("motion").items() <= registry.models("motion").items()
    if model.name != "impulse":
        assert registry.refused(model.kind)[model.name] == model.problem


def test_two_files_with_one_name_keep_the_first(folder: Path) -> None:
    write(folder, MINE, "a.py")
    write(folder, MINE, "b.py")
    library = Library(folder)
    assert [f.models[0].conforms for f in library.files] == [True, False]
    assert "is the name of a model of a.py" in library.files[1].models[0].problem
    (folder / "a.py").unlink()
    assert library.refresh() == ("a.py is gone: its models are not offered any more",)
    assert library.files[0].models[0].problem == "" and "mine" in registry.models("motion")


def test_saving_makes_a_new_class_beside_the_old_one(folder: Path) -> None:
    write(folder, MINE)
    library = Library(folder)
    old = registry.model_class("motion", "mine")
    assert library.refresh() == ()
    write(folder, MINE.replace("param(1.0", "param(2.0"))
    # It is loaded when it has looked the same twice.
    assert library.refresh() == () and registry.model_class("motion", "mine") is old
    assert library.refresh() == ("mine.py was saved: 'mine' conforms",)
    new = registry.model_class("motion", "mine")
    assert new is not old and (old().extra, new().extra) == (1.0, 2.0)
    assert library.refresh() == ()


def test_an_edited_parameter_is_carried_over_and_a_default_is_not(folder: Path) -> None:
    write(folder, MINE)
    Library(folder)
    old = registry.model_class("motion", "mine")
    write(folder, MINE.replace("param(1.0", "param(2.0").replace("hi=9.0", "hi=5.0"))
    Library(folder)
    new = registry.model_class("motion", "mine")
    after = carried(old(sd_v=0.7), new)
    assert type(after) is new and (after.sd_v, after.extra) == (0.7, 2.0)
    assert carried(old(extra=8.0), new).extra == 2.0, "outside its new range"


@pytest.mark.parametrize("raised", ["ValueError", "params.ParamError", "AssertionError"])
def test_edits_that_a_new_version_refuses_together_are_one_sentence(
    folder: Path, raised: str
) -> None:
    """Each is in its range, the defaults are good: only the new version's own check says no."""
    write(folder, MINE)
    Library(folder)
    edited = registry.model_class("motion", "mine")(extra=8.0, sd_v=0.7)
    refuses = f"""
    def __post_init__(self):
        if self.extra > 2.0:
            raise {raised}("more than 2 is too much")
"""
    write(folder, MINE + refuses, head="from scene_core import params\n" + HEAD)
    Library(folder)
    new = registry.model_class("motion", "mine")
    with pytest.raises(params.ParamError) as said:
        carried(edited, new)
    assert str(said.value) == (
        "'mine' can not take over sd_v = 0.7, extra = 8.0 from the 'mine' that is there, which "
        "stays: more than 2 is too much"
    )
    assert carried(registry.model_class("motion", "mine")(sd_v=0.7), new).sd_v == 0.7


@pytest.mark.parametrize("bad", ["x = (", "raise ValueError", MINE + "    def Q(self): ..."])
def test_a_broken_save_leaves_the_earlier_version(folder: Path, bad: str) -> None:
    write(folder, MINE)
    library = Library(folder)
    old = registry.model_class("motion", "mine")
    write(folder, bad)
    (said,) = library.refresh() + library.refresh()
    assert "mine.py" in said and "stays" in said
    assert registry.model_class("motion", "mine") is old
    assert "mine" not in registry.refused("motion")
    write(folder, MINE + "    # again\n")
    assert library.refresh() + library.refresh() == ("mine.py was saved: 'mine' conforms",)
    assert registry.model_class("motion", "mine") is not old


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParamError, match=r"--models .*nowhere: there is no such folder"):
        Library(tmp_path / "nowhere")


def test_a_file_that_never_ends_is_left_out(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "PATIENCE_S", 0.4)
    stop = folder / "stop"
    wait = f"while not __import__('os').path.exists({str(stop)!r}): __import__('time').sleep(0.01)"
    write(folder, MINE + wait, "a.py")
    write(
        folder, MINE + f"    def U(self, u, dt):\n        {wait}\n        return np.eye(2)", "b.py"
    )
    library = Library(folder)
    stop.touch()
    assert "a.py was left out: it was not loaded within" in library.files[0].problem
    assert "b.py was left out: 'mine'." in library.files[1].problem


def test_a_package_may_announce_its_models(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    write(folder, MINE, "packaged.py")
    monkeypatch.syspath_prepend(folder)
    entries = [
        importlib.metadata.EntryPoint("good", "packaged", "scene.models"),
        importlib.metadata.EntryPoint("one", "packaged:Mine", "scene.models"),
        importlib.metadata.EntryPoint("bad", "no_such_package", "scene.models"),
    ]
    monkeypatch.setattr(plugins, "entry_points", lambda group: entries)
    library = Library(None)
    assert [bool(f.problem) for f in library.files] == [False, False, True]
    assert "bad (no_such_package) can not be loaded" in library.files[2].problem
    assert "mine" in registry.models("motion")


def test_the_watcher_tells_about_a_save(folder: Path) -> None:
    write(folder, MINE)
    told: list[tuple[str, ...]] = []
    watcher = Watcher(Library(folder), told.append)
    watcher.start()
    write(folder, MINE + "    # more\n")
    end = time.monotonic() + 10.0
    while not told and time.monotonic() < end:
        time.sleep(0.02)
    watcher.stop()
    assert told == [("mine.py was saved: 'mine' conforms",)]
