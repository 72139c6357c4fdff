"""Facts about bodies that move freely in space and about the robot on undulating ground."""

import numpy as np
import pytest

from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D
from scene_core.models.motion.constant_acceleration import ConstantAcceleration
from scene_core.models.motion.head_mounted import HeadMounted
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.nomad_3d import TerrainNomad
from scene_core.models.motion.zero_order import ZeroOrder

NONE = np.zeros(0)
TILTED = quaternion.from_rotation_vector(np.array([0.2, -0.9, 0.4]))[0]


def about_y(angle):
    return np.array([np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0])


def predicted(model, xv, dts):
    """State and covariance after steps from a state that is known exactly."""
    P = np.zeros((len(xv), len(xv)))
    for dt in dts:
        step, Q = model.f(xv, NONE, dt, NONE), model.Q(xv, NONE, dt, NONE)
        xv, P = step.fv, step.dfv_by_dxv @ P @ step.dfv_by_dxv.T + Q
    return xv, P


def test_zero_order_has_scenes_noise_at_any_attitude():
    model, dt = ZeroOrder(), 1.0 / 30.0
    level = model.Q(THREE_D.identity(), NONE, dt, NONE)
    rotation = (4.0 * dt / 2.0) ** 2
    np.testing.assert_allclose(level, np.diag([0.16] * 3 + [0.0] + [rotation] * 3), atol=1e-15)
    Q = model.Q(np.concatenate([[1, 2, 3], TILTED]), NONE, dt, NONE)
    np.testing.assert_allclose(TILTED @ Q[3:, 3:] @ TILTED, 0.0, atol=1e-15)
    on_tangent = THREE_D.tangent_map(np.concatenate([np.zeros(3), TILTED]))
    np.testing.assert_allclose(
        on_tangent @ Q @ on_tangent.T, np.diag([0.16] * 3 + [(4.0 * dt) ** 2] * 3), atol=1e-12
    )


def test_constant_acceleration_falls_and_spins_up():
    model = ConstantAcceleration()
    spin = np.array([0.0, 0.0, 0.4])
    xv = np.concatenate([[0, 0, 5], [1, 0, 0, 0], [1, 0, 0], spin, [0, 0, -9.81], 0.5 * spin])
    for steps in (1, 40):
        out, _ = predicted(model, xv, [1.0 / steps] * steps)
        np.testing.assert_allclose(out[:3], [1.0, 0.0, 5.0 - 9.81 / 2], atol=1e-12)
        turned = quaternion.from_rotation_vector(1.25 * spin)[0]
        np.testing.assert_allclose(out[3:7], turned, atol=1e-12)
        np.testing.assert_allclose(out[7:13], [1, 0, -9.81, 0, 0, 0.6], atol=1e-12)


def test_without_acceleration_it_is_the_impulse_model():
    rng = np.random.default_rng(3)
    xv = np.concatenate([[1, 2, 3], TILTED, rng.standard_normal(6)])
    still = np.concatenate([xv, np.zeros(6)])
    np.testing.assert_allclose(
        ConstantAcceleration().f(still, NONE, 0.2, NONE).fv[:13],
        Impulse().f(xv, NONE, 0.2, NONE).fv,
        atol=1e-14,
    )


def test_white_jerk_after_one_second():
    model = ConstantAcceleration(sd_accel=2.0, sd_ang_accel=3.0)
    xv = np.concatenate([THREE_D.identity(), np.zeros(12)])
    Q = model.Q(xv, NONE, 1.0, NONE)
    x = [0, 7, 13]
    J = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    np.testing.assert_allclose(Q[np.ix_(x, x)], 4.0 * J)
    assert Q[16, 16] == pytest.approx(9.0)
    assert Q[4, 4] == pytest.approx(9.0 / 20 / 4)  # the vector part of q moves by half the turn


