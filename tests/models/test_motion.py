"""Facts about the motion models."""

import numpy as np
import pytest

from scene_core.geometry import quaternion
from scene_core.models.base import Fault
from scene_core.models.internal.speed import Speed
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.motion.velocity_1d import Velocity1D

NONE = np.zeros(0)


def test_a_unicycle_closes_its_circle_whatever_the_step():
    model = PlanarUnicycle()
    for steps in (3, 1000):
        xv = np.array([1.0, -2.0, 0.4])
        for _ in range(steps):
            xv = model.f(xv, np.array([0.5, 0.3]), 2 * np.pi / 0.3 / steps, NONE).fv
        np.testing.assert_allclose(xv, [1.0, -2.0, 0.4], atol=1e-9)


@pytest.mark.parametrize("w", [0.0, 1e-12, 1e-4, 0.0999999, 0.1000001, -0.1])
def test_a_unicycles_series_meets_its_closed_form(w):
    model, dt = PlanarUnicycle(), 0.1  # the series takes over at w dt = 0.01
    xv, u = np.array([0.0, 0.0, 0.7]), np.array([1.3, w])
    expected = xv.copy()
    fine = 2000
    for i in range(fine):
        phi = xv[2] + w * dt * (i + 0.5) / fine
        expected[:2] += 1.3 * dt / fine * np.array([np.cos(phi), np.sin(phi)])
    np.testing.assert_allclose(model.f(xv, u, dt, NONE).fv[:2], expected[:2], atol=1e-12)


def test_noise_of_a_control_sample_does_not_depend_on_how_long_it_is_held():
    model = PlanarUnicycle(sd_v=0.1, sd_w=0.5)
    np.testing.assert_allclose(model.U(np.zeros(2), 0.01), np.diag([0.01, 0.25]))
    np.testing.assert_allclose(model.U(np.ones(2), 1.0), np.diag([0.01, 0.25]))


def test_odometry_drives_the_toolboxs_circle():
    # 0.08 m and 0.9 degrees per step: 400 steps are one lap of radius 5.09 m.
    model, xv = Odometry3D(), np.array([0, -5.0, 0, 1, 0, 0, 0.0])
    u = np.array([0.08, 0, 0, 0, 0, np.deg2rad(0.9)])
    path = [xv]
    for _ in range(400):
        path.append(model.f(path[-1], u, 0.1, NONE).fv)
    np.testing.assert_allclose(path[-1][:3], path[0][:3], atol=1e-9)
    width = np.ptp(np.array(path)[:, 1])
    assert width == pytest.approx(2 * 0.04 / np.sin(np.deg2rad(0.45)), rel=1e-3)


def test_impulse_noise_per_second_and_per_step():
    xv = np.r_[np.zeros(3), 1.0, np.zeros(9)]
    per_second = Impulse(sd_accel=4.0, sd_ang_accel=6.0)
    per_step = Impulse(sd_accel=0.4, sd_ang_accel=0.6, noise_per="step")
    np.testing.assert_allclose(
        per_second.Q(xv, NONE, 0.1, NONE), per_step.Q(xv, NONE, 0.1, NONE), atol=1e-18
    )
    shorter = per_step.Q(xv, NONE, 0.05, NONE)
    assert shorter[7, 7] == pytest.approx(0.16)
    assert per_second.Q(xv, NONE, 0.05, NONE)[7, 7] == pytest.approx(0.04)
    # At rest a turn by Omega dt moves the vector part of q by half of it.
    assert shorter[4, 4] == pytest.approx((0.5 * 0.6 * 0.05) ** 2)


def test_impulse_keeps_turning_about_its_own_axis():
    model = Impulse()
    w = np.array([0.3, -0.8, 0.5])
    xv = np.r_[np.zeros(3), quaternion.from_rotation_vector([0.1, 0.2, 0.3])[0], np.zeros(3), w]
    for _ in range(10):
        xv = model.f(xv, NONE, 0.1, NONE).fv
    turned = quaternion.product(
        quaternion.from_rotation_vector([0.1, 0.2, 0.3])[0], quaternion.from_rotation_vector(w)[0]
    )
    np.testing.assert_allclose(xv[3:7], turned, atol=1e-12)


def test_the_speed_scale_is_a_calibration_of_the_nomad():
    model = PlanarNomad(speed_scale=0.9)
    xv, u = np.array([0.0, 0.0, 0.0, 1.0]), np.array([1.0, np.pi / 2, 0.25])
    moved = model.f(xv, u, 2.0, model.calib0).fv
    np.testing.assert_allclose(moved, [0.0, 1.8, np.pi / 2, 1.25], atol=1e-12)
    np.testing.assert_allclose(model.xp(moved).xp, [0.0, 1.8, 1.25], atol=1e-12)


def test_fractional_noise_vanishes_at_rest():
    assert not PlanarNomad().U(np.zeros(3), 0.1).any()
    assert not Velocity1D().U(np.zeros(1), 0.1).any()
    np.testing.assert_allclose(
        PlanarNomad().U(np.array([2.0, 0.5, -1.0]), 0.1), np.diag([0.28, 0.01, 0.02]) ** 2
    )
    assert PlanarNomad().U_unknown(0.1)[0, 0] > 0.0


@pytest.mark.parametrize(
    ("model", "start", "goal"),
    [
        (Velocity1D(), [3.0], [-1.0]),
        (PlanarNomad(), [0, 0, 0, 0], [-3.0, 0.5]),
        (PlanarNomad(), [0, 0, 3.0, -3.0], [2.0, -4.0]),
        (PlanarUnicycle(), [0, 0, 0], [-3.0, 0.5]),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_navigation_arrives_and_says_so(model, start, goal):
    xv, goal = np.array(start, dtype=float), np.array(goal)
    for _ in range(1000):
        u = model.navigate(xv, goal, 0.1)
        if u is None:
            break
        xv = model.f(xv, u, 0.1, model.calib0).fv
    assert u is None
    gap = np.linalg.norm(model.space.position(model.xp(xv).xp) - goal)
    assert gap <= model.arrive


def test_models_without_waypoints_have_always_arrived():
    assert Impulse().navigate(np.zeros(13), np.zeros(3), 0.1) is None


def test_a_body_taken_over_at_rest_is_unsure_of_its_velocity():
    up = Impulse(rest_sd_speed=0.5, rest_sd_turn=0.2).lift(np.array([1, 2, 3, 1, 0, 0, 0.0]))
    np.testing.assert_allclose(np.diag(up.P_rest), [0] * 7 + [0.25] * 3 + [0.04] * 3)
    np.testing.assert_allclose(up.xv, [1, 2, 3, 1] + [0] * 9)


def test_a_speedometer_is_not_used_near_rest():
    model = Speed(least=0.05)
    assert model.feasible(np.zeros(3), model.h(np.zeros(3)).hv) == Fault.INFEASIBLE
    v = np.array([0.0, 0.3, 0.4])
    assert model.feasible(v, model.h(v).hv) == Fault.NONE
    np.testing.assert_allclose(model.h(v).dhv, [[0.0, 0.6, 0.8]])
