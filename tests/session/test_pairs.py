"""Every sensor with every landmark it can see, every robot with every sensor it can carry and every
instrument that runs on it: initialised, observed and updated, and right in the end."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scene_core.filter.records import InternalUpdate, Trace
from scene_core.filter.world import Feature, World
from scene_core.geometry.numdiff import central_differences
from scene_core.models import registry
from scene_core.models.pairs import Fit, Pair, carriers, instruments, markdown, pairs
from scene_core.session import toml_io
from scene_core.session.config import (
    EstimatorSettings,
    Experiment,
    InstrumentSettings,
    MountSettings,
    RobotSettings,
)
from scene_core.session.session import Session
from scene_core.sources.drivers import ConstantControls, Waypoints
from scene_core.sources.scattered import RandomPlane, RandomWorld
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueInstrument, TrueMount, TrueRobot
from scene_core.sources.worlds import Line
from tests.pair_worlds import (
    a_landmark_for,
    a_starter_of,
    experiment,
    forward,
    landmark_named,
    sensor_named,
)
from tests.session.test_cli import run

FRAMES = 12
SETTLED = 20.0
"""Standard deviations. Particles take the error of the first view, which all of them share, for
news in every frame: what has settled is surer than right (a limit of Davison's method)."""
DOCS = Path(__file__).parents[2] / "docs"
SEEN = [p for p in pairs() if p.verdict != "refused"]
CARRIED = [f for f in carriers() if not f.reason]
FELT = [f for f in instruments() if not f.reason]


def positive(P: np.ndarray) -> bool:
    return bool(np.linalg.eigvalsh(P).min() > -1e-9 * max(np.abs(P).max(), 1.0))


def off(world: World, feature: Feature, true: np.ndarray) -> np.ndarray:
    """How far a landmark is from the truth, in standard deviations, by an equation that is zero
    where they agree: m - w p of a point (m, w), p x v - n of a line (n, v) and both its ends.
    """
    model, y = feature.model, world.gauss.mean(feature.block)
    d = model.space.d

    def equation(y: np.ndarray) -> np.ndarray:
        X = model.primitive(y[None]).X[0]
        if model.shape == "point":
            return X[:d] - X[d] * true
        (m1, w1), (m2, w2) = ((end[:d], end[d]) for end in np.split(X, 2))
        v, n = w1 * m2 - w2 * m1, np.cross(m1, m2)
        return np.concatenate([np.cross(p, v) - n for p in true])

    J = central_differences(equation, (y,), 0)
    e = equation(y)
    sd = np.sqrt(np.maximum(np.diag(J @ world.gauss.cov(feature.block) @ J.T), 0.0))
    return np.abs(e) / (sd + 1e-3)


def errors(trace: Trace) -> list[np.ndarray]:
    truth, world = trace.frame.truth, trace.world
    assert truth is not None
    points = dict(zip(truth.ids.tolist(), truth.points, strict=True))
    lines = dict(zip(truth.segment_ids.tolist(), truth.segments, strict=True))
    places = points | lines
    whole = [f for f in world.features.values() if f.particles is None]
    return [off(world, f, places[f.appearance]) for f in whole]


@pytest.mark.parametrize("pair", SEEN, ids=lambda p: f"{p.sensor}+{p.landmark}")
def test_a_pair_initialises_observes_and_updates(pair: Pair) -> None:
    landmark, sensor = landmark_named(pair.landmark), sensor_named(pair.sensor)
    sensors, first = {"sensor": sensor}, "sensor"
    if pair.verdict == "observes":
        sensors, first = {"starter": a_starter_of(landmark), "sensor": sensor}, "starter"
    session = Session(experiment(landmark, sensors, first))
    d2 = dof = 0.0
    updated: set[int] = set()
    born: set[str] = set()
    for _ in range(FRAMES):
        trace = session.advance()
        assert positive(trace.world.gauss.P)
        for record in trace.records:
            born |= {e.text.partition(" as ")[2] for e in record.events if e.kind == "born"}
            if record.phase != "update" or record.mount != "sensor":
                continue
            judged = [a for a in record.associations if a.verdict in ("accepted", "rejected")]
            updated |= {a.label for a in judged if a.verdict == "accepted"}
            whole = [a for a in judged if record.world.features[a.label].particles is None]
            d2 += sum(a.d2 or 0.0 for a in whole)
            dof += sum(a.dof for a in whole)
    assert session.trace is not None
    assert born and all(text.startswith(f"{landmark.name} at ") for text in born)
    assert len(updated) >= 2
    # One may have been linearised where it is not: a line along the way, a mirror image.
    found = sorted(float(e.max()) for e in errors(session.trace))
    limit = SETTLED if landmark.free_labels else 5.0
    assert all(e < limit for e in found[:-1]), found
    if dof > 20:
        assert 0.4 < d2 / dof < 1.8
    else:
        assert landmark.free_labels


def test_what_is_listed_is_what_is_run(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "models", "--json")
    assert code == 0
    listed = json.loads(out)["pairs"]
    supported = {(p["sensor"], p["landmark"]) for p in listed if p["supported"]}
    assert supported == {(p.sensor, p.landmark) for p in SEEN}
    refused = [p for p in pairs() if p.verdict == "refused"]
    assert {(p["sensor"], p["landmark"]): p["reason"] for p in listed if not p["supported"]} == {
        (p.sensor, p.landmark): p.reason for p in refused
    }
    assert all(f"'{p.sensor}'" in p.reason for p in refused)


def test_the_page_of_pairs_is_up_to_date(capsys: pytest.CaptureFixture[str]) -> None:
    """Otherwise: python app.py models --markdown > docs/pairs.md"""
    code, out, _ = run(capsys, "models", "--markdown")
    assert code == 0 and out == markdown()
    assert (DOCS / "pairs.md").read_text(encoding="utf-8") == out


def robot_with(motion_name: str, sensor_name: str) -> Experiment:
    """A robot with its defaults in the middle of a crowd of landmarks; nobody is at the wheel."""
    motion = registry.model_class("motion", motion_name)()
    sensor = sensor_named(sensor_name)
    crowd = {"1-D": Line(), "2-D": RandomPlane(count=60)}
    world = crowd.get(sensor.space.name, RandomWorld(count=300, height=3.0))
    up = "z" if motion.space.d == 3 else "y"
    base = experiment(a_landmark_for(sensor), {"sensor": sensor}, "sensor")
    pose = forward(sensor)
    # Both leave it where it is; in the air that takes controls.
    driver = Waypoints() if motion.navigates else ConstantControls()
    return Experiment(
        name="carrier",
        about="",
        estimator=EstimatorSettings(
            robots={"robot": RobotSettings(motion)},
            mounts={"sensor": MountSettings(sensor, "robot", pose)},
            policies=base.estimator.policies,
            up=up,
        ),
        source=Simulation(
            world=world,
            robots={"robot": TrueRobot(motion, driver)},
            mounts={"sensor": TrueMount(sensor, "robot", pose)},
            dt=0.03,
            up=up,
        ),
    )


@pytest.mark.parametrize("fit", CARRIED, ids=lambda f: f"{f.motion}+{f.part}")
def test_a_robot_carries_a_sensor(fit: Fit) -> None:
    session = Session(robot_with(fit.motion, fit.part))
    trace = [session.advance() for _ in range(4)][-1]
    assert positive(trace.world.gauss.P)
    assert session.metrics.totals()["accepted"] >= 3
    sees = [r.predictions for r in trace.records if r.phase == "select"]
    # The whole robot block is in H, whatever the motion model's size.
    size = trace.world.gauss.layout["robot:robot"].size
    assert all(p.H["robot:robot"].shape[-1] == size for seen in sees for p in seen if p.H)


@pytest.mark.parametrize("fit", FELT, ids=lambda f: f"{f.motion}+{f.part}")
def test_an_instrument_runs_on_a_robot(fit: Fit) -> None:
    motion = registry.model_class("motion", fit.motion)()
    sensor = next(f.part for f in CARRIED if f.motion == fit.motion)
    base = robot_with(fit.motion, sensor)
    model = registry.model_class("internal", fit.part)()
    assert isinstance(base.source, Simulation)
    text = toml_io.dumps(
        Experiment(
            name="instrument",
            about="",
            estimator=EstimatorSettings(
                robots=base.estimator.robots,
                mounts=base.estimator.mounts,
                policies=base.estimator.policies,
                instruments={"felt": InstrumentSettings("robot", model)},
                up=base.estimator.up,
            ),
            source=Simulation(
                world=base.source.world,
                robots=base.source.robots,
                mounts=base.source.mounts,
                instruments={"felt": TrueInstrument("robot", model)},
                dt=0.03,
                up=base.source.up,
            ),
        )
    )
    session = Session(toml_io.loads(text))
    felt: list[InternalUpdate] = []
    for _ in range(12):
        trace = session.advance()
        felt += [u for r in trace.records for u in r.internals]
        assert positive(session.world.gauss.P)
    assert len(felt) == 12
    # Either it has a meaning in this state and passes its gate, or the reason is said.
    accepted = [u for u in felt if u.accepted]
    feasible = [u for u in felt if u.why != "not feasible in this state"]
    assert all(u.why for u in felt if not u.accepted)
    assert len(accepted) >= 0.8 * len(feasible)
    assert sum(u.d2 for u in accepted) <= 3.0 * model.measurement_size * len(accepted)
    assert motion.state_size == session.world.gauss.layout["robot:robot"].size
