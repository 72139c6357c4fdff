"""Whatever has controls finds its way to a goal, and comes to rest where it is."""

import numpy as np
import pytest

from scene_core.geometry import quaternion
from scene_core.models import registry
from scene_core.models.motion.ackermann import PlanarAckermann
from scene_core.models.motion.body_rates import BodyRates
from scene_core.models.motion.double import Double
from scene_core.models.motion.inertial import Inertial
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.sources.drivers import Waypoints

DT = 0.1
DRIVEN = [cls() for cls in registry.built_in("motion").values() if cls().control_labels]
OFF = {"planar ackermann": [6.0, 3.0], "arm": [-0.2, 0.1, 0.1]}
each_driven = pytest.mark.parametrize("model", DRIVEN, ids=lambda m: m.name)


def started(model):
    return model.lift(model.space.identity()).xv


def moved(model, xv, u):
    return model.normalise(model.f(xv, u, DT, model.calib0).fv).value


@each_driven
def test_it_reaches_a_goal_and_says_so(model):
    d = model.space.d
    xv, goal = started(model), np.array(OFF.get(model.name, [1.0, 0.5, 0.4][:d]))
    goal = goal + model.space.position(model.xp(xv).xp)
    for _ in range(400):
        u = model.navigate(xv, goal, DT)
        if u is None:
            break
        xv = moved(model, xv, u)
    else:
        pytest.fail(f"still on its way at {model.xp(xv).xp}")
    off = model.space.position(model.xp(xv).xp) - goal
    # On level ground a nomad can not leave the ground for a goal above it.
    off = off[[0, 2]] if model.name == "nomad on terrain" else off
    assert np.linalg.norm(off) <= getattr(model, "first", model).arrive


@each_driven
def test_it_comes_to_rest(model):
    xv = started(model)
    speeds = [i for i, unit in enumerate(model.state_units) if unit == "m/s"]
    xv[speeds] = 0.7
    for _ in range(100):
        xv = moved(model, xv, model.stay(xv, DT))
    np.testing.assert_allclose(moved(model, xv, model.stay(xv, DT)), xv, atol=1e-9)


def test_a_body_in_the_air_hovers_whatever_its_instruments_say_too_much():
    model = Inertial()
    xv = started(model)
    xv[3:7], xv[10:] = [0.8, 0.0, 0.6, 0.0], [0.1, -0.2, 0.05, 0.01, 0.02, -0.03]
    u = model.stay(xv, DT)
    np.testing.assert_allclose(moved(model, xv, u), xv, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(u[:3] - xv[10:13]), 9.81)


@pytest.mark.parametrize("dt", [0.01, 0.5, 2.0])
def test_a_body_in_the_air_brakes_without_swinging_however_long_a_step_is(dt):
    model, x = Inertial(), []
    xv = started(model)
    xv[7] = 0.4
    for _ in range(20):
        xv = model.f(xv, model.stay(xv, dt), dt, model.calib0).fv
        x.append(xv[7])
    assert np.all(np.diff(x) <= 1e-12) and x[-1] >= -1e-12


@pytest.mark.parametrize("cls", [Odometry3D, BodyRates, Inertial])
def test_a_body_turns_to_where_it_goes_in_one_line_and_stays_level(cls):
    goal, model = np.array([-2.0, 3.0, 0.5]), cls()
    xv = started(model)
    line = goal / np.linalg.norm(goal)
    while (u := model.navigate(xv, goal, DT)) is not None:
        xv = moved(model, xv, u)
        np.testing.assert_allclose(np.cross(line, xv[:3]), 0.0, atol=1e-9)
    ahead, _, up = quaternion.matrix(xv[3:7]).T
    np.testing.assert_allclose(up, [0, 0, 1], atol=1e-9)
    assert ahead[:2] @ goal[:2] == pytest.approx(np.hypot(*goal[:2]))


@pytest.mark.parametrize("cls", [Odometry3D, BodyRates, Inertial])
def test_a_body_keeps_its_orientation_on_the_way_up_or_where_it_is_told_to(cls):
    for model, goal in ((cls(), [0.05, -0.05, 2.0]), (cls(turn_rate=0.0), [-1.0, 2.0, 0.0])):
        xv = started(model)
        q = xv[3:7]
        while (u := model.navigate(xv, np.array(goal), DT)) is not None:
            xv = moved(model, xv, u)
        np.testing.assert_allclose(xv[3:7], q, atol=1e-12)


def test_one_of_two_waits_in_its_own_way():
    pair = Double(PlanarUnicycle(), PlanarAckermann())
    xv = started(pair)
    xv[6] = 0.5
    u = pair.navigate(xv, np.array([3.0, 0.0]), DT)
    far = np.r_[xv[:3], 3.0, 0.0, xv[5:]]
    assert u is not None and pair.navigate(far, np.array([3.0, 0.0]), DT)[2] == -1.0
    assert pair.stay(xv, DT).tolist() == [0.0, 0.0, -1.0, 0.0]


def test_a_driver_without_waypoints_does_not_let_it_fall():
    model = Inertial()
    drive = Waypoints().drive(model, started(model), 0, 0, DT, 0)
    np.testing.assert_allclose(drive.u, [0.0, 0.0, 9.81, 0.0, 0.0, 0.0])
