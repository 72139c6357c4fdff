"""Facts about the models that are made of parts: inertial, arm, two robots as one."""

from __future__ import annotations

import dataclasses
from typing import Any, cast

import numpy as np
import pytest

from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D
from scene_core.models.check import check
from scene_core.models.laws_motion import _not_bodies
from scene_core.models.motion.arm import Arm
from scene_core.models.motion.double import Double
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.inertial import Inertial
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.params import ParamError

NONE = np.zeros(0)
POSE = np.r_[1.0, -2.0, 0.5, quaternion.from_rotation_vector([0.4, -0.3, 0.9])[0]]
ONE_JOINT = Arm(axes=("x",), lengths=(0.3,), gears=(0.9,), rest_angles=(0.1,))
TRIPLE = Double(Odometry3D(), Double(Impulse(), Arm()))


@pytest.mark.parametrize(
    "model",
    [
        Inertial(gravity=(0.0, -9.81, 0.0), noise_accel=0.2),
        ONE_JOINT,
        Double(Impulse(), Arm()),
        Double(PlanarUnicycle(), PlanarNomad()),
        TRIPLE,
    ],
    ids=["inertial", "one joint", "impulse and arm", "planar", "triple"],
)
def test_they_conform_with_other_parts(model):
    report = check(model, seed=2)
    assert report.ok, str(report)


@dataclasses.dataclass(frozen=True)
class Misled:
    """A model that says what is not so of its bodies."""

    bodies: tuple[str, ...]
    hooks = ("base", "foot")


def test_bodies_are_those_of_the_parts_and_hooks():
    assert Arm().bodies == ("base",)
    assert TRIPLE.bodies == ("base", "second", "second:second")
    assert set(Double(TRIPLE, Arm()).bodies) <= set(Double(TRIPLE, Arm()).hooks)
    places = [TRIPLE.xp(np.arange(37.0), body).xp[:3].tolist() for body in TRIPLE.bodies]
    assert places[0] == [0, 1, 2] and places[1] == [7, 8, 9]
    assert _not_bodies(cast(Any, Misled(("base", "roof")))).startswith("bodies has 'roof'")
    assert "start with 'base'" in _not_bodies(cast(Any, Misled(("foot",))))
    assert _not_bodies(cast(Any, Misled(("base", "foot")))) == ""


# Inertial


def test_a_body_at_rest_feels_gravity_and_stays():
    model = Inertial()
    xv = model.lift(POSE).xv
    u = np.r_[quaternion.rotate_back(POSE[3:], -np.array(model.gravity)).v, np.zeros(3)]
    for _ in range(100):
        xv = model.f(xv, u, 0.01, NONE).fv
    np.testing.assert_allclose(xv[:10], np.r_[POSE, np.zeros(3)], atol=1e-12)


def test_biases_are_taken_off_what_is_felt():
    model = Inertial()
    xv = model.lift(POSE).xv
    u, bias = np.array([0.3, 9.0, -1.0, 0.2, -0.4, 0.1]), np.array([0.1, -0.2, 0.3, 0.01, 0, -0.02])
    biased = np.r_[xv[:10], bias]
    np.testing.assert_allclose(
        model.f(biased, u + bias, 0.1, NONE).fv[:10], model.f(xv, u, 0.1, NONE).fv[:10], atol=1e-12
    )


def test_a_turning_body_is_integrated_to_second_order():
    """A body on a turntable feels a constant centripetal force in its own axes: a lap closes."""
    model, w, radius = Inertial(gravity=(0.0, 0.0, 0.0)), 2.0, 1.5
    u = np.array([-(w**2) * radius, 0.0, 0.0, 0.0, 0.0, w])
    gaps = []
    for steps in (200, 400):
        xv = np.r_[radius, 0, 0, 1, 0, 0, 0, 0, w * radius, 0, np.zeros(6)]
        for _ in range(steps):
            xv = model.f(xv, u, 2 * np.pi / w / steps, NONE).fv
        gaps.append(np.linalg.norm(xv[:3] - [radius, 0, 0]))
        np.testing.assert_allclose(np.abs(xv[3:7]), [1, 0, 0, 0], atol=1e-9)
    assert gaps[0] < 2e-3
    assert gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.1)


