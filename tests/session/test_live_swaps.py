"""Whatever there is can be swapped while a run goes on: the map stays, a sentence says the rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from scene_core import params
from scene_core.filter.ports import Frame, SourceError
from scene_core.filter.world import World
from scene_core.models import registry
from scene_core.models.lifting import common
from scene_core.models.motion.arm import Arm
from scene_core.params import ParamError
from scene_core.session import presets, toml_io
from scene_core.session.commands import SwapModel, Undo
from scene_core.session.config import MountSettings, RobotSettings
from scene_core.session.roles import NO_LINES, role_options
from scene_core.session.session import Session
from scene_core.sources.buildings import House
from scene_core.sources.simulated import Simulation

ROBOTS = {"line": "robot", "nomad": "nomad", "cloister": "robot"}
SENSORS = {"line": "range", "nomad": "scanner", "cloister": "camera"}
LAST = 9


@pytest.fixture(scope="module")
def runs() -> Iterator[dict[str, Session]]:
    """Sessions that have ten frames; every test starts from there."""
    sessions = {name: Session(presets.build(name)) for name in ROBOTS}
    for session in sessions.values():
        for _ in range(LAST + 1):
            session.advance()
    yield sessions


def at_ten(runs: dict[str, Session], preset: str) -> Session:
    session = runs[preset]
    session.seek(LAST)
    while session.settings.past:
        session.apply(Undo())
    return session


def positive(P: np.ndarray) -> bool:
    return bool(np.linalg.eigvalsh(P).min() > -1e-9 * np.abs(P).max())


def started(session: Session) -> World:
    """The world at the start of the next frame, after what waits for it."""
    session.step_phase()
    assert session.trace is not None
    return session.trace.start


def on(session: Session, frames: int) -> World:
    for _ in range(frames):
        session.advance()
        assert positive(session.world.gauss.P)
        assert np.isfinite(session.world.gauss.x).all()
    return session.world


def of_landmarks(world: World) -> np.ndarray:
    blocks = [world.gauss.layout[f.block] for f in world.features.values()]
    return np.concatenate([b.indices for b in blocks])


def same_map(before: World, after: World) -> None:
    old, new = of_landmarks(before), of_landmarks(after)
    assert before.features.keys() == after.features.keys() and len(old) > 0
    np.testing.assert_array_equal(after.gauss.x[new], before.gauss.x[old])
    np.testing.assert_array_equal(after.gauss.P[np.ix_(new, new)], before.gauss.P[np.ix_(old, old)])


def others(kind: str, preset: str) -> list[Any]:
    base = presets.build(preset).estimator
    now = {
        "motion": base.robots[ROBOTS[preset]].motion,
        "sensors": base.mounts[SENSORS[preset]].sensor,
        "features": base.policies.landmark,
    }[kind]
    models = [cls() for cls in registry.models(kind).values()]
    return [m for m in models if m.space is now.space and m.name != now.name]


def cases(kind: str) -> list[Any]:
    return [
        pytest.param(preset, model, id=f"{preset}:{model.name}")
        for preset in ROBOTS
        for model in others(kind, preset)
    ]


@pytest.mark.parametrize(("preset", "motion"), cases("motion"))
def test_a_motion_model_is_swapped_each_way(
    runs: dict[str, Session], preset: str, motion: Any
) -> None:
    session, robot = at_ten(runs, preset), ROBOTS[preset]
    role, block = f"estimator.robots.{robot}.motion", f"robot:{robot}"
    for name in (motion.name, presets.build(preset).estimator.robots[robot].motion.name):
        before = session.world
        session.apply(SwapModel(role, name))
        assert session.message.startswith("po") and "kept" in session.message
        after = started(session)
        old, new = before.robots[robot].motion, after.robots[robot].motion
        assert new.name == name and positive(after.gauss.P)
        same_map(before, after)
        # What both have in common keeps its rows, with the map and among itself.
        i, j = np.array(common(old, new)).T if common(old, new) else np.zeros((2, 0), dtype=int)
        i, j = i + after.gauss.layout[block].start, j + before.gauss.layout[block].start
        at, were = np.r_[i, of_landmarks(after)], np.r_[j, of_landmarks(before)]
        np.testing.assert_array_equal(
            after.gauss.P[np.ix_(at, at)], before.gauss.P[np.ix_(were, were)]
        )
        np.testing.assert_allclose(after.xp(robot), before.xp(robot), atol=1e-9)
        on(session, 4)


@pytest.mark.parametrize(("preset", "motion"), cases("motion"))
def test_the_true_motion_is_swapped_each_way(
    runs: dict[str, Session], preset: str, motion: Any
) -> None:
    session, robot = at_ten(runs, preset), ROBOTS[preset]
    role = f"source.robots.{robot}.motion"
    own = presets.build(preset).source.robots[robot].motion.name  # type: ignore[attr-defined]
    gauss = session.world.gauss
    try:
        session.apply(SwapModel(role, motion.name))
    except ParamError as e:
        assert "can not drive" in str(e) or "does not have" in str(e)
        assert session.pending is None
        return
    assert session.message.startswith("the truth: po")
    assert session.trace is not None and session.trace.frame.truth is not None
    was = session.trace.frame.truth.xp[robot]
    assert started(session).gauss is gauss
    assert session.trace is not None and session.trace.frame.truth is not None
    now = session.trace.frame.truth
    assert set(now.labels[f"robot:{robot}"]) == set(motion.state_labels)
    d = motion.space.d
    assert np.linalg.norm(now.xp[robot][:d] - was[:d]) < 0.5
    on(session, 4)
    session.apply(SwapModel(role, own))
    on(session, 3)
    # The same frames again are the same frames.
    there = session.world.gauss.x
    session.seek(session.frame - 4)
    np.testing.assert_array_equal(on(session, 4).gauss.x, there)


def test_a_true_robot_of_another_model_starts_where_the_first_did() -> None:
    base = presets.build("nomad")
    session = Session(base)
    on(session, 2)
    session.apply(SwapModel("source.robots.nomad.motion", "planar unicycle"))
    assert session.message == "the truth: pose kept; wheel direction S dropped"
    on(session, 2)
    assert toml_io.loads(toml_io.dumps(session.experiment)) == session.experiment
    session.reset()
    on(session, 1)
    assert session.trace is not None and session.trace.frame.truth is not None
    np.testing.assert_allclose(session.trace.frame.truth.xp["nomad"], [3.2, 2.4, -np.pi / 2])
    session.apply(SwapModel("source.robots.nomad.motion", "planar nomad"))
    assert session.settings.experiment == base


@pytest.mark.parametrize(("preset", "sensor"), cases("sensors"))
def test_a_sensor_is_swapped_each_way(runs: dict[str, Session], preset: str, sensor: Any) -> None:
    session, mount = at_ten(runs, preset), SENSORS[preset]
    role = f"estimator.mounts.{mount}.sensor"
    own = presets.build(preset).estimator.mounts[mount].sensor
    assert sensor.name in {r.role: r.options for r in role_options(session.experiment)}[role]
    before, accepted = session.world, session.metrics.totals()["accepted"]
    rejected = session.metrics.totals()["rejected"]
    session.apply(SwapModel(role, sensor.name))
    assert "poses and map kept" in session.message
    after = started(session)
    same_map(before, after)
    np.testing.assert_array_equal(after.gauss.P, before.gauss.P)
    source = session.running.source
    assert isinstance(source, Simulation)
    true = source.mounts[mount].sensor
    if sensor.labels == own.labels:
        assert true.name == own.name
    else:
        assert true.name == sensor.name and "the estimator and the truth" in session.message
        landmark = session.running.estimator.policies.landmark
        assert (registry.compatible(after.mounts[mount].sensor, landmark) is None) or (
            "starts no landmarks" in session.message
        )
        on(session, 6)
        totals = session.metrics.totals()
        # The map is seen where it is.
        assert totals["accepted"] - accepted >= 5
        assert totals["rejected"] - rejected <= 0.4 * (totals["accepted"] - accepted)
    session.apply(SwapModel(role, own.name))
    on(session, 3)
    assert params.get(session.experiment, role) == own


@pytest.mark.parametrize(("preset", "landmark"), cases("features"))
def test_new_landmarks_come_in_another_parametrisation(
    runs: dict[str, Session], preset: str, landmark: Any
) -> None:
    session = at_ten(runs, preset)
    if landmark.shape == "segment":
        role, own = "estimator.policies.line", NO_LINES
    else:
        role = "estimator.policies.landmark"
        own = session.experiment.estimator.policies.landmark.name
    (options,) = (r.options for r in role_options(session.experiment) if r.role == role)
    assert landmark.name in options
    sensor = session.world.mounts[SENSORS[preset]].sensor
    before = session.world
    reason = registry.compatible(sensor, landmark)
    if reason is not None:
        with pytest.raises(ParamError) as refused:
            session.apply(SwapModel(role, landmark.name))
        assert str(refused.value) == reason and session.pending is None
        return
    session.apply(SwapModel(role, landmark.name))
    after = started(session)
    assert after.gauss is before.gauss
    if landmark.shape == "point":
        assert "stay as they are" in session.message
        assert after.policies.landmark.name == landmark.name
    on(session, 5)
    session.apply(SwapModel(role, own))
    on(session, 1)


@pytest.mark.parametrize("preset", ROBOTS)
def test_instruments_come_and_go(runs: dict[str, Session], preset: str) -> None:
    session, robot = at_ten(runs, preset), ROBOTS[preset]
    role = f"estimator.instruments:{robot}"
    motion = session.world.robots[robot].motion
    fits = {n for n, c in registry.models("internal").items() if not registry.runs_on(c(), motion)}
    rows = {r.role: r for r in role_options(session.experiment, session.base)}
    assert {o.removeprefix("add ") for o in getattr(rows.get(role), "options", ())} == fits
    for name in sorted(fits):
        session.apply(SwapModel(role, f"add {name}"))
        assert session.message == f"{robot} has a {name}, in belief and in truth"
        on(session, 1)
        assert session.trace is not None and name in session.trace.frame.internal
        assert name in session.world.instruments
    assert toml_io.loads(toml_io.dumps(session.settings.experiment)) == session.settings.experiment
    for name in sorted(fits):
        session.apply(SwapModel(role, f"remove {name}"))
    on(session, 1)
    assert not session.world.instruments
    wrong = sorted(set(registry.models("internal")) - fits)[0]
    with pytest.raises(ParamError, match=f"'{wrong}'"):
        session.apply(SwapModel(role, f"add {wrong}"))


def test_an_instrument_that_was_taken_off_comes_back_as_the_scenario_has_it() -> None:
    session = Session(presets.build("gyro"))
    session.advance()
    role = "estimator.instruments:hand"
    session.apply(SwapModel(role, "remove speedometer"))
    session.advance()
    (row,) = (r for r in role_options(session.experiment, session.base) if r.role == role)
    assert row.current == "gyro" and "add speedometer" in row.options
    assert "add speed" not in row.options
    session.apply(SwapModel(role, "add speedometer"))
    on(session, 1)
    assert session.experiment == session.base


def test_the_true_robot_keeps_what_its_instruments_need() -> None:
    session = Session(presets.build("gyro"))
    with pytest.raises(ParamError, match="can not drive '6-DoF odometry'"):
        session.apply(SwapModel("source.robots.hand.motion", "6-DoF odometry"))
    session.apply(SwapModel("source.robots.hand.driver", "manual"))
    with pytest.raises(ParamError, match="'gyro' would have nothing to measure: 'gyro' needs wx"):
        session.apply(SwapModel("source.robots.hand.motion", "6-DoF odometry"))
    session.apply(SwapModel("source.robots.hand.motion", "constant acceleration"))
    assert "acceleration" in session.message
    on(session, 3)


def test_a_sensor_in_pictures_stays_a_camera() -> None:
    session = Session(presets.build("room"))
    role = "estimator.mounts.camera.sensor"
    (row,) = (r for r in role_options(session.experiment) if r.role == role)
    assert "pinhole" in row.options and "depth camera" not in row.options
    with pytest.raises(ParamError, match="the input has u, v of 'camera': only a simulation"):
        session.apply(SwapModel(role, "depth camera"))


def test_a_pose_in_the_state_turns_with_the_axes_of_another_sensor() -> None:
    base = presets.build("cloister")
    sds = {"x": 0.05, "rx": 0.02, "ry": 0.03}
    session = Session(params.put(base, "estimator.mounts.camera.pose_sd", sds))
    on(session, 5)
    before = session.world
    session.apply(SwapModel("estimator.mounts.camera.sensor", "range-bearing-elevation"))
    after = started(session)
    same_map(before, after)
    space = after.mounts["camera"].sensor.space
    change = space.compose(
        space.inverse(before.mount_pose("camera")).x, after.mount_pose("camera")
    ).x
    # Its x is where the camera's z was, its z where the camera's -y was.
    forward, up = (space.to_world(change, np.r_[axis, 0.0]).X[:3] for axis in np.eye(3)[[0, 2]])
    np.testing.assert_allclose([forward, up], [[0, 0, 1], [0, -1, 0]], atol=1e-9)
    assert positive(after.gauss.P)
    on(session, 3)


def test_lines_stay_in_the_map_of_a_sensor_that_does_not_see_them() -> None:
    base = presets.build("cloister")
    source = replace(base.source, world=House())  # type: ignore[type-var]
    line = registry.model_class("features", "inverse depth line")()
    base = params.put(replace(base, source=source), "estimator.policies.line", line)
    session = Session(base)
    on(session, 4)
    n = len(session.world.features)
    assert n > 0
    session.apply(SwapModel("estimator.mounts.camera.sensor", "depth camera"))
    assert f"the {n} lines it can not measure stay in the map as they are" in session.message
    assert len(on(session, 2).features) == n


def test_a_hook_that_is_gone_is_said() -> None:
    base = presets.build("cloister")
    arm = RobotSettings(Arm())
    mount = base.estimator.mounts["camera"]
    hooked = MountSettings(mount.sensor, "robot", mount.pose, hook="joint 1")
    base = params.put(base, "estimator.robots.robot", arm)
    base = params.put(base, "estimator.mounts.camera", hooked)
    session = Session(base)
    with pytest.raises(ParamError, match="at the hook 'joint 1', which 'impulse' does not have"):
        session.apply(SwapModel("estimator.robots.robot.motion", "impulse"))


@dataclass(frozen=True)
class Broken:
    """A recording that says something wrong about itself."""

    inner: Simulation
    reading: tuple[float, ...]

    @property
    def frame_count(self) -> None:
        return None

    @property
    def frame_rate(self) -> float:
        return 10.0

    def start(self) -> Any:
        return self.inner.start()

    def advance(self, state: Any, index: int) -> tuple[Frame, Any]:
        frame, state = self.inner.advance(state, index)
        return replace(frame, internal={"gyro": np.array(self.reading)}), state

    def __getattr__(self, name: str) -> Any:
        return getattr(object.__getattribute__(self, "inner"), name)


@pytest.mark.parametrize("reading", [(0.1, 0.2), (0.1, 0.2, float("nan"))])
def test_a_reading_of_the_wrong_length_is_one_sentence(reading: tuple[float, ...]) -> None:
    base = presets.build("gyro")
    assert isinstance(base.source, Simulation)
    session = Session(replace(base, source=Broken(base.source, reading)))  # type: ignore[arg-type]
    with pytest.raises(
        SourceError, match=r"instrument 'gyro' was given \[0.1, 0.2.*needs 3 finite"
    ):
        session.advance()
    assert session.frame == -1


@pytest.mark.parametrize("name", ["depth camera", "stereo", "range-bearing-elevation"])
def test_particles_forget_what_another_sensor_taught_them(name: str) -> None:
    """What is learnt is in components of the measurement: (u, v) say nothing of (u, v, depth)."""
    session = Session(presets.build("particles"))
    while not any(f.learnt for f in session.world.features.values()):
        session.advance()
    open_before = {i: f for i, f in session.world.features.items() if f.particles is not None}
    session.apply(SwapModel("estimator.mounts.camera.sensor", name))
    trace = session.advance()
    assert open_before and not any(f.learnt for f in trace.start.features.values())
    for label, feature in open_before.items():
        assert trace.start.features[label].particles is feature.particles
    seen = session.world.mounts["camera"].sensor
    assert {a.h.shape for a in trace.associations()} == {(seen.measurement_size,)}
