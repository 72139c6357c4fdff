"""A user's model in a running session: refused, swapped when saved, failing, hanging, abandoned."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from scene_core import params
from scene_core.models import guard, registry
from scene_core.models.library import Library
from scene_core.params import ParamError
from scene_core.session import presets, toml_io
from scene_core.session.commands import (
    Abandon,
    ModelsSaved,
    SetParam,
    SetSpeed,
    SwapModel,
    Transport,
    Undo,
)
from scene_core.session.config import Experiment
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session

ROLE = "estimator.robots.nomad.motion"
BUDGET = "estimator.policies.selection.budget"
TEXT = '''
import time
from dataclasses import dataclass
import numpy as np
from scene_core.models.base import Transition
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.params import param

FRAMES = []

@dataclass(frozen=True)
class Mine(PlanarUnicycle):
    name = "mine"
    extra: float = param(1.0, unit="m", lo=0.0, hi=9.0)
    """Something to turn."""

    def f(self, xv, u, dt, k):
        if abs(dt - 0.05) > 1e-9:  # the check's own interval is left in peace
            FRAMES.append(dt)
            if len(FRAMES) > 3:
                {trouble}
        return super().f(xv, u, dt, k)
'''


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path
    registry.add(registry.Added())


def write(folder: Path, trouble: str = "pass", name: str = "mine.py") -> None:
    (folder / name).write_text(TEXT.replace("{trouble}", trouble), encoding="utf-8")


def saved(library: Library, folder: Path, trouble: str) -> tuple[str, ...]:
    """What the library says after the file was saved again."""
    write(folder, trouble)
    return library.refresh() + library.refresh()


def wait(runner: Runner, condition: Callable[[Published], bool], seconds: float = 10) -> Published:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        p = runner.latest
        if condition(p):
            return p
        time.sleep(0.002)
    raise AssertionError(f"not within {seconds} s: {runner.latest.message}")


def frame(p: Published) -> int:
    return p.trace.frame.index if p.trace else -1


def planar() -> Experiment:
    """A scenario of a robot in the plane, in the kind of frames the file above waits for."""
    return presets.build("nomad")


def test_the_interval_of_the_scenario_is_not_that_of_the_check() -> None:
    assert abs(1.0 / planar().source.frame_rate - 0.05) > 1e-6


def test_a_conforming_model_is_offered_swapped_in_and_undone(folder: Path) -> None:
    write(folder)
    assert Library(folder).files[0].models[0].conforms
    session = Session(planar())
    session.advance()
    session.apply(SwapModel(ROLE, "mine"))
    session.advance()
    assert session.world.robots["nomad"].motion.name == "mine"
    session.apply(Undo())
    session.advance()
    assert session.world.robots["nomad"].motion.name == "planar nomad"


def test_a_model_that_fails_its_laws_is_refused_with_the_reason(folder: Path) -> None:
    text = TEXT.replace("super().f(xv, u, dt, k)", "Transition(xv, 2 * np.eye(3))")
    (folder / "mine.py").write_text(text, encoding="utf-8")
    Library(folder)
    session = Session(planar())
    with pytest.raises(
        ParamError, match=r"mine.py, line 12: 'mine' does not conform: .*dfv_by_dxv"
    ):
        session.apply(SwapModel(ROLE, "mine"))
    settings = toml_io.dumps(planar()).replace('"planar nomad"', '"mine"', 1)
    with pytest.raises(ParamError, match="does not conform"):
        toml_io.loads(settings)


def test_settings_name_a_users_model(folder: Path) -> None:
    write(folder)
    library = Library(folder)
    session = Session(planar())
    session.apply(SwapModel(ROLE, "mine"))
    session.apply(SetParam(f"{ROLE}.extra", 2.0))
    text = toml_io.dumps(session.settings.experiment, session.base)
    assert toml_io.loads(text) == session.settings.experiment
    saved(library, folder, "0")
    assert 'model = "mine"' in toml_io.dumps(session.settings.experiment)
    registry.add(registry.Added())
    with pytest.raises(ParamError, match="one of your own needs --models"):
        toml_io.loads(text)


def test_a_saved_file_runs_in_its_new_version_from_the_next_frame(folder: Path) -> None:
    write(folder)
    library = Library(folder)
    with Runner(Session(planar()), files=library.files) as runner:
        assert [f.name for f in runner.latest.files] == ["mine.py"]
        runner.post(SwapModel(ROLE, "mine"))
        runner.post(SetParam(f"{ROLE}.extra", 3.0))
        runner.post(Transport("step frame"))
        first = wait(runner, lambda p: frame(p) == 0)
        said = saved(library, folder, "FRAMES.clear()")
        assert said == ("mine.py was saved: 'mine' conforms",)
        runner.post(ModelsSaved(library.files, said))
        p = wait(runner, lambda p: "new version" in p.message)
        assert p.message.endswith("pose and map kept") and p.pending is not None
        runner.post(Transport("step frame"))
        second = wait(runner, lambda p: frame(p) == 1)
        assert first.trace and second.trace
        old = first.trace.world.robots["nomad"].motion
        new = second.trace.world.robots["nomad"].motion
        assert type(new) is not type(old) and new.name == old.name
        assert params.get(second.experiment, f"{ROLE}.extra") == 3.0
        runner.post(Undo())
        runner.post(Transport("step frame"))
        third = wait(runner, lambda p: frame(p) == 2)
        assert third.trace and third.trace.world.robots["nomad"].motion == old


def test_a_broken_save_changes_nothing_that_runs(folder: Path) -> None:
    write(folder)
    library = Library(folder)
    session = Session(planar())
    session.apply(SwapModel(ROLE, "mine"))
    session.advance()
    said = saved(library, folder, "return (")
    assert len(said) == 1 and said[0].startswith("mine.py, line ")
    assert session.renew(said) == 0 and session.message == said[0]
    session.advance()
    assert registry.model_class("motion", "mine") is type(session.world.robots["nomad"].motion)


@pytest.mark.parametrize(
    ("trouble", "words"),
    [
        ("raise KeyError('no wheels')", "KeyError: 'no wheels'"),
        ("return Transition(xv * np.nan)", "'mine'.f: fv is not finite"),
        ("return Transition(xv[:2])", "'mine'.f: fv has shape (2,), not (3,)"),
        (
            "return super().f(xv, u, dt, k)._replace(dfv_by_dxv=np.eye(4))",
            "'mine'.f: dfv_by_dxv has shape (4, 4), not (3, 3)",
        ),
        ("return None", "'mine'.f returned NoneType, not Transition"),
        ("raise SystemExit(3)", "called sys.exit(3)"),
    ],
)
def test_a_model_that_misbehaves_pauses_and_the_old_one_goes_on(
    folder: Path, trouble: str, words: str
) -> None:
    write(folder, trouble)
    Library(folder)
    with Runner(Session(planar())) as runner:
        runner.post(Transport("step frame"))
        wait(runner, lambda p: frame(p) == 0)
        runner.post(SwapModel(ROLE, "mine"))
        runner.post(SetSpeed(math.inf))
        runner.post(Transport("play"))
        p = wait(runner, lambda p: p.failure is not None)
        assert p.failure is not None and words in p.failure.text and p.mode == "paused"
        assert "mine.py" in p.failure.details and "Traceback" in p.failure.details
        good = frame(p)
        assert p.trace is not None and p.trace.complete and good > 0
        runner.post(Undo())
        runner.post(Transport("play"))
        p = wait(runner, lambda p: frame(p) > good + 5)
        assert p.failure is None and len(p.series.times) >= good
        assert p.trace and p.trace.world.robots["nomad"].motion.name == "planar nomad"


def test_a_call_that_hangs_is_named_abandoned_and_its_late_result_discarded(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("scene_core.session.runner.PATIENCE_S", 0.3)
    gate = folder / "open"
    is_open = f"__import__('os').path.exists({str(gate)!r})"
    hang = f"[time.sleep(0.02) for _ in iter(lambda: {is_open}, True)]"
    write(folder, hang)
    Library(folder)
    with Runner(Session(planar())) as runner:
        runner.post(Transport("step frame"))
        wait(runner, lambda p: frame(p) == 0)
        runner.post(Abandon())  # nothing hangs: nothing happens
        runner.post(SwapModel(ROLE, "mine"))
        runner.post(SetSpeed(math.inf))
        runner.post(Transport("play"))
        p = wait(runner, lambda p: p.busy is not None)
        assert p.busy is not None and (p.busy.model, p.busy.method) == ("mine", "f")
        stuck = runner._thread
        runner.post(Abandon())
        p = wait(runner, lambda p: p.failure is not None)
        assert p.failure is not None and "'mine'.f did not return" in p.failure.text
        assert "back to the model before it" in p.failure.text
        assert p.mode == "paused" and p.busy is None and runner._thread is not stuck
        good = frame(p)
        runner.post(Transport("play"))
        p = wait(runner, lambda p: frame(p) > good + 5)
        assert p.trace and p.trace.world.robots["nomad"].motion.name == "planar nomad"
        gate.touch()
        stuck.join(5.0)
        assert not stuck.is_alive() and guard.under_way(stuck.ident) is None
        runner.post(Transport("pause"))
        p = wait(runner, lambda p: p.mode == "paused")
        assert p.failure is None and p.trace is not None and p.trace.complete
        rows = len(p.series.times)
        assert rows == frame(p) + 1


def test_what_is_asked_for_while_a_call_hangs_is_not_done_after_it_was_abandoned(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who presses play while nothing answers, then abandons, still reads that it was abandoned."""
    monkeypatch.setattr("scene_core.session.runner.PATIENCE_S", 0.3)
    gate = folder / "open"
    is_open = f"__import__('os').path.exists({str(gate)!r})"
    write(folder, f"[time.sleep(0.02) for _ in iter(lambda: {is_open}, True)]")
    library = Library(folder)
    with Runner(Session(planar())) as runner:
        runner.post(SwapModel(ROLE, "mine"))
        runner.post(SetSpeed(math.inf))
        runner.post(Transport("play"))
        wait(runner, lambda p: p.busy is not None)
        budget = params.get(runner.latest.experiment, BUDGET)
        for command in (Transport("toggle"), SetParam(BUDGET, budget + 1), Transport("play")):
            runner.post(command)
        runner.post(ModelsSaved(library.files, ("mine.py was saved",)))
        runner.post(Abandon())
        p = wait(runner, lambda p: p.failure is not None and p.message == "mine.py was saved")
        assert p.failure is not None and p.failure.text.endswith(
            "; what was asked for meanwhile was not done."
        )
        seen = frame(p)
        time.sleep(0.3)
        p = runner.latest
        assert p.mode == "paused" and p.failure is not None and frame(p) == seen
        assert params.get(p.pending or p.experiment, BUDGET) == budget
        gate.touch()


