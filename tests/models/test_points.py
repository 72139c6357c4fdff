"""Facts about the landmark parametrisations and the sensors that are not cameras."""

import numpy as np
import pytest

from scene_core.geometry.spaces import THREE_D
from scene_core.models.base import Fault
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_2d import Point2D
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.sensors.distance_1d import Distance1D
from scene_core.models.sensors.range_bearing import RangeBearing

POSE = THREE_D.identity()
NONE = np.zeros(0)


def test_a_euclidean_point_needs_its_distance():
    with pytest.raises(ValueError, match="has no place"):
        EuclideanPoint().initialise(POSE, np.array([0.0, 0.0, 1.0, 0.0]))


@pytest.mark.parametrize(("pole", "ahead", "aside", "up"), [("z", 0, 1, 2), ("y", 2, 0, 1)])
def test_pitch_and_yaw_turn_about_the_pole(pole, ahead, aside, up):
    model = InverseDepth(pole=pole)
    for pitch, yaw, axis in ((0.0, 0.0, ahead), (0.0, np.pi / 2, aside), (np.pi / 2, 0.3, up)):
        X = model.primitive(np.array([0, 0, 0, pitch, yaw, 0.0])).X
        np.testing.assert_allclose(X, np.eye(4)[axis], atol=1e-15)


def test_rho_is_inverse_distance_not_inverse_depth():
    ray = np.array([0.6, 0.0, 0.8])
    y = InverseDepth().initialise(POSE, np.r_[ray, 0.25]).y
    X = InverseDepth().primitive(y).X
    assert np.linalg.norm(X[:3] / X[3]) == pytest.approx(4.0)


def test_straight_at_the_pole_nothing_is_infinite():
    for pole, ray in (("z", [0.0, 0.0, 1.0]), ("y", [0.0, 1.0, 0.0])):
        r = InverseDepth(pole=pole).initialise(POSE, np.r_[ray, 0.5])
        assert all(np.isfinite(part).all() for part in r)
        np.testing.assert_allclose(InverseDepth(pole=pole).primitive(r.y).X[:3], ray, atol=1e-9)


def test_a_point_behind_its_ray_is_put_far_in_front_with_its_spread():
    model = InverseDepth(rho_min=0.002)
    y = np.array([[0, 0, 0, 0.1, 4.0, -0.3], [0, 0, 0, 0.1, 0.2, 0.001]])
    r = model.normalise(y)
    np.testing.assert_allclose(r.value[:, 5], [0.002, 0.001])
    np.testing.assert_allclose(r.value[0, 4], 4.0 - 2 * np.pi)
    np.testing.assert_array_equal(r.jacobian, np.eye(6))


def test_conversion_waits_for_parallax_and_can_be_switched_off():
    P = np.zeros((1, 6, 6))
    P[0, 5, 5] = 0.01**2
    y = np.array([[0, 0, 0, 0.0, 0.0, 0.5]])
    at_anchor, aside = POSE, np.r_[2.0, 5.0, 0.0, 1, 0, 0, 0]
    # Ld = 4 (0.01 / 0.25) / 2 = 0.08 from the anchor; from the side the ray is seen across.
    assert InverseDepth(linearity=0.081).ready(y, P, at_anchor)[0]
    assert not InverseDepth(linearity=0.079).ready(y, P, at_anchor)[0]
    assert InverseDepth(linearity=1e-6).ready(y, P, aside)[0]
    assert not InverseDepth(linearity=0.0).ready(y, P, aside)[0]
    assert not InverseDepth().ready(y * [1, 1, 1, 1, 1, -1], P, aside)[0]


def test_an_uncertain_depth_is_drawn_as_a_piece_of_its_ray():
    model = InverseDepth(far=20.0)
    P = np.zeros((2, 6, 6))
    P[:, 5, 5] = 0.5**2, 0.05**2
    y = np.array([[1.0, 0, 0, 0, 0, 0.01], [1.0, 0, 0, 0, 0, 0.5]])
    g = model.graphics(y, P)
    np.testing.assert_allclose(g.ends[0], [[1 + 1 / 1.01, 0, 0], [21.0, 0, 0]])
    np.testing.assert_allclose(g.ends[1], [[1 + 1 / 0.6, 0, 0], [1 + 1 / 0.4, 0, 0]])
    np.testing.assert_allclose(g.mean[1], [3.0, 0, 0])
    np.testing.assert_allclose(g.cov[1], np.diag([(0.05 / 0.25) ** 2, 0, 0]), atol=1e-15)


def test_a_bearing_wraps_and_turns_from_z_towards_x():
    model = RangeBearing()
    h = model.project(np.array([[0.0, 2.0, 1.0], [-1.0, -1e-9, 1.0]]), NONE).h
    np.testing.assert_allclose(h[0], [2.0, np.pi / 2])
    nu = model.nu(h[1], np.array([1.0, np.pi - 0.1])).nu
    np.testing.assert_allclose(nu, [0.0, -0.1], atol=1e-6)


def test_range_and_bearing_place_a_point():
    model, pose = RangeBearing(), np.array([1.0, 2.0, np.pi / 2])
    X = model.backproject(np.array([2.0, 0.0]), NONE, NONE).X
    np.testing.assert_allclose(Point2D().initialise(pose, X).y, [1.0, 4.0], atol=1e-12)


def test_reach_and_field_of_view():
    model = RangeBearing(reach_min=0.5, reach_max=5.0, field_of_view=np.pi)
    h = np.array([[0.4, 0.0], [5.1, 0.0], [1.0, 1.6], [1.0, -1.5]])
    X = np.ones((4, 3))
    fault = model.visibility(h, X, np.zeros(3), np.zeros((4, 3)), X)
    assert fault.tolist() == [Fault.OUTSIDE] * 3 + [0]
    line = Distance1D(reach=4.0)
    h = np.array([[-4.1], [3.9], [0.0]])
    X = np.ones((3, 2))
    fault = line.visibility(h, X, np.zeros(1), np.zeros((3, 1)), X)
    assert fault.tolist() == [Fault.OUTSIDE, 0, 0]
