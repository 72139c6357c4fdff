"""Facts about planar odometry and the car, and what planar robots share."""

import numpy as np
import pytest

from scene_core.models import planar
from scene_core.models.motion.ackermann import PlanarAckermann
from scene_core.models.motion.odometry_2d import PlanarOdometry
from scene_core.models.motion.unicycle import PlanarUnicycle

NONE = np.zeros(0)
NAMED = np.ones(2)
"""A car's calibration when its sensors tell the truth."""


def driven(model, xv, u, steps, dt, k):
    for _ in range(steps):
        xv = model.f(xv, u, dt, k).fv
    return xv


def test_odometry_turns_drives_and_turns_again():
    fv = PlanarOdometry().f(np.array([1.0, 2.0, np.pi / 2]), np.array([-np.pi / 2, 3, 1]), 9, NONE)
    np.testing.assert_allclose(fv.fv, [4.0, 2.0, 1.0], atol=1e-12)


def test_odometry_reports_the_chord_of_an_arc():
    """Half of the turn before the chord and half behind it: *Probabilistic Robotics*, 5.4."""
    xv, v, w, dt = np.array([0.3, -1.0, 2.9]), 0.7, -1.9, 0.8
    chord = v * dt * np.sinc(w * dt / 2 / np.pi)
    np.testing.assert_allclose(
        PlanarOdometry().f(xv, np.array([w * dt / 2, chord, w * dt / 2]), dt, NONE).fv,
        PlanarUnicycle().f(xv, np.array([v, w]), dt, NONE).fv,
        atol=1e-12,
    )


def test_odometry_noise_per_radian_and_per_metre():
    model = PlanarOdometry(
        rot_per_rad=0.1, rot_per_metre=0.05, trans_per_metre=0.1, trans_per_rad=0.02
    )
    U = model.U(np.array([0.5, 2.0, -1.0]), 0.1)
    np.testing.assert_allclose(U, np.diag([0.0125, 0.0405, 0.02]))
    np.testing.assert_array_equal(model.U(np.array([0.5, 2.0, -1.0]), 7.0), U)
    assert not model.U(np.zeros(3), 0.1).any() and model.U_unknown(0.1).diagonal().all()


@pytest.mark.parametrize("steps", [2, 300])
def test_a_car_drives_the_circle_its_wheels_point_to(steps):
    model = PlanarAckermann(wheelbase=2.5)
    v, delta = 1.5, 0.4
    radius = 2.5 / np.tan(delta)
    half = np.pi * radius / v
    there = driven(model, np.array([0, 0, 0, v, delta]), np.zeros(2), steps, half / steps, NAMED)
    np.testing.assert_allclose(there[:2], [0.0, 2.0 * radius], atol=1e-9)
    assert abs(there[2]) == pytest.approx(np.pi)
    back = driven(model, there, np.zeros(2), steps, half / steps, NAMED)
    np.testing.assert_allclose(back, [0, 0, 0, v, delta], atol=1e-9)


def test_a_car_brakes_on_the_way_that_it_takes():
    model, u = PlanarAckermann(), np.array([-2.0, 0.0])
    fv = driven(model, np.array([0, 0, 0, 6.0, 0]), u, 5, 0.6, NAMED)
    np.testing.assert_allclose(fv, [9.0, 0, 0, 0, 0], atol=1e-12)  # v^2 / 2a


def test_a_moving_steering_wheel_is_of_second_order_in_the_step():
    model, xv, u = PlanarAckermann(), np.array([0, 0, 0, 2.0, -0.3]), np.array([1.0, 0.8])
    exact = driven(model, xv, u, 4000, 1.0 / 4000, NAMED)
    errors = [
        np.abs(driven(model, xv, u, n, 1.0 / n, NAMED) - exact)[:3].max() for n in (10, 20, 40)
    ]
    assert errors[0] < 2e-3
    np.testing.assert_allclose(np.divide(errors[:2], errors[1:]), 4.0, rtol=0.05)


