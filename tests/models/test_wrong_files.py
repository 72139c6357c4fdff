"""What a beginner does wrong in a file of models: each ends in one sentence, with the remedy."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from scene_core.models import registry
from scene_core.models.library import Library
from scene_core.models.missing import broken_import
from scene_core.models.plugins import in_time, load_file

EXAMPLES = Path(__file__).parents[2] / "examples"
MOTION, SENSOR, LANDMARK = (
    (EXAMPLES / f"my_{kind}.py").read_text("utf-8") for kind in ("motion", "sensor", "landmark")
)
STEP = "        phi = xv[2]"
"""Where a statement of the function f is put."""
SAYS = '    name, space = "polar point", TWO_D'
FROM = "from scene_core.models.base import MotionModel\n"


@pytest.fixture(autouse=True)
def only_built_in() -> Iterator[None]:
    yield
    registry.add(registry.Added())


def said(folder: Path, text: str | bytes) -> str:
    """The sentence about a file, or nothing."""
    file = folder / "mine.py"
    (folder / "other.py").touch()
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    found = in_time(file.name, lambda: load_file(file))
    return "".join([found.problem, *(model.problem for model in found.models)])


def changed(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            changed(MOTION, "import numpy as", "import nunpy as"),
            "line 5: ModuleNotFoundError: No module named 'nunpy'; did you mean numpy?",
        ),
        (
            changed(MOTION, "MotionModel,", "MotionModle,"),
            "line 8: ImportError: cannot import name 'MotionModle' from 'scene_core.models.base'; "
            "did you mean MotionModel?",
        ),
        (
            changed(MOTION, "scene_core.models.base", "scene_core.model.base"),
            "line 8: ModuleNotFoundError: No module named 'scene_core.model'; did you mean models?",
        ),
        (
            changed(MOTION, "(MotionModel)", "(MotionModell)"),
            "line 14: NameError: name 'MotionModell' is not defined; did you mean MotionModel?",
        ),
        (
            changed(MOTION, "import numpy as np", "import numpy as np\nimport other"),
            "line 6: ModuleNotFoundError: No module named 'other'; a file of models stands "
            "alone: write what it needs into it",
        ),
        (
            changed(MOTION, "import numpy as np", "import numpy as np\nfrom . import x"),
            "line 6: ImportError: attempted relative import with no known parent package; a file "
            "of models stands alone",
        ),
        (
            changed(MOTION, STEP, "\t" + STEP.strip()),
            "line 25: inconsistent use of tabs and spaces",
        ),
        (changed(MOTION, "    def Q(", "  def Q("), "line 28: unindent does not match any"),
        (MOTION.encode().replace(b"Wheel", b"Wh\xe4el"), "is not a text file: give a Python file"),
        (MOTION.replace("z", "\0"), "mine.py: source code string cannot contain null bytes"),
        (f"{FROM}x = {'-' * 200000}1", "mine.py is nested too deeply: write it plainly"),
        (
            "def make():\n    " + MOTION.replace("\n", "\n    "),
            "defines no model: derive a frozen dataclass from one of MotionModel, Sensor, "
            "FeatureModel, InternalMeasurementModel, not within a function",
        ),
        (
            changed(MOTION, "self, xv, u, dt, k):\n" + STEP, "self, xv, u, dt):\n" + STEP),
            "DifferentialDrive.f takes (self, xv, u, dt): write def f(self, xv, u, dt, k)",
        ),
        (
            changed(MOTION, "def f(self, xv", "def f(xv"),
            "DifferentialDrive.f takes (xv, u, dt, k): write def f(self, xv, u, dt, k)",
        ),
        (
            changed(MOTION, 'xv, hook="base")', "xv)"),
            "DifferentialDrive.xp takes (self, xv): write def xp(self, xv, hook='base')",
        ),
        (
            changed(MOTION, "f_noisy = noisy_process", "f_noisy = 0.1"),
            "f_noisy is 0.1, no function: write def f_noisy(self, xv, u, dt, k, rng)",
        ),
        (
            changed(MOTION, "    state_labels, state_units", "    state_label, state_units"),
            "DifferentialDrive does not say its state_labels: write state_labels for state_label",
        ),
        (
            changed(MOTION, '"m", "rad")', '"m", "deg")'),
            "units are known: state_units: no unit 'deg'; write e.g. m, rad",
        ),
        (
            changed(MOTION, STEP, f"        self.last = xv\n{STEP}"),
            "mine.py, line 25: raised FrozenInstanceError: cannot set self.last: a model is a "
            "value that remembers nothing",
        ),
        (
            changed(MOTION, STEP, f"        xv[2] += 0.1\n{STEP}"),
            "mine.py, line 25: raised ValueError: assignment destination is read-only",
        ),
        (
            changed(MOTION, STEP, f"        raise KeyboardInterrupt\n{STEP}"),
            "'differential drive'.f raised KeyboardInterrupt",
        ),
        (
            changed(MOTION, STEP, f"        yield 1\n{STEP}"),
            "'differential drive'.f returned generator, not Transition or an array",
        ),
        (
            changed(MOTION, "    f_noisy =", "    log: list = []\n    f_noisy ="),
            "ValueError: mutable default <class 'list'> for field log is not allowed: use",
        ),
        (
            changed(MOTION, "    f_noisy =", "    at: object = param(np.zeros(2))\n    f_noisy ="),
            "ValueError: mutable default <class 'numpy.ndarray'> for field at is not allowed",
        ),
        (
            changed(MOTION, "    f_noisy =", "    def __eq__(self, b): return 1\n    f_noisy ="),
            "equal parameters make equal models: == is 1 for two with the same parameters",
        ),
        (
            changed(MOTION, "    f_noisy =", "    hooks = 'base'\n    f_noisy ="),
            "labels are different texts: hooks is 'base'; write a tuple of texts",
        ),
        (
            changed(MOTION, "    f_noisy =", "    world_fixed = ('up',)\n    f_noisy ="),
            "world_fixed has 'up'; write gravity, north, plane",
        ),
        (
            MOTION + "\n\n" + MOTION[MOTION.index("@data") :].replace("class Diff", "class Other"),
            "'differential drive' is the name of a model before it: give it another",
        ),
        (changed(SENSOR, '"polar", 1', '"round", 1'), "no pane 'round'"),
        (changed(SENSOR, "((-np.pi, np.pi),)", "(-np.pi, np.pi)"), "limits has shape (2,), not"),
        (
            changed(LANDMARK, SAYS, f'{SAYS}\n    shape = "line"'),
            "shape is 'line'; write one of 'point', 'segment'",
        ),
        (
            changed(LANDMARK, SAYS, f"{SAYS}\n    def successor(self): return PolarPoint"),
            "successor() is a class; return one of it, PolarPoint()",
        ),
        (
            changed(LANDMARK, SAYS, f"{SAYS}\n    def successor(self): return 'Point'"),
            "successor() is 'Point'; return a landmark, e.g. Point3D()",
        ),
        (
            changed(LANDMARK, SAYS, f'{SAYS}\n    unmeasured = ("rho",)'),
            "the prior has shape (0,), not (1,)",
        ),
    ],
)
def test_what_is_wrong_is_one_sentence(tmp_path: Path, text: str | bytes, sentence: str) -> None:
    words = said(tmp_path, text)
    assert sentence in words and words.startswith(("mine.py", str(tmp_path))) and "\n" not in words


@pytest.mark.parametrize(
    "text",
    [
        b"\xef\xbb\xbf" + MOTION.encode(),
        MOTION.replace("\n", "\r\n").encode(),
        changed(MOTION, '"differential drive"', '"Fährt über Straßen"'),
        changed(MOTION, STEP, f"        print(dt)\n{STEP}"),
        f"{MOTION}\nAgain = DifferentialDrive\n",
    ],
    ids=["byte order mark", "line ends", "umlauts", "prints", "a second name"],
)
def test_what_is_not_wrong_is_taken(tmp_path: Path, text: str | bytes) -> None:
    assert said(tmp_path, text) == ""


def test_what_nobody_reads_is_noted(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        changed(
            MOTION, "    def Q(", "    hook = 1\n\n    def normalize(self, xv): ...\n\n    def Q("
        )
    )
    (model,) = load_file(tmp_path / "mine.py").models
    assert model.conforms and model.report is not None
    notes = [note for note in model.report.remarks if "nobody reads" in note]
    assert notes == [
        "nobody reads 'hook': is hooks meant?",
        "nobody reads 'normalize': is normalise meant?",
    ]


def test_what_the_model_itself_reads_is_not(tmp_path: Path) -> None:
    given, helped = "return PositionState(xv)", "return PositionState(self.normalised(xv))"
    helper = f"{helped}\n\n    def normalised(self, xv):\n        return xv"
    (tmp_path / "mine.py").write_text(changed(MOTION, given, helper))
    (model,) = load_file(tmp_path / "mine.py").models
    assert model.conforms and model.report is not None
    assert not [note for note in model.report.remarks if "nobody reads" in note]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("import nunpy\n", "line 1: ModuleNotFoundError: No module named 'nunpy'; did you mean nu"),
        (f"{FROM}x = 1\nimport scipyy.linalg", "line 3: ModuleNotFoundError: No module named 'sc"),
        (
            "from scenecore.models.base import MotionModel\nclass A(MotionModel): ...",
            "line 1: ModuleNotFoundError: No module named 'scenecore'; did you mean scene_core?",
        ),
        (
            "from scene_core.model.base import MotionModel\nclass A(MotionModel): ...",
            "line 1: ModuleNotFoundError: No module named 'scene_core.model'; did you mean models?",
        ),
        (
            changed(MOTION, "(MotionModel)", ""),
            "line 14: DifferentialDrive is no model: write class DifferentialDrive(MotionModel)",
        ),
        (
            "from scene_core.models.base import MotionModle",
            "line 1: ImportError: cannot import name 'MotionModle' from 'scene_core.models.base'; "
            "did you mean MotionModel?",
        ),
    ],
)
def test_a_file_that_looks_like_a_script_by_mistake_is_not_passed_over(
    tmp_path: Path, text: str, sentence: str
) -> None:
    file = tmp_path / "mine.py"
    file.write_text(text)
    library = Library(tmp_path)
    (found,) = library.files
    assert found.problem.startswith(f"mine.py, {sentence}") and library.others == ()
    file.write_text("print('a script')  # mended")
    assert library.refresh() + library.refresh() == ("mine.py declares no model: it was not run",)
    assert library.files == () and library.others == ("mine.py",)


@pytest.mark.parametrize(
    "text",
    [
        "try:\n    import nunpy\nexcept ImportError: ...",
        "def f():\n    import nunpy",
        "import neighbour, neighbours.inner, os.path, numpy.linalg, scene_core.models.base",
        "from scene_core.models import base, motion\nfrom scene_core.models.base import *",
        "import nunpy (",
    ],
)
def test_a_script_may_import_what_is_there_and_try_the_rest(tmp_path: Path, text: str) -> None:
    (tmp_path / "neighbour.py").touch()
    (tmp_path / "neighbours").mkdir()
    (tmp_path / "mine.py").write_text(text)
    assert broken_import(tmp_path / "mine.py") == ""


def test_a_folder_full_of_mistakes_leaves_the_good_file(tmp_path: Path) -> None:
    (tmp_path / "good.py").write_text(MOTION)
    (tmp_path / "folder.py").mkdir()
    (tmp_path / "nowhere.py").symlink_to(tmp_path / "none")
    (tmp_path / "round.py").symlink_to(tmp_path / "round.py")
    (tmp_path / "huge.py").write_text("# more\n" * 3_000_000)
    (tmp_path / "away.py").write_text(MOTION.replace("differential", "indifferent"))
    (tmp_path / "deep.py").write_text(f"{FROM}x = {'-' * 200000}1")
    library = Library(tmp_path)
    problems = {file.name: file.problem for file in library.files if file.problem}
    assert set(problems) == {"folder.py", "huge.py", "deep.py"}
    assert "Is a directory" in problems["folder.py"] and "at most 16 MB" in problems["huge.py"]
    assert {"differential drive", "indifferent drive"} <= set(registry.models("motion"))
    (tmp_path / "away.py").unlink()
    assert library.refresh() == ("away.py is gone: its models are not offered any more",)
    assert "indifferent drive" not in registry.models("motion")
