"""Prediction is as uncertain as it says, and the models work in a filter with a sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from scene_core.filter.ports import Control
from scene_core.filter.predict import robot_motion
from scene_core.filter.world import Robot
from scene_core.geometry.ellipses import chi2_band, nees
from scene_core.models.base import InternalMeasurement, InternalMeasurementModel, MotionModel
from scene_core.models.motion.ackermann import PlanarAckermann
from scene_core.models.motion.constant_acceleration import ConstantAcceleration
from scene_core.models.motion.head_mounted import HeadMounted
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.nomad_3d import TerrainNomad
from scene_core.models.motion.odometry_2d import PlanarOdometry
from scene_core.models.motion.zero_order import ZeroOrder
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.session import presets
from scene_core.session.config import (
    Experiment,
    InstrumentSettings,
    KnownFeature,
    MountSettings,
    RobotSettings,
)
from scene_core.session.session import Session
from scene_core.session.tracks import pose_error
from scene_core.sources.drivers import ConstantControls, Waypoints
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueInstrument, TrueMount, TrueRobot
from scene_core.sources.worlds import landmarks

TURNING = {"rot1": 0.05, "trans": 0.1, "rot2": 0.02, "a": 0.1, "delta_rate": 0.02, "v": 0.3}
TURNING |= {"dS": 0.03, "dT": 0.05}
"""Controls by label for whoever has them."""
CALM = {"x": 1.0, "phi": 0.4, "vx": 0.3, "vz": -0.2, "wy": 0.5, "wz": -0.3, "v": 1.0, "delta": 0.2}
CALM |= {"qw": 1.0, "qx": 0.2, "qz": -0.1, "ax": 0.1, "alphay": 0.2}
"""A start by label: somewhere, on the move."""
STEPS, DT, DRAWS = 12, 0.1, 200

MODELS = [
    PlanarOdometry(),
    PlanarAckermann(),
    TerrainNomad(),
    ZeroOrder(sd_speed=0.3, sd_turn=0.3),
    Impulse(sd_accel=0.5, sd_ang_accel=0.5),
    ConstantAcceleration(sd_accel=0.5, sd_ang_accel=0.5),
    HeadMounted(sd_turn=0.4),
]


def at(labels: tuple[str, ...], by_label: dict[str, float]) -> np.ndarray:
    return np.array([by_label.get(label, 0.0) for label in labels])


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
def test_pure_prediction_is_consistent(model: MotionModel) -> None:
    """NEES of the pose over draws of the noisy process against the filter's own prediction."""
    rng, k = np.random.default_rng(1), model.calib0
    u = at(model.control_labels, TURNING)
    xv0 = model.normalise(at(model.state_labels, CALM)).value
    controls = [Control(DT, model.control_labels, u)] * STEPS
    motion = robot_motion(Robot("r", model), xv0, k, controls)
    pose, space = model.xp(motion.xv), model.space
    assert pose.dxp_by_dxv is not None
    J = space.tangent_map(pose.xp) @ pose.dxp_by_dxv
    P = J @ motion.Q @ J.T
    values = []
    for _ in range(DRAWS):
        xv = xv0
        for _ in range(STEPS):
            xv = model.f_noisy(xv, u, DT, k, rng)
        values.append(nees(pose_error(space, pose.xp, model.xp(xv).xp), P))
    low, high = chi2_band(space.tangent, DRAWS, 0.999)
    assert low <= np.mean(values) <= high


@dataclass(frozen=True)
class Encoders(InternalMeasurementModel):
    """What a car shows its driver."""

    name = "wheel speed and steering angle"
    needs = ("v", "delta")
    labels = ("v", "delta")
    units = ("m/s", "rad")

    def h(self, needed: np.ndarray) -> InternalMeasurement:
        return InternalMeasurement(needed, np.eye(2))

    def R(self, hv: np.ndarray) -> np.ndarray:
        return np.diag([0.02**2, 0.01**2])


def planar(model: MotionModel, true: dict[str, float], driver: Waypoints, seed: int) -> Experiment:
    """The planar nomad's scenario with another robot, whose calibration is estimated."""
    base = presets.build("nomad")
    sensor = RangeBearing(sd_range=0.05, sd_bearing=0.02, reach_max=4.0)
    start = {"z": 3.2, "x": 2.4, "phi": -math.pi / 2}
    believed = RobotSettings(model, start, calib_sd=dict.fromkeys(true, 0.2))
    mount = (sensor, "robot", (0.0, 0.0, 0.0))
    assert isinstance(base.source, Simulation)
    return replace(
        base,
        seed=seed,
        estimator=replace(
            base.estimator, robots={"robot": believed}, mounts={"s": MountSettings(*mount)}
        ),
        source=replace(
            base.source,
            robots={"robot": TrueRobot(model, driver, start, calib=true)},
            mounts={"s": TrueMount(*mount)},
            seed=seed,
        ),
    )


