"""Facts about what robots measure of themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from scene_core.geometry import quaternion
from scene_core.geometry.embedding import embed
from scene_core.geometry.spaces import TWO_D, wrap
from scene_core.models import registry
from scene_core.models.base import Fault
from scene_core.models.check import check
from scene_core.models.internal.accelerometer import Accelerometer
from scene_core.models.internal.compass import Compass
from scene_core.models.internal.height import Height
from scene_core.models.internal.roll_pitch import RollPitch
from scene_core.models.internal.steering_encoder import SteeringEncoder
from scene_core.models.internal.turret_encoder import TurretEncoder
from scene_core.models.internal.velocity import Velocity
from scene_core.models.internal.wheel_speed import WheelSpeed
from scene_core.models.internal.zero_velocity import ZeroVelocity
from scene_core.models.motion.double import Double
from scene_core.models.motion.inertial import Inertial
from scene_core.session import presets
from scene_core.session.config import InstrumentSettings
from scene_core.session.edits import with_seed
from scene_core.session.session import Session
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueInstrument

VARIANTS = [
    Accelerometer(gravity=(0.0, -9.81, 0.0)),
    Compass(up="y", forward="z", zero=3.0),
    Compass(component="phi", zero=-2.0),
    Compass(component="T"),
    Height(up="y", zero=1.5),
    RollPitch(up="y"),
    SteeringEncoder(component="S", zero=0.5),
    WheelSpeed(sd_slip=0.3),
    ZeroVelocity(turning=False),
]
DEFAULTS = [cls() for cls in registry.models("internal").values()]


def name(model):
    return f"{model.name} {' '.join(model.needs)}"


@pytest.mark.parametrize("model", VARIANTS, ids=name)
def test_instruments_conform_with_other_parameters(model):
    report = check(model, seed=3)
    assert report.ok, str(report)


@pytest.mark.parametrize("model", VARIANTS + DEFAULTS, ids=name)
def test_there_is_a_robot_for_every_instrument(model):
    motions = [cls() for cls in registry.models("motion").values()]
    assert any(registry.runs_on(model, motion) is None for motion in motions)


def turned(axis, angle):
    return quaternion.from_rotation_vector(angle * np.eye(3)["xyz".index(axis)])[0]


def test_a_compass_in_space_reads_the_heading_of_a_planar_robot():
    for up, forward in (("y", "z"), ("z", "x")):
        model = Compass(up=up, forward=forward)
        for phi in (-3.0, -0.4, 0.0, 1.2, 3.1):
            xp, _ = embed(np.array([2.0, -1.0, phi]), TWO_D, up)
            np.testing.assert_allclose(model.h(xp[3:]).hv, [phi], atol=1e-12)
            flat = Compass(component="phi").h(np.array([phi])).hv
            np.testing.assert_allclose(flat, [phi], atol=1e-12)


def test_a_compass_turns_over_at_the_back_and_counts_from_its_north():
    model = Compass(component="phi", zero=0.5)
    np.testing.assert_allclose(model.h(np.array([0.7])).hv, [0.2])
    np.testing.assert_allclose(model.nu(np.array([3.1]), np.array([-3.1])), [2 * np.pi - 6.2])


def test_a_compass_is_of_no_use_when_the_robot_looks_up():
    model = Compass()
    for tilt, fault in ((1.2, Fault.NONE), (1.5, Fault.INFEASIBLE)):
        q = turned("y", -tilt)
        assert model.feasible(q, model.h(q).hv) == fault
    upright = model.h(turned("y", -np.pi / 2))
    assert np.isfinite(upright.hv).all() and np.isfinite(upright.dhv).all()


@pytest.mark.parametrize(("up", "roll", "pitch"), [("y", "z", "x"), ("z", "x", "y")])
def test_roll_and_pitch_are_turns_about_forward_and_left_whatever_the_heading(up, roll, pitch):
    model, heading = RollPitch(up=up), turned(up, 0.8)
    for angle in (-1.0, 0.3):
        q = quaternion.product(heading, turned(roll, angle))
        np.testing.assert_allclose(model.h(q).hv, [angle, 0.0], atol=1e-12)
        q = quaternion.product(heading, turned(pitch, angle))
        np.testing.assert_allclose(model.h(q).hv, [0.0, angle], atol=1e-12)
    yaw = np.zeros(4)
    yaw[1 + "xyz".index(up)] = 1.0
    spin = 0.5 * quaternion.left_matrix(yaw) @ q  # dq of a turn about the vertical
    np.testing.assert_allclose(model.h(q).dhv @ spin, [0.0, 0.0], atol=1e-12)


def test_roll_and_pitch_are_not_read_from_a_robot_that_has_fallen_over():
    model = RollPitch()
    for lean, fault in ((1.3, Fault.NONE), (1.5, Fault.INFEASIBLE), (3.1, Fault.INFEASIBLE)):
        q = turned("x", lean)
        assert model.feasible(q, model.h(q).hv) == fault
        assert np.isfinite(model.h(q).dhv).all()


def test_an_accelerometer_at_rest_reads_up_and_in_free_fall_nothing():
    model, q = Accelerometer(), turned("x", np.pi / 2)  # left wing up
    np.testing.assert_allclose(model.h(np.r_[q, 0, 0, 0]).hv, [0, 9.81, 0], atol=1e-12)
    np.testing.assert_allclose(model.h(np.r_[q, 0, 0, -9.81]).hv, np.zeros(3), atol=1e-12)


def test_accelerometer_and_inertial_model_mean_the_same_force():
    """What it reads drives the inertial model to the acceleration that it was read at."""
    q = quaternion.from_rotation_vector(np.array([0.2, -0.7, 1.1]))[0]
    a, dt = np.array([0.4, -1.5, 0.8]), 0.1
    force = Accelerometer().h(np.r_[q, a]).hv
    model = Inertial()
    start = model.lift(np.r_[np.zeros(3), q]).xv
    moved = model.f(start, np.r_[force, np.zeros(3)], dt, np.zeros(0)).fv
    np.testing.assert_allclose(moved[7:10], a * dt, atol=1e-12)


def test_a_body_that_moves_ahead_feels_forward_velocity():
    q = turned("z", 0.9)
    v = 1.5 * np.array([np.cos(0.9), np.sin(0.9), 0.0])
    np.testing.assert_allclose(Velocity().h(np.r_[q, v]).hv, [1.5, 0, 0], atol=1e-12)


def test_wheels_slip_with_speed():
    model = WheelSpeed(sd=0.1, sd_slip=0.5)
    assert model.R(np.array([0.0]))[0, 0] == pytest.approx(0.01)
    assert model.R(np.array([-2.0]))[0, 0] == pytest.approx(1.01)


def test_rest_is_believed_only_when_it_is_likely():
    model = ZeroVelocity(most=0.1, most_turn=0.2)
    for needed, fault in (
        (np.r_[0.05, 0, 0.05, 0.1, 0, 0], Fault.NONE),
        (np.r_[0.1, 0, 0.1, 0, 0, 0], Fault.INFEASIBLE),
        (np.r_[0, 0, 0, 0.15, 0.15, 0], Fault.INFEASIBLE),
    ):
        assert model.feasible(needed, model.h(needed).hv) == fault
    still = replace(model, turning=False)
    assert still.measurement_size == 3
    assert registry.runs_on(model, Inertial()) is not None
    assert registry.runs_on(still, Inertial()) is None


def test_what_needs_the_worlds_directions_says_so():
    assert Compass().world_fixed == ("north", "gravity")
    assert RollPitch().world_fixed == Accelerometer().world_fixed == ("gravity",)
    assert SteeringEncoder().world_fixed == () == Velocity().world_fixed
    assert SteeringEncoder(component="S").world_fixed == ("north",)


def test_instruments_of_a_nomad_run_in_the_filter_and_tell_its_directions():
    """Without a sensor that sees landmarks, two encoders bound what dead reckoning lets grow."""
    models = {
        "wheels": SteeringEncoder(component="S", sd=0.01),
        "turret": TurretEncoder(sd=0.01),
        "north": Compass(component="T", sd=0.02),
    }
    base, unsure = presets.build("nomad"), {"S": 0.3, "T": 0.3}
    robot = replace(base.estimator.robots["nomad"], start_sd=unsure)
    estimator = replace(
        base.estimator,
        robots={"nomad": robot},
        mounts={},
        instruments={i: InstrumentSettings("nomad", m) for i, m in models.items()},
    )
    assert isinstance(base.source, Simulation)
    source = replace(
        base.source,
        robots={"nomad": replace(base.source.robots["nomad"], start_sd=unsure)},
        mounts={},
        instruments={i: TrueInstrument("nomad", m) for i, m in models.items()},
    )
    accepted, errors = [], []
    for seed in range(20):
        experiment = with_seed(replace(base, estimator=estimator, source=source), seed)
        session = Session(experiment)
        for _ in range(10):
            trace = session.advance()
            updates = [u for record in trace.records for u in record.internals]
            assert {u.instrument for u in updates} == set(models)
            accepted += [u.accepted for u in updates]
        gauss, truth = trace.world.gauss, trace.frame.truth
        assert truth is not None
        true = [truth.labels["robot:nomad"][s] for s in ("S", "T")]
        sd = np.sqrt(np.diag(gauss.cov("robot:nomad"))[2:])
        assert (sd < 0.01).all()
        errors.append(wrap(gauss.mean("robot:nomad")[2:] - true) / sd)
    assert np.mean(accepted) > 0.95
    low, high = chi2.ppf([0.005, 0.995], 40)
    assert low < np.sum(np.square(errors)) < high


def test_the_first_of_two_robots_keeps_its_instruments():
    assert registry.runs_on(TurretEncoder(), Double()) is None