@pytest.mark.parametrize("model", [ConstantAcceleration(), HeadMounted()], ids=lambda m: m.name)
def test_noise_does_not_depend_on_the_length_of_a_step(model):
    """Rotation is held against it at rest, where it is linear."""
    xv = np.concatenate([[1, 2, 3], TILTED, np.zeros(model.state_size - 7)])
    _, whole = predicted(model, xv, [0.5])
    for dts in ([0.2, 0.3], [0.005] * 100):
        np.testing.assert_allclose(predicted(model, xv, dts)[1], whole, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("x", [1e-4, 0.0199, 0.0201, 0.3, 4.0])
def test_the_way_of_a_forgotten_velocity_is_an_integral(x):
    """var(r) = 2 t^2 times the integral of (1 - exp(-s))^2 up to dt / t, series and closed form."""
    model = HeadMounted(sd_speed=1.0, t_speed=2.0)
    xv = np.concatenate([THREE_D.identity(), np.zeros(6)])
    nodes, weights = np.polynomial.legendre.leggauss(30)
    s = 0.5 * x * (nodes + 1.0)
    integral = 0.5 * x * weights @ np.expm1(-s) ** 2
    Q = model.Q(xv, NONE, 2.0 * x, NONE)
    np.testing.assert_allclose(Q[:3, :3], np.diag([8.0 * integral] * 3), rtol=1e-9)
    np.linalg.cholesky(Q[np.ix_([0, 7], [0, 7])])


def test_a_head_forgets_where_it_was_going():
    model = HeadMounted(t_speed=0.5, t_turn=0.25)
    w = np.array([0.0, 1.2, 0.0])
    xv = np.concatenate([np.zeros(3), [1, 0, 0, 0], [1.0, 0, 0], w])
    after = model.f(xv, NONE, 0.5, NONE).fv
    np.testing.assert_allclose(after[[7, 11]], [np.exp(-1.0), 1.2 * np.exp(-2.0)])
    end, _ = predicted(model, xv, [0.1] * 200)
    np.testing.assert_allclose(end[:3], [0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(end[3:7], quaternion.from_rotation_vector(0.25 * w)[0], atol=1e-12)


def test_a_head_keeps_to_what_a_person_does_and_a_thrown_camera_does_not():
    head, thrown = HeadMounted(sd_speed=0.7, sd_turn=1.5), Impulse()
    xv = np.concatenate([THREE_D.identity(), np.zeros(6)])
    for seconds in (20, 40):
        spread = np.diag(predicted(head, xv, [0.1] * (10 * seconds))[1])
        np.testing.assert_allclose(spread[7:], [0.49] * 3 + [2.25] * 3, rtol=1e-6)
        grown = np.diag(predicted(thrown, xv, [0.1] * (10 * seconds))[1])
        np.testing.assert_allclose(grown[7:10], 10 * seconds * 0.16)


def test_a_head_taken_over_moves_as_heads_do():
    model = HeadMounted()
    up = model.lift(THREE_D.identity())
    F = model.f(up.xv, NONE, 0.4, NONE).dfv_by_dxv
    assert F is not None
    P = F @ up.P_rest @ F.T + model.Q(up.xv, NONE, 0.4, NONE)
    np.testing.assert_allclose(P[7:, 7:], up.P_rest[7:, 7:], atol=1e-12)


def test_memory_without_end_is_constant_velocity():
    xv = np.concatenate([[1, 2, 3], TILTED, [0.3, -0.2, 0.5, 1.0, 0.2, -0.7]])
    model = HeadMounted(t_speed=1e9, t_turn=1e9)
    np.testing.assert_allclose(
        model.f(xv, NONE, 0.1, NONE).fv, Impulse().f(xv, NONE, 0.1, NONE).fv, atol=1e-9
    )


def test_on_level_ground_the_terrain_nomad_is_the_planar_one():
    planar, terrain, k = PlanarNomad(), TerrainNomad(), np.array([0.9])
    z, x, S, T = 1.0, -2.0, 2.5, -0.4
    flat = planar.f(np.array([z, x, S, T]), np.array([0.5, 0.9, -0.2]), 0.3, k).fv
    xv = np.concatenate([[x, 7.0, z], about_y(T), [S - T]])
    moved = terrain.f(xv, np.array([0.5, 0.9, -0.2]), 0.3, k).fv
    np.testing.assert_allclose(moved[:3], [flat[1], 7.0, flat[0]], atol=1e-12)
    np.testing.assert_allclose(moved[3:7], about_y(flat[3]), atol=1e-12)
    np.testing.assert_allclose(np.sin(moved[7]), np.sin(flat[2] - flat[3]), atol=1e-12)


def test_the_nomad_drives_in_the_plane_it_stands_on():
    model, xv = TerrainNomad(), np.concatenate([[1, 2, 3], TILTED, [0.7]])
    moved = model.f(xv, np.array([0.5, 0.9, -0.2]), 0.3, model.calib0).fv
    normal = quaternion.matrix(TILTED)[:, 1]
    assert normal @ (moved[:3] - xv[:3]) == pytest.approx(0.0, abs=1e-15)
    np.testing.assert_allclose(quaternion.matrix(moved[3:7])[:, 1], normal, atol=1e-12)


def test_the_ground_folds_about_horizontal_axes():
    model, u = TerrainNomad(slope=0.5), np.array([0.3, 0.2, 0.1])
    level = np.concatenate([np.zeros(3), about_y(-0.1), [0.0]])  # faces z after its turn
    b = (0.5 * 0.3 * 0.1) ** 2 / 8.0
    expected = np.zeros((8, 8))
    expected[4, 4] = expected[6, 6] = b
    np.testing.assert_allclose(model.Q(level, u, 0.1, model.calib0), expected, atol=1e-18)
    assert not model.Q(level, np.zeros(3), 0.1, model.calib0).any()


@pytest.mark.parametrize("goal", [(2.0, 0.5, -3.0), (-4.0, -2.0, 0.5)], ids=str)
def test_a_waypoint_above_or_below_the_ground_is_reached_on_the_ground(goal):
    model, xv, u = TerrainNomad(), np.concatenate([np.zeros(3), TILTED, [0.0]]), None
    for _ in range(1000):
        u = model.navigate(xv, np.array(goal), 0.1)
        if u is None:
            break
        xv = model.f(xv, u, 0.1, model.calib0).fv
    assert u is None
    normal = quaternion.matrix(TILTED)[:, 1]
    assert normal @ xv[:3] == pytest.approx(0.0, abs=1e-12)
    # Within `arrive` in the plane, so within it seen from above.
    assert np.hypot(xv[0] - goal[0], xv[2] - goal[2]) <= model.arrive
    assert abs(xv[7]) < 0.2  # the turret has followed


def test_a_waypoint_does_not_depend_on_which_axis_points_up():
    stand_up = np.concatenate([np.zeros(3), quaternion.from_euler(-np.pi / 2, 0, 0)])
    xv, goal = np.concatenate([[1, 2, 3], TILTED, [0.7]]), np.array([4.0, -3.0, 2.0])
    turned = TerrainNomad().redefine(xv, stand_up).value
    moved = THREE_D.to_local(stand_up, np.append(goal, 1.0)).X[:3]
    was_up = THREE_D.to_local(stand_up, np.array([0.0, 1.0, 0.0, 0.0])).X
    np.testing.assert_allclose(was_up, [0, 0, 1, 0], atol=1e-12)
    u, same = (
        TerrainNomad().navigate(xv, goal, 0.1),
        TerrainNomad(up="z").navigate(turned, moved, 0.1),
    )
    assert u is not None and same is not None
    np.testing.assert_allclose(same, u)


def test_the_nomad_on_a_wall_still_knows_where_to_go():
    wall = quaternion.from_rotation_vector(np.array([np.pi / 2, 0, 0]))[0]
    u = TerrainNomad().navigate(np.concatenate([np.zeros(3), wall, [0.0]]), np.ones(3), 0.1)
    assert u is not None and np.isfinite(u).all()


def test_a_new_origin_takes_velocities_and_accelerations_of_the_world_along():
    rng = np.random.default_rng(5)
    model = ConstantAcceleration()
    xv = np.concatenate([rng.standard_normal(3), TILTED, rng.standard_normal(12)])
    own = model.redefine(xv, xv[:7]).value
    np.testing.assert_allclose(own[:7], THREE_D.identity(), atol=1e-12)
    R = quaternion.matrix(TILTED)
    np.testing.assert_allclose(own[7:10], R.T @ xv[7:10], atol=1e-12)
    np.testing.assert_allclose(own[13:16], R.T @ xv[13:16], atol=1e-12)
    np.testing.assert_array_equal(own[[10, 11, 12, 16, 17, 18]], xv[[10, 11, 12, 16, 17, 18]])
