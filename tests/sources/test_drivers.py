"""Drivers: pure, on their way, and as lively as they say."""

from __future__ import annotations

import numpy as np
import pytest

from scene_core import params
from scene_core.filter.ports import SourceError
from scene_core.models import registry
from scene_core.models.base import MotionModel
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.motion.velocity_1d import Velocity1D
from scene_core.session import polymorphic
from scene_core.sources import wheel
from scene_core.sources.drivers import ConstantControls, Driver, Shuttle, Waypoints
from scene_core.sources.handheld import HandHeld
from scene_core.sources.simulated import Simulation, TrueRobot
from scene_core.sources.worlds import Field, Line, ThickCloister

DT = 1 / 30
each_motion = pytest.mark.parametrize(
    "cls", registry.built_in("motion").values(), ids=lambda c: c.name
)


def states(simulation: Simulation, robot: str, frames: int) -> np.ndarray:
    state, out = simulation.start(), []
    for k in range(frames):
        _, state = simulation.advance(state, k)
        out.append(state.xv[robot])
    return np.array(out)


def test_constant_controls_are_matched_by_label() -> None:
    drive = ConstantControls({"az": 0.2, "dx": 0.1}).drive(
        Odometry3D(), np.zeros(7), None, 1, 1.0, 0
    )
    np.testing.assert_array_equal(drive.u, [0.1, 0, 0, 0, 0, 0.2])


def test_shuttle_stays_between_its_ends() -> None:
    robot = TrueRobot(Velocity1D(), Shuttle(-1.0, 2.0, 0.5))
    z = states(Simulation(Line(), {"r": robot}, {}, dt=0.1), "r", 600)[:, 0]
    assert z.min() < -0.9 and z.max() > 1.9
    assert z.min() > -1.2 and z.max() < 2.2


@each_motion
def test_shuttle_drives_no_robot_that_it_watches_in_one_direction_only(
    cls: type[MotionModel],
) -> None:
    motion = cls()
    if motion.space.d == 1:
        return wheel.check_driver(Shuttle(), motion)
    words = f"'shuttle' can not drive '{motion.name}': it .*; choose another"
    with pytest.raises(SourceError, match=words):
        wheel.check_driver(Shuttle(), motion)


def test_waypoints_are_visited_in_order_for_ever() -> None:
    corners = ((2.0, 0.0), (2.0, 2.0), (-1.0, 1.0))
    robot = TrueRobot(PlanarNomad(), Waypoints(corners), noise_on="controls")
    at = states(Simulation(Field(), {"r": robot}, {}, dt=0.2), "r", 900)[:, :2]
    near = np.linalg.norm(at[:, None] - np.array(corners), axis=2) < 0.3
    visits = [int(np.argmax(row)) for row in near if row.any()]
    order = [a for a, b in zip(visits, [*visits[1:], -1], strict=True) if a != b]
    assert len(order) >= 6
    assert order == [k % 3 for k in range(len(order))]


def test_waypoints_may_be_moved_on_the_way() -> None:
    """The list is a setting: a shorter one is gone on with, an empty one stops the robot."""
    robot = TrueRobot(PlanarNomad(), Waypoints(((2.0, 0.0), (2.0, 2.0))), noise_on="controls")
    simulation = Simulation(Field(), {"r": robot}, {}, dt=0.2)
    state = simulation.start()
    for k in range(100):
        _, state = simulation.advance(state, k)
    other = params.replace(simulation, "robots.r.driver.points", [[-1.0, 1.0]])
    for k in range(100, 200):
        _, state = other.advance(state, k)
    assert np.linalg.norm(state.xv["r"][:2] - [-1.0, 1.0]) < 0.3
    none = params.replace(simulation, "robots.r.driver.points", [])
    _, after = none.advance(state, 200)
    np.testing.assert_array_equal(after.xv["r"], state.xv["r"])


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ([[1.0, 2.0], [1.0]], "row 2 has 1 numbers and row 1 has 2"),
        ([[1.0, float("nan")]], "row 1 = nan: give a finite number"),
        ([[1.0, 2e6]], r"row 1 = 2e.06 m is outside \[-100000, 100000\] m"),
        ([1.0, 2.0], "row 1 is 1.0: give a list of numbers"),
        ([[]], "row 1 is ..: give a list of numbers"),
        ("1, two", "give at most 1000 rows of numbers"),
        ([[0.0, 0.0]] * 1001, "give at most 1000 rows of numbers"),
    ],
)
def test_a_list_of_waypoints_that_makes_no_sense_is_refused(value: object, words: str) -> None:
    with pytest.raises(params.ParamError, match=words):
        params.replace(Waypoints(((1.0, 2.0),)), "points", value)