ROUND = Waypoints(((3.2, -2.4), (-3.2, -2.4), (-3.2, 2.4), (3.2, 2.4)))


def test_a_car_finds_its_steering_scale_and_its_speed_scale() -> None:
    car = PlanarAckermann(wheelbase=0.4, cruise=0.6, sd_accel=0.1, sd_steer_rate=0.05)
    scales = {"speed scale": 0.9, "steering scale": 1.15}
    base = planar(car, scales, ROUND, seed=2)
    assert isinstance(base.source, Simulation)
    shown = {"encoders": InstrumentSettings("robot", Encoders())}
    felt = {"encoders": TrueInstrument("robot", Encoders())}
    session = Session(
        replace(
            base,
            estimator=replace(base.estimator, instruments=shown),
            source=replace(base.source, instruments=felt),
        )
    )
    for _ in range(250):
        session.advance()
    ends = session.metrics.series().calibrations
    for label, value in scales.items():
        mean, sd, true = ends[f"robot:robot:calib {label}"]
        assert true is not None and true[-1] == value and sd[-1] < 0.03
        assert abs(mean[-1] - value) < 3.5 * sd[-1]


def test_planar_odometry_keeps_to_its_map() -> None:
    session = Session(planar(PlanarOdometry(), {}, ROUND, seed=2))
    for _ in range(150):
        session.advance()
    robot = session.metrics.series().robots["robot"]
    assert robot.error is not None and robot.nees is not None
    assert np.hypot(*robot.error[-1, :2]) < 0.15
    assert np.nanmean(robot.nees) < 7.0


def spatial(model: MotionModel, controls: dict[str, float]) -> Experiment:
    """The toolbox's cloister, all of it known, seen by a camera on another body."""
    base = presets.build("cloister")
    start = {"y": -5.0, "qw": 1.0}
    pose = (0.0, 0.0, 0.6, 0.5, -0.5, 0.5, -0.5)
    if "S" in model.state_labels:  # Scene's axes: z forward, y up
        start |= dict(zip(("qw", "qx", "qy", "qz"), (0.5, 0.5, 0.5, 0.5), strict=True))
        pose = (0.0, 0.6, 0.0, 0.0, 0.0, 0.0, 1.0)
    camera = base.estimator.mounts["camera"].sensor
    assert isinstance(base.source, Simulation) and isinstance(camera, Pinhole)
    mount = (camera, "robot", pose)
    places = dict(zip(*(a.tolist() for a in landmarks(base.source.world)), strict=True))
    known = tuple(KnownFeature(tuple(place), i) for i, place in places.items())
    return replace(
        base,
        estimator=replace(
            base.estimator,
            known=known,
            robots={"robot": RobotSettings(model, start)},
            mounts={"camera": MountSettings(*mount)},
        ),
        source=replace(
            base.source,
            robots={"robot": TrueRobot(model, ConstantControls(controls), start)},
            mounts={"camera": TrueMount(*mount, margin=25.6)},
        ),
    )


@pytest.mark.parametrize(
    ("model", "controls"),
    [
        (TerrainNomad(slope=0.3), {"v": 0.5, "dS": 0.01, "dT": 0.01}),
        (ZeroOrder(sd_speed=0.5, sd_turn=0.3), {}),
        (ConstantAcceleration(sd_accel=0.3, sd_ang_accel=0.2), {}),
        (HeadMounted(sd_turn=0.3), {}),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_a_camera_on_it_finds_its_way_among_known_columns(
    model: MotionModel, controls: dict[str, float]
) -> None:
    session = Session(spatial(model, controls))
    for _ in range(25):
        session.advance()
    robot, totals = session.metrics.series().robots["robot"], session.metrics.totals()
    assert robot.nees is not None and robot.error is not None
    # After one step the ground has tilted the robot, but not yet moved it up or down.
    assert 2.0 < np.mean(robot.nees[2:]) < 10.0
    assert np.linalg.norm(robot.error[-1, :3]) < 0.1
    assert totals["accepted"] > 150 and totals["initialised"] == 0