def test_white_noise_of_a_sensor_adds_up_to_the_same_whatever_the_rate():
    """sd of the velocity after a second is the noise density, at 50 Hz and at 1 kHz."""
    model = Inertial(noise_accel=0.3)
    for rate in (50, 1000):
        per_step = model.U(np.zeros(6), 1 / rate)[0, 0] / rate**2
        assert per_step * rate == pytest.approx(0.3**2)
    assert not model.U(np.zeros(6), 0.0).any()


# Arm


def test_a_stretched_arm_reaches_as_far_as_its_links():
    model = Arm()
    xv = np.r_[THREE_D.identity(), np.zeros(3)]
    np.testing.assert_allclose(model.xp(xv).xp, [0.8, 0, 0, 1, 0, 0, 0], atol=1e-12)
    xv[7:] = np.pi / 2, 0.0, -np.pi / 2  # turned left, the last link up
    np.testing.assert_allclose(model.xp(xv).xp[:3], [0.0, 0.5, 0.3], atol=1e-12)
    np.testing.assert_allclose(model.xp(xv, "joint 3").xp[:3], [0.0, 0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(model.xp(xv, "foot").xp, THREE_D.identity())


def test_two_joints_are_the_planar_arm_of_the_textbook():
    model = Arm(axes=("z", "z"), lengths=(0.5, 0.4), gears=(1.0, 1.0), rest_angles=(0.0, 0.0))
    q1, q2 = 0.7, -1.9
    hand = model.xp(np.r_[THREE_D.identity(), q1, q2]).xp
    x = 0.5 * np.cos(q1) + 0.4 * np.cos(q1 + q2)
    y = 0.5 * np.sin(q1) + 0.4 * np.sin(q1 + q2)
    np.testing.assert_allclose(hand[:3], [x, y, 0.0], atol=1e-12)
    np.testing.assert_allclose(hand[3:], quaternion.from_euler(0, 0, q1 + q2), atol=1e-12)


def test_what_the_angles_leave_open_does_not_move_the_hand_of_a_lifted_arm():
    model = Arm(rest_sd_angle=0.2)
    up = model.lift(POSE)
    hand = model.xp(up.xv)
    np.testing.assert_allclose(hand.xp, POSE, atol=1e-12)
    J = hand.dxp_by_dxv
    np.testing.assert_allclose(J @ up.P_rest @ J.T, np.zeros((7, 7)), atol=1e-12)
    np.testing.assert_allclose(J @ up.dxv_by_dxp, np.eye(7), atol=1e-12)
    np.testing.assert_allclose(np.diag(up.P_rest)[7:], 0.04)


def test_a_gear_that_is_known_wrong_turns_too_far():
    model = dataclasses.replace(ONE_JOINT, gears=(1.5,))
    xv = np.r_[THREE_D.identity(), 0.2]
    assert model.f(xv, np.array([0.4]), 0.5, model.calib0).fv[7] == pytest.approx(0.5)


def test_the_hand_goes_to_a_waypoint_and_stretches_towards_one_out_of_reach():
    model = Arm()
    xv = model.lift(POSE).xv
    near = THREE_D.to_world(xv[:7], np.array([0.3, -0.4, 0.25, 1.0])).X[:3]
    for _ in range(300):
        u = model.navigate(xv, near, 0.1)
        if u is None:
            break
        assert np.abs(u).max() <= model.max_rate * (1 + 1e-12)
        xv = model.f(xv, u, 0.1, model.calib0).fv
    assert u is None
    assert np.linalg.norm(model.xp(xv).xp[:3] - near) <= model.arrive
    far = THREE_D.to_world(xv[:7], np.array([3.0, 2.0, 1.0, 1.0])).X[:3]
    for _ in range(300):
        xv = model.f(xv, model.navigate(xv, far, 0.1), 0.1, model.calib0).fv
    reach = np.linalg.norm(model.xp(xv).xp[:3] - xv[:3])
    assert reach == pytest.approx(sum(model.lengths), abs=0.02)


@pytest.mark.parametrize("wrong", [{"lengths": (1.0,)}, {"axes": ()}, {"rest_angles": (0.0,) * 4}])
def test_an_arm_whose_parts_do_not_match_is_refused(wrong):
    with pytest.raises(ParamError, match=r"'arm' has \d joints"):
        Arm(**wrong)


# Double


def test_each_of_two_robots_moves_as_if_it_were_alone():
    first, second = PlanarNomad(speed_scale=0.9), PlanarUnicycle()
    pair = Double(first, second)
    assert pair.state_labels == ("z", "x", "S", "T", "2:z", "2:x", "2:phi")
    assert pair.control_labels == ("v", "dS", "dT", "2:v", "2:w")
    assert pair.calib_labels == ("speed scale",)
    xv, u = np.array([1.0, 2, 0.3, 0.4, -1, -2, 0.5]), np.array([0.3, 0.1, 0.2, 0.5, -0.6])
    moved = pair.f(xv, u, 0.1, pair.calib0)
    np.testing.assert_allclose(moved.fv[:4], first.f(xv[:4], u[:3], 0.1, first.calib0).fv)
    np.testing.assert_allclose(moved.fv[4:], second.f(xv[4:], u[3:], 0.1, NONE).fv)
    assert not moved.dfv_by_dxv[:4, 4:].any() and not moved.dfv_by_du[4:, :3].any()
    np.testing.assert_allclose(pair.xp(xv).xp, xv[[0, 1, 3]])
    np.testing.assert_allclose(pair.xp(xv, "second").xp, xv[4:])
    np.testing.assert_allclose(pair.xp(xv, "first:base").xp, xv[[0, 1, 3]])


def test_the_hooks_of_a_robot_stay_reachable_inside_a_pair():
    xv = TRIPLE.lift(POSE).xv
    arm = TRIPLE.second.second
    hooks = [hook for hook in TRIPLE.hooks if "joint" in hook]
    assert hooks == [f"second:second:joint {i}" for i in (1, 2, 3)]
    expected = arm.xp(xv[-arm.state_size :], "joint 2").xp
    np.testing.assert_allclose(TRIPLE.xp(xv, "second:second:joint 2").xp, expected)


def test_a_second_robot_that_nobody_has_seen_may_be_anywhere_near():
    pair = Double(Odometry3D(), Odometry3D(), rest_sd_apart=7.0, rest_sd_turned=0.5)
    up = pair.lift(POSE)
    np.testing.assert_allclose(up.xv, np.r_[POSE, POSE])
    np.testing.assert_allclose(up.P_rest[:7], 0.0)
    J = THREE_D.tangent_map(POSE)
    np.testing.assert_allclose(
        J @ up.P_rest[7:, 7:] @ J.T, np.diag([49.0] * 3 + [0.25] * 3), atol=1e-9
    )


def test_a_pair_has_arrived_when_both_have():
    pair, goal = Double(), np.array([1.0, -0.5])
    xv = np.array([0.0, 0, 0, 0, 3.0, 1.0, 0.5, 0.5])
    for _ in range(1000):
        u = pair.navigate(xv, goal, 0.1)
        if u is None:
            break
        xv = pair.f(xv, u, 0.1, pair.calib0).fv
    assert u is None
    for hook in ("base", "second"):
        assert np.linalg.norm(pair.xp(xv, hook).xp[:2] - goal) <= 0.2


def test_a_pair_relies_on_what_either_relies_on():
    assert Double(Impulse(), Inertial()).world_fixed == ("gravity",)
    assert Double().world_fixed == ()


def test_two_robots_of_one_model_share_their_space_and_have_names():
    with pytest.raises(ParamError, match="share their space"):
        Double(PlanarNomad(), Impulse())
    with pytest.raises(ParamError, match="as the second"):
        Double(Double(), PlanarNomad())
