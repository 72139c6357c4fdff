"""Quaternions: a double cover of the rotations, with exact Jacobians everywhere."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scene_core.geometry import quaternion
from scene_core.geometry.numdiff import central_differences

component = st.floats(-1.0, 1.0).filter(lambda x: abs(x) > 1e-6)
vectors = st.tuples(component, component, component).map(np.array)
units = st.tuples(component, component, component, component).map(
    lambda q: np.array(q) / np.linalg.norm(q)
)
# The series takes over near |theta| = 0.03, and the logarithm's below n = 0.01.
ANGLES = [0.0, 1e-300, 1e-12, 1e-8, 1e-4, 0.0199, 0.0201, 0.0316, 0.0317, 0.5, 3.0, 3.1415, 6.0]


@given(units, units, units)
def test_product_is_associative(p, q, r):
    left = quaternion.product(quaternion.product(p, q), r)
    np.testing.assert_allclose(left, quaternion.product(p, quaternion.product(q, r)), atol=1e-14)


@given(units, units)
def test_matrix_is_a_homomorphism(p, q):
    R = quaternion.matrix(quaternion.product(p, q))
    np.testing.assert_allclose(R, quaternion.matrix(p) @ quaternion.matrix(q), atol=1e-13)


@given(units)
def test_conjugate_inverts_and_the_negative_is_the_same_rotation(q):
    R = quaternion.matrix(q)
    np.testing.assert_allclose(
        quaternion.product(q, quaternion.conjugate(q)), [1, 0, 0, 0], atol=1e-14
    )
    np.testing.assert_allclose(quaternion.matrix(quaternion.conjugate(q)), R.T, atol=1e-14)
    np.testing.assert_allclose(quaternion.matrix(-q), R, atol=0)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-13)
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_the_quadratic_form_is_equation_12_of_scene():
    q0, qx, qy, qz = q = np.array([0.3, -0.5, 0.7, 1.1])
    # fmt: off
    expected = np.array([
        [q0*q0 + qx*qx - qy*qy - qz*qz, 2*(qx*qy - q0*qz), 2*(qx*qz + q0*qy)],
        [2*(qx*qy + q0*qz), q0*q0 - qx*qx + qy*qy - qz*qz, 2*(qy*qz - q0*qx)],
        [2*(qx*qz - q0*qy), 2*(qy*qz + q0*qx), q0*q0 - qx*qx - qy*qy + qz*qz],
    ])
    # fmt: on
    np.testing.assert_allclose(quaternion.matrix(q), expected, atol=1e-15)


def test_the_product_is_equation_15_of_scene():
    p, q = np.array([0.3, -0.5, 0.7, 1.1]), np.array([-0.2, 0.4, 0.9, -0.6])
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    expected = np.r_[p[0] * q[0] - p[1:] @ q[1:], vector]
    np.testing.assert_allclose(quaternion.product(p, q), expected, atol=1e-15)
    np.testing.assert_allclose(quaternion.right_matrix(q) @ p, expected, atol=1e-15)


@pytest.mark.parametrize("turn", [quaternion.rotate, quaternion.rotate_back])
@given(units, vectors, st.floats(0.5, 2.0))
def test_turning_a_vector_has_the_jacobian_of_the_polynomial(turn, q, v, scale):
    q = scale * q  # the form is homogeneous: its Jacobian holds off the unit sphere, too
    R = quaternion.matrix(q)
    r = turn(q, v)
    np.testing.assert_allclose(r.v, (R if turn is quaternion.rotate else R.T) @ v, atol=1e-13)
    numeric = central_differences(lambda q, v: turn(q, v).v, (q, v), 0)
    np.testing.assert_allclose(r.by_q, numeric, atol=1e-8)
    np.testing.assert_allclose(r.by_v @ v, r.v, atol=1e-13)


def test_turning_broadcasts_over_both_arguments(rng):
    q, v = rng.standard_normal((5, 4)), rng.standard_normal((5, 3))
    for turn in (quaternion.rotate, quaternion.rotate_back):
        many = turn(q, v)
        shared = turn(q[0], v)
        for i in range(5):
            one = turn(q[i], v[i])
            for got, expected in zip(many, one, strict=True):
                np.testing.assert_allclose(got[i], expected, atol=1e-14)
            same_q = turn(q[0], v[i])
            np.testing.assert_allclose(shared.v[i], same_q.v, atol=1e-14)
            np.testing.assert_allclose(shared.by_q[i], same_q.by_q, atol=1e-14)


@pytest.mark.parametrize("angle", ANGLES)
def test_exponential_and_its_jacobian_at_every_angle(angle):
    theta = angle * np.array([0.6, 0.0, -0.8])
    q, J = quaternion.from_rotation_vector(theta)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(q[0], np.cos(angle / 2), atol=1e-15)
    numeric = central_differences(lambda t: quaternion.from_rotation_vector(t)[0], (theta,), 0)
    np.testing.assert_allclose(J, numeric, atol=1e-9)


@pytest.mark.parametrize("angle", [a for a in ANGLES if a < np.pi])
@pytest.mark.parametrize("cover", [1.0, -1.0])
def test_logarithm_inverts_the_exponential_on_both_covers(angle, cover):
    theta = angle * np.array([0.6, 0.0, -0.8])
    q = cover * quaternion.from_rotation_vector(theta)[0]
    back, J = quaternion.to_rotation_vector(q)
    np.testing.assert_allclose(back, theta, atol=1e-14)
    np.testing.assert_allclose(
        J, central_differences(lambda q: quaternion.to_rotation_vector(q)[0], (q,), 0), atol=1e-8
    )


@given(units)
def test_logarithm_is_never_longer_than_half_a_turn(q):
    theta, _ = quaternion.to_rotation_vector(q)
    assert np.linalg.norm(theta) <= np.pi + 1e-12
    same = quaternion.matrix(quaternion.from_rotation_vector(theta)[0])
    np.testing.assert_allclose(same, quaternion.matrix(q), atol=1e-12)


@given(units, st.floats(0.1, 10.0))
def test_normalisation_is_a_projection(q, scale):
    unit, J = quaternion.normalise(scale * q)
    np.testing.assert_allclose(unit, q, atol=1e-14)
    numeric = central_differences(lambda q: quaternion.normalise(q)[0], (scale * q,), 0)
    np.testing.assert_allclose(J, numeric, atol=1e-6 / scale)
    np.testing.assert_allclose(J @ q, 0.0, atol=1e-13)


@settings(max_examples=50)
@given(units)
def test_from_matrix_inverts_matrix_up_to_sign(q):
    back = quaternion.from_matrix(quaternion.matrix(q))
    np.testing.assert_allclose(back * np.sign(back @ q), q, atol=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_from_matrix_at_half_turns(axis):
    q = np.eye(4)[axis + 1]
    back = quaternion.from_matrix(quaternion.matrix(q))
    np.testing.assert_allclose(np.abs(back), q, atol=1e-15)


def test_euler_angles_turn_a_forward_left_up_robot_into_a_camera():
    # The toolbox mounts its camera with roll, pitch, yaw = -90, 0, -90 degrees.
    q = quaternion.from_euler(-np.pi / 2, 0.0, -np.pi / 2)
    np.testing.assert_allclose(q, [0.5, -0.5, 0.5, -0.5], atol=1e-15)
    np.testing.assert_allclose(quaternion.matrix(q) @ [0, 0, 1], [1, 0, 0], atol=1e-15)
