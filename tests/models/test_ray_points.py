"""What landmarks that are a ray and an inverse distance have in common, and where they differ."""

import dataclasses

import numpy as np
import pytest

from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import THREE_D, TWO_D
from scene_core.models.check import check
from scene_core.models.features.anchored_homogeneous import AnchoredHomogeneous
from scene_core.models.features.framed_homogeneous import FramedHomogeneous
from scene_core.models.features.homogeneous import HomogeneousPoint
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.inverse_depth_2d import PlanarInverseDepth
from scene_core.models.features.point_2d import Point2D
from scene_core.models.sensors.pinhole import Pinhole

IN_SPACE = [InverseDepth(), InverseDepth(pole="y"), AnchoredHomogeneous(), FramedHomogeneous()]
BECOMES_HOMOGENEOUS = AnchoredHomogeneous(becomes="homogeneous point")
each_in_space = pytest.mark.parametrize("model", IN_SPACE, ids=lambda m: m.name)
rng = np.random.default_rng(5)
POSE = np.r_[rng.standard_normal(3), THREE_D.normalise(rng.standard_normal(7))[0][3:]]
RAY = np.array([0.48, -0.36, 0.8])


def seen(model, rho=0.4, pose=POSE):
    return model.initialise(pose, np.r_[RAY, rho])


@each_in_space
def test_all_start_with_the_same_point_and_the_same_uncertainty(model):
    """Of the place in space, to first order, whatever the coordinates: with exact Jacobians they
    differ in nothing but what is not linear."""
    A = THREE_D.from_tangent(POSE) @ rng.standard_normal((6, 6))
    P_pose, P_X = A @ A.T, np.diag([1e-4, 2e-4, 3e-4, 0.01])

    def place(model):
        first = seen(model)
        P = first.dy_by_dxws @ P_pose @ first.dy_by_dxws.T + first.dy_by_dX @ P_X @ first.dy_by_dX.T
        glyph = model.graphics(first.y[None], P[None])
        return glyph.mean[0], glyph.cov[0]

    for mine, other in zip(place(model), place(HomogeneousPoint()), strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-9, atol=1e-9)


@each_in_space
def test_a_point_behind_its_ray_is_put_far_in_front(model):
    y = seen(model).y
    y[-1] = -0.2
    again = model.normalise(y[None]).value[0]
    assert again[-1] == model.rho_min
    np.testing.assert_allclose(model.ray(again).m, model.ray(y).m, atol=1e-12)


def test_a_vector_that_drifted_is_made_a_unit_again_without_moving_the_point():
    model = AnchoredHomogeneous()
    y = seen(model).y
    y[3:6] *= 1.07
    result = model.normalise(y[None])
    np.testing.assert_allclose(np.linalg.norm(result.value[0, 3:6]), 1.0)
    np.testing.assert_allclose(model.place(result.value)[0], model.place(y[None])[0], atol=1e-12)
    numeric = central_differences(lambda y: model.normalise(y).value, (y,), 0)
    np.testing.assert_allclose(result.jacobian[0], numeric, atol=1e-6)
    np.testing.assert_allclose(result.jacobian[0, 3:6, 3:6] @ y[3:6], 0.0, atol=1e-12)


def test_the_length_of_the_anchors_quaternion_means_nothing():
    model = FramedHomogeneous()
    y = seen(model).y
    longer = y.copy()
    longer[3:7] *= 1.05
    np.testing.assert_allclose(model.primitive(longer).X, model.primitive(y).X, atol=1e-12)
    result = model.normalise(longer[None])
    np.testing.assert_allclose(result.value[0], y, atol=1e-12)
    numeric = central_differences(lambda y: model.normalise(y).value, (longer,), 0)
    np.testing.assert_allclose(result.jacobian[0], numeric, atol=1e-6)


def test_a_framed_point_is_born_without_mixing_pose_and_image():
    first = seen(FramedHomogeneous())
    np.testing.assert_array_equal(first.dy_by_dxws, np.eye(10, 7))
    np.testing.assert_array_equal(first.dy_by_dX[:7], 0.0)


def test_a_framed_point_behind_the_sensor_is_as_good_as_one_in_front():
    model, X = FramedHomogeneous(), np.array([0.6, 0.0, -0.8, 0.5])
    np.testing.assert_allclose(
        model.primitive(model.initialise(POSE, X).y).X, THREE_D.to_world(POSE, X).X, atol=1e-12
    )


@pytest.mark.parametrize("model", [*IN_SPACE, PlanarInverseDepth()], ids=lambda m: m.name)
def test_conversion_waits_for_parallax(model):
    """Ld = 4 (0.01 / 0.25) / 2 = 0.08 from the anchor; from the side the ray is seen across."""
    space = model.space
    ahead = np.r_[np.eye(space.d)[0], 0.5]
    y = model.initialise(space.identity(), ahead).y[None]
    P = np.zeros((1, y.shape[1], y.shape[1]))
    P[0, -1, -1] = 0.01**2
    aside = space.identity()
    aside[:2] = 2.0, 5.0
    for limit, pose, ready in (
        (0.081, space.identity(), True),
        (0.079, space.identity(), False),
        (1e-6, aside, True),
        (0.0, aside, False),
    ):
        assert dataclasses.replace(model, linearity=limit).ready(y, P, pose)[0] == ready


def test_a_bearing_turns_from_z_towards_x_and_wraps():
    model, pose = PlanarInverseDepth(), np.array([1.0, 2.0, np.pi / 2])
    y = model.initialise(pose, np.array([1.0, 0.0, 0.25])).y
    np.testing.assert_allclose(y, [1.0, 2.0, np.pi / 2, 0.25])
    np.testing.assert_allclose(model.convert(y).y, [1.0, 6.0])
    assert isinstance(model.successor(), Point2D)
    np.testing.assert_allclose(model.normalise(y + 2 * np.pi * np.eye(4)[2]).value, y)
    assert TWO_D is model.space


def test_homogeneous_points_beyond_infinity_keep_their_image():
    """From where it was first seen the ray is the same for any rho, negative or not, if h moves
    along: h = m + rho t."""
    model, camera = HomogeneousPoint(), Pinhole()
    for pose in (POSE, THREE_D.identity()):
        images = []
        for rho in (-0.2, 0.0, 0.3):
            X_S = THREE_D.to_local(pose, model.primitive(seen(model, rho, pose).y).X).X
            images.append(camera.project(X_S, camera.calib0).h)
        np.testing.assert_allclose(images[1:], images[:-1], atol=1e-9)
    assert model.normalise(seen(model, -0.2).y[None]) is None


def test_an_anchored_point_may_become_homogeneous():
    report = check(BECOMES_HOMOGENEOUS)
    assert report.ok, str(report)
    assert isinstance(BECOMES_HOMOGENEOUS.successor(), HomogeneousPoint)
    assert BECOMES_HOMOGENEOUS.successor() != AnchoredHomogeneous().successor()