def test_waypoints_are_typed_as_they_are_written() -> None:
    points = ((1.5, -2.0), (0.0, 3.25))
    assert params.rows_text(points) == "1.5, -2; 0, 3.25"
    assert params.rows_typed("1.5, -2; 0, 3.25") == [list(p) for p in points]
    assert params.rows_typed("") == [] and params.rows_typed("1, x") == "1, x"


@pytest.mark.parametrize("memory", [None, 1.0, 0, 7, "elsewhere"])
def test_a_driver_takes_the_wheel_from_any_other(memory: object) -> None:
    nomad, cart = PlanarNomad(), Velocity1D()
    assert Waypoints(((1.0, 0.0), (2.0, 0.0))).drive(nomad, np.zeros(4), memory, 1, 0.1, 0).u[0] > 0
    assert Shuttle().drive(cart, np.zeros(1), memory, 1, 0.1, 0).u[0] == 0.5


@pytest.mark.parametrize("sd", [(1.0, 2.0), (3.0, 6.0)])
def test_a_hand_accelerates_as_the_estimator_believes(sd: tuple[float, float]) -> None:
    hand = HandHeld(sd_accel=sd[0], sd_ang_accel=sd[1])
    robot = TrueRobot(Impulse(), hand)
    xv = states(Simulation(ThickCloister(), {"r": robot}, {}, dt=DT, seed=2), "r", 1980)
    rates = np.diff(xv[:, 7:], axis=0) / DT
    rms = np.sqrt((rates**2).mean(0))
    np.testing.assert_allclose(rms, np.repeat(sd, 3), rtol=0.1)
    one_later = (rates[1:] * rates[:-1]).mean(0) / (rates**2).mean(0)
    assert np.abs(one_later).max() < 0.12


def test_a_hand_comes_back_to_where_it_started() -> None:
    hand = HandHeld()
    robot = TrueRobot(Impulse(), hand)
    xv = states(Simulation(ThickCloister(), {"r": robot}, {}, dt=DT), "r", 2 * 990 + 1)
    start = hand.start(Impulse(), DT)
    for lap in (990, 1980):
        assert np.linalg.norm(xv[lap, :3] - [start[s] for s in "xyz"]) < 0.6
        assert abs(xv[lap, 3:7] @ [start[s] for s in ("qw", "qx", "qy", "qz")]) > np.cos(0.2)
    assert np.ptp(xv[:, 0]) > 1.5


def test_a_hand_is_pure_and_needs_velocities() -> None:
    hand, xv = HandHeld(), np.zeros(13)
    xv[3] = 1.0
    a = hand.drive(Impulse(), xv, None, 7, DT, 5).push
    b = hand.drive(Impulse(), xv, None, 7, DT, 5).push
    np.testing.assert_array_equal(a, b)
    with pytest.raises(SourceError, match="'vx'"):
        hand.drive(Odometry3D(), np.eye(7)[3], None, 1, DT, 0)


def test_every_driver_there_is_can_be_recommended() -> None:
    found = polymorphic.variants(Driver)
    assert found is not None and set(wheel.DRIVERS) == set(found[1].values())


@each_motion
def test_a_driver_that_is_accepted_drives(cls: type[MotionModel]) -> None:
    """With a goal ahead, or the controls of an accepted default, nothing raises; a robot with
    waypoints moves."""
    motion = cls()
    xv, d = motion.lift(motion.space.identity()).xv, motion.space.d
    for driver in (kind() for kind in wheel.DRIVERS):
        try:
            wheel.check_driver(driver, motion)
        except SourceError:
            continue
        assert len(driver.drive(motion, xv, driver.memory0(), 1, DT, 0).u) == len(
            motion.control_labels
        )
    waypoints = Waypoints(((3.0, 2.0, 1.0)[:d],))
    if not motion.navigates:
        with pytest.raises(SourceError, match=f"'waypoints' can not drive '{motion.name}': it "):
            wheel.check_driver(waypoints, motion)
        return
    wheel.check_driver(waypoints, motion)
    at = xv
    for _ in range(30):
        at = motion.f(at, waypoints.drive(motion, at, 0, 1, DT, 0).u, DT, motion.calib0).fv
    assert np.abs(motion.xp(at).xp - motion.xp(xv).xp).max() > 1e-2


def test_truth_tells_where_a_robot_is_heading() -> None:
    driver = Waypoints(((1.0, 0.0), (1.0, 1.0)))
    simulation = Simulation(Field(), {"r": TrueRobot(PlanarNomad(), driver)}, {}, seed=1)
    state, goals = simulation.start(), []
    for k in range(80):
        frame, state = simulation.advance(state, k)
        assert frame.truth is not None
        goals.append(tuple(frame.truth.goals["r"].tolist()))
    assert goals[0] == (1.0, 0.0) and set(goals) == set(driver.points)
    assert Waypoints().goal(0) is None and ConstantControls().goal(None) is None