def test_a_slow_call_that_comes_back_clears_its_notice(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("scene_core.session.runner.PATIENCE_S", 0.2)
    write(folder, "time.sleep(0.8)")
    Library(folder)
    with Runner(Session(planar())) as runner:
        runner.post(SwapModel(ROLE, "mine"))
        for _ in range(5):
            runner.post(Transport("step frame"))
        wait(runner, lambda p: p.busy is not None)
        assert wait(runner, lambda p: frame(p) == 4).busy is None
        time.sleep(0.3)
        assert runner.latest.busy is None


def test_without_a_model_before_it_the_page_says_what_to_do(folder: Path) -> None:
    write(folder)
    Library(folder)
    mine = registry.model_class("motion", "mine")
    robot = params.get(planar(), "estimator.robots.nomad")
    robot = dataclasses.replace(robot, motion=mine(), start={}, calib_sd={})
    session = Session(params.put(planar(), "estimator.robots.nomad", robot))
    session.advance()
    after = session.without(mine)
    assert after.frame == 0 and "choose one, or save a corrected file" in after.message
    assert session.without(registry.model_class("motion", "impulse")).message == session.message


def test_a_save_while_two_roles_use_the_model_swaps_both_and_the_truth(folder: Path) -> None:
    sensor = (
        "from dataclasses import dataclass\n"
        "from scene_core.models.sensors.range_bearing import RangeBearing\n\n"
        "@dataclass(frozen=True)\nclass Mine(RangeBearing):\n    name = 'mine'\n"
    )
    file = folder / "sensor.py"
    file.write_text(sensor, encoding="utf-8")
    library, session = Library(folder), Session(planar())
    roles = ("estimator.mounts.scanner.sensor", "source.mounts.scanner.sensor")
    for role in roles:
        session.apply(SwapModel(role, "mine"))
    session.advance()
    features = len(session.world.features)
    file.write_text(sensor + "# saved\n", encoding="utf-8")
    said = library.refresh() + library.refresh()
    assert session.renew(said) == 2 and session.message.count("new version") == 2
    session.advance()
    now = registry.model_class("sensors", "mine")
    assert all(type(params.get(session.experiment, role)) is now for role in roles)
    assert len(session.world.features) >= features and session.renew(()) == 0