def test_a_cars_scales_are_true_over_shown():
    model = PlanarAckermann(speed_scale=0.9, steering_scale=1.1)
    shown, true = np.array([0, 0, 0.3, 2.0, 0.2]), np.array([0, 0, 0.3, 1.8, 0.22])
    moved = model.f(shown, np.zeros(2), 1.5, model.calib0).fv
    expected = PlanarAckermann().f(true, np.zeros(2), 1.5, NAMED).fv
    np.testing.assert_allclose(moved[:3], expected[:3], atol=1e-12)
    np.testing.assert_array_equal(moved[3:], shown[3:])
    bend = np.tan(0.22) / model.wheelbase
    unicycle = PlanarUnicycle().f(shown[:3], np.array([1.8, 1.8 * bend]), 1.5, NONE).fv
    np.testing.assert_allclose(moved[:3], unicycle, atol=1e-12)


def test_a_car_slips_by_the_way_and_not_by_the_step():
    model, xv = PlanarAckermann(sd_slip=0.02), np.array([0, 0, 0, -3.0, 0.1])
    whole = model.Q(xv, np.zeros(2), 1.0, NAMED)
    np.testing.assert_allclose(whole, 2.0 * model.Q(xv, np.zeros(2), 0.5, NAMED))
    assert whole[2, 2] == pytest.approx(3.0 * 0.02**2)
    assert np.count_nonzero(whole) == 1


@pytest.mark.parametrize(
    "goal",
    [(30, 0), (20, -15), (-25, 0), (0.5, 3.0), (-1.0, -1.5), (0, 8), (4, 2), (-0.8, 0)],
    ids=str,
)
@pytest.mark.parametrize("scale", [1.0, 1.3])
def test_a_car_finds_its_way_even_to_what_it_can_not_turn_to(goal, scale):
    model, dt = PlanarAckermann(steering_scale=scale), 0.1
    xv = np.array([0.0, 0.0, 0.0, 0.0, 0.0])
    for _ in range(600):
        u = model.navigate(xv, np.array(goal, dtype=float), dt)
        if u is None:
            break
        assert np.all(np.abs(u) <= [model.max_accel, model.max_steer_rate])
        xv = model.f(xv, u, dt, model.calib0).fv
        assert abs(xv[4]) <= model.max_steer + 1e-9
        assert -1e-9 <= xv[3] <= model.cruise + 1e-9
    else:
        pytest.fail(f"still at {xv}")
    assert np.hypot(*(xv[:2] - goal)) <= model.arrive


def test_odometry_steers_to_a_waypoint_behind_it():
    model, xv, goal = PlanarOdometry(), np.array([0.0, 0.0, 0.3]), np.array([-2.0, -1.0])
    u = None
    for _ in range(300):
        u = model.navigate(xv, goal, 0.1)
        if u is None:
            break
        assert abs(u[0]) <= 0.1 * model.turn_rate + 1e-12 and 0.0 <= u[1] <= 0.1 * model.cruise
        xv = model.f(xv, u, 0.1, NONE).fv
    assert u is None and np.hypot(*(xv[:2] - goal)) <= model.arrive


def test_a_goal_is_seen_from_the_robot():
    ahead = planar.goal_from(np.array([1.0, 1.0]), np.pi / 2, np.array([1.0, 4.0]), 0.1)
    assert ahead == pytest.approx((3.0, 0.0))
    left = planar.goal_from(np.zeros(2), -np.pi, np.array([0.0, -2.0]), 0.1)
    assert left == pytest.approx((2.0, np.pi / 2))
    assert planar.goal_from(np.zeros(2), 0.0, np.array([0.0, 0.1]), 0.1) is None


def test_a_robot_does_not_pass_its_goal_and_waits_until_it_is_ahead():
    assert planar.cruising(planar.Goal(0.06, 0.0), 0.0, 2.0, 0.1) == pytest.approx(0.6)
    assert planar.cruising(planar.Goal(9.0, 0.5), 0.5, 2.0, 0.1) == pytest.approx(2.0)
    assert planar.cruising(planar.Goal(9.0, 2.0), 0.3, 2.0, 0.1) == 0.0
