"""The runner: commands from any thread, publications, pace, and survival of every failure."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from scene_core import params
from scene_core.filter.ports import SourceError
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.session import presets
from scene_core.session.commands import (
    LoadPreset,
    Seek,
    Select,
    SetParam,
    SetSpeed,
    SwapModel,
    Transport,
)
from scene_core.session.config import Experiment
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session

SD = "estimator.robots.nomad.motion.sd_v"


def wait(
    runner: Runner, condition: Callable[[Published], bool], seconds: float = 10.0
) -> Published:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        p = runner.latest
        if condition(p):
            return p
        time.sleep(0.002)
    raise AssertionError(f"not within {seconds} s: {runner.latest.message}")


def frame(p: Published) -> int:
    return p.trace.frame.index if p.trace else -1


@pytest.fixture
def runner() -> Iterator[Runner]:
    with Runner(Session(presets.build("nomad"))) as r:
        yield r


def test_it_starts_paused_and_shows_the_scenario(runner: Runner) -> None:
    p = runner.latest
    assert p.mode == "paused" and p.trace is None and p.last_frame == -1
    assert p.presets == presets.loadable() and p.experiment is p.base
    assert len(p.series.times) == 0 and p.light.state == "unknown"


def test_play_pause_and_steps(runner: Runner) -> None:
    runner.post(Transport("step phase"))
    p = wait(runner, lambda p: p.trace is not None)
    assert p.trace is not None and not p.trace.complete and len(p.trace.records) == 1
    runner.post(Transport("step frame"))
    assert wait(runner, lambda p: bool(p.trace and p.trace.complete)).last_frame == 0
    runner.post(SetSpeed(math.inf))
    runner.post(Transport("play"))
    wait(runner, lambda p: frame(p) > 20)
    runner.post(Transport("toggle"))
    p = wait(runner, lambda p: p.mode == "paused")
    runner.post(Transport("back"))
    assert wait(runner, lambda q: frame(q) == frame(p) - 1).message.startswith("back at frame")
    runner.post(Seek(3))
    assert wait(runner, lambda q: frame(q) == 3).last_frame == p.last_frame
    runner.post(Transport("reset"))
    assert wait(runner, lambda q: q.trace is None).run == p.run + 1


def test_a_pause_shows_a_complete_frame(runner: Runner) -> None:
    runner.post(SetSpeed(math.inf))
    for action in ("pause", "toggle") * 6:
        before = frame(runner.latest)
        runner.post(Transport("play"))
        wait(runner, lambda p, before=before: p.mode == "playing" and frame(p) > before)
        runner.post(Transport(action))
        p = wait(runner, lambda p: p.mode == "paused")
        assert p.trace is not None and p.trace.complete
    runner.post(Transport("step phase"))
    p = wait(runner, lambda p: p.trace is not None and not p.trace.complete)
    assert p.trace is not None and len(p.trace.records) == 1


def test_what_was_published_while_playing_equals_a_batch_run(runner: Runner) -> None:
    runner.post(SetSpeed(math.inf))
    runner.post(Transport("play"))
    time.sleep(0.1)
    for _ in range(5):
        runner.post(Transport("step phase"))
    runner.post(Transport("play"))
    wait(runner, lambda p: frame(p) > 30)
    runner.post(Transport("pause"))
    wait(runner, lambda p: p.mode == "paused")
    runner.post(Transport("step frame"))
    p = wait(runner, lambda p: bool(p.trace and p.trace.complete))
    time.sleep(0.05)
    p = runner.latest
    batch = Session(presets.build("nomad"))
    while batch.frame < frame(p):
        batch.advance()
    assert p.trace is not None
    assert p.trace.world.gauss.P.tobytes() == batch.world.gauss.P.tobytes()


def test_an_edit_waits_then_is_in_force(runner: Runner) -> None:
    runner.post(Transport("step frame"))
    runner.post(SetParam(SD, 0.4))
    p = wait(runner, lambda p: p.pending is not None)
    assert params.get(p.experiment, SD) == 0.14 and p.can_undo
    runner.post(Transport("step frame"))
    p = wait(runner, lambda p: frame(p) == 1)
    assert p.pending is None and params.get(p.experiment, SD) == 0.4
    assert params.get(p.base, SD) == 0.14


def test_a_refused_command_is_a_message_and_nothing_stops(runner: Runner) -> None:
    runner.post(Transport("play"))
    wait(runner, lambda p: frame(p) > 1)
    for command in (
        SetParam(SD, 1e9),
        SetParam(SD, "a"),
        SwapModel("x", "y"),
        LoadPreset("no such"),
        LoadPreset("mrclam"),
        SetSpeed(0.0),
        SetSpeed(1e-300),
        SetSpeed(math.nan),
    ):
        before = runner.latest.seq
        runner.post(command)
        p = wait(runner, lambda p, before=before: p.seq > before and bool(p.message))
        assert p.mode == "playing" and p.failure is None
    now = frame(runner.latest)
    wait(runner, lambda p: frame(p) > now)


def test_select_and_load(runner: Runner) -> None:
    runner.post(Transport("step frame"))
    runner.post(Select(3))
    assert wait(runner, lambda p: p.selected == 3).selected == 3
    runner.post(LoadPreset("line"))
    p = wait(runner, lambda p: p.experiment.name == "line")
    assert p.selected is None and p.trace is None and p.run == 2


def test_the_end_of_the_data_finishes_the_run() -> None:
    short = dataclasses.replace(presets.build("line"), frames=3)
    with Runner(Session(short)) as runner:
        runner.post(SetSpeed(math.inf))
        runner.post(Transport("play"))
        p = wait(runner, lambda p: p.mode == "finished")
        assert frame(p) == 2 and p.failure is None and p.frame_count == 3
        runner.post(Transport("back"))
        assert frame(wait(runner, lambda p: p.mode == "paused")) == 1


def test_real_time_is_kept() -> None:
    with Runner(Session(presets.build("line")), playing=True) as runner:
        runner.post(SetSpeed(4.0))
        time.sleep(1.2)
        p = runner.latest
    assert p.real_time_factor == pytest.approx(4.0, rel=0.25)
    assert 25 < frame(p) < 55


@dataclasses.dataclass(frozen=True)
class Exploding(PlanarNomad):
    """A user's model that fails in one frame."""

    error: type[Exception] = ValueError

    def f(self, xv, u, dt, k):  # type: ignore[no-untyped-def]
        if dt and xv[1] < 2.3:
            raise self.error("on purpose")
        return super().f(xv, u, dt, k)


def with_motion(motion: PlanarNomad) -> Experiment:
    return params.put(presets.build("nomad"), "estimator.robots.nomad.motion", motion)


@pytest.mark.parametrize("error", [ValueError, np.linalg.LinAlgError, ZeroDivisionError, KeyError])
def test_a_model_that_raises_pauses_the_run(error: type[Exception]) -> None:
    with Runner(Session(with_motion(Exploding(error=error)))) as runner:
        runner.post(SetSpeed(math.inf))
        runner.post(Transport("play"))
        p = wait(runner, lambda p: p.failure is not None)
        assert p.mode == "paused" and p.trace is not None and p.trace.complete
        assert p.failure is not None and "on purpose" in p.failure.text
        assert f"Frame {frame(p) + 1} was dropped" in p.failure.text
        # The model lives outside the package: its author needs the traceback.
        assert "test_runner.py" in p.failure.text and "Traceback" in p.failure.details
        runner.post(Transport("back"))
        assert wait(runner, lambda q: frame(q) == frame(p) - 1).failure is None


def test_absurd_parameters_are_a_sentence_without_traceback() -> None:
    experiment = presets.build("cloister")
    with Runner(Session(experiment)) as runner:
        runner.post(Transport("step frame"))
        wait(runner, lambda p: frame(p) == 0)
        runner.post(SetParam("estimator.mounts.camera.sensor.sd_px", 1e-4))
        runner.post(SetParam("estimator.robots.robot.motion.sd_angle", 3.2))
        runner.post(SetParam("estimator.robots.robot.motion.sd_position", 10.0))
        runner.post(SetSpeed(math.inf))
        runner.post(Transport("play"))
        p = wait(runner, lambda p: p.failure is not None or frame(p) > 100)
        assert p.trace is not None
        assert np.isfinite(p.trace.world.gauss.P).all()
        if p.failure is not None:
            assert p.failure.details == "" and p.mode == "paused"
        runner.post(LoadPreset("line"))
        wait(runner, lambda p: p.experiment.name == "line" and p.failure is None)


def test_input_that_breaks_in_the_middle_pauses_the_run() -> None:
    good = presets.build("line").source

    class Torn:
        def __getattr__(self, name: str) -> object:
            return getattr(good, name)

        def advance(self, state: object, index: int) -> tuple[object, object]:
            if index == 3:
                raise SourceError("image 3 can not be read: remove it")
            return good.advance(state, index)

    experiment = dataclasses.replace(presets.build("line"), source=Torn())  # type: ignore[arg-type]
    with Runner(Session(experiment)) as runner:
        runner.post(SetSpeed(math.inf))
        runner.post(Transport("play"))
        p = wait(runner, lambda p: p.failure is not None)
        assert frame(p) == 2 and p.mode == "paused"
        assert p.failure is not None and p.failure.details == ""
        assert "image 3 can not be read: remove it." in p.failure.text


def test_publishing_is_cheap() -> None:
    session = Session(presets.build("line"))
    for _ in range(200):
        session.advance()
    runner = Runner(session)
    start = time.perf_counter()
    for _ in range(100):
        session.metrics.show(session.frame)
        runner._published()
    assert (time.perf_counter() - start) / 100 < 2e-3


def test_a_seek_outside_the_kept_history_is_a_message(runner: Runner) -> None:
    runner.post(Transport("step frame"))
    wait(runner, lambda p: frame(p) == 0)
    runner.post(Seek(7))
    p = wait(runner, lambda p: "frame 7 is not kept" in p.message)
    assert p.failure is None and frame(p) == 0
