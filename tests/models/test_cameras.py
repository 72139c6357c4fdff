"""What the cameras have in common, and where their lenses end."""

import dataclasses

import numpy as np
import pytest

from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import THREE_D
from scene_core.models import radial
from scene_core.models.base import Fault
from scene_core.models.sensors.civera import Civera
from scene_core.models.sensors.opencv import OpenCV
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.wide_angle import WideAngle

CAMERAS = [Pinhole(distortion=(-0.1, 0.02)), WideAngle(), Civera(k1=0.01, k2=0.002), OpenCV()]
POSE = THREE_D.identity()
each_camera = pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.name)


def faults(camera, X, pose0=POSE, xws=POSE, world=None):
    X = np.atleast_2d(X)
    world = X if world is None else np.atleast_2d(world)
    h = camera.project(X, camera.calib0).h
    return camera.visibility(h, X, xws, np.broadcast_to(pose0, (len(X), 7)), world)


@each_camera
def test_axes_are_right_down_forward(camera):
    axis, right, down = camera.project(
        np.array([[0, 0, 1.0, 1], [0.1, 0, 1, 1], [0, 0.1, 1, 1]]), camera.calib0
    ).h
    np.testing.assert_allclose(axis, [camera.u0, camera.v0])
    assert right[0] > axis[0]
    assert down[1] > axis[1]


@each_camera
def test_a_point_at_infinity_is_as_good_as_any(camera):
    near, far = np.array([0.2, -0.1, 1.0, 3.0]), np.array([0.2, -0.1, 1.0, 0.0])
    r = camera.project(np.stack([near, far]), camera.calib0)
    np.testing.assert_array_equal(r.h[0], r.h[1])
    np.testing.assert_array_equal(r.dh_by_dX[:, :, 3], 0.0)
    assert faults(camera, far).tolist() == [0]


@each_camera
def test_the_neutral_lens_is_the_ideal_pinhole(camera):
    neutral = {Pinhole: {"distortion": (0.0, 0.0)}, WideAngle: {"kd1": 0.0}}.get(
        type(camera), {"k1": 0.0, "k2": 0.0}
    )
    ideal, camera = Pinhole(), dataclasses.replace(camera, **neutral)
    X = np.random.default_rng(0).uniform([-0.5, -0.5, 1, 0], [0.5, 0.5, 2, 1], (20, 4))
    np.testing.assert_allclose(
        camera.project(X, camera.calib0).h, ideal.project(X, ideal.calib0).h, atol=1e-9
    )


@each_camera
def test_a_calibration_makes_a_camera(camera):
    k = camera.calib0 * 1.03
    again = camera.with_calib(k)
    np.testing.assert_array_equal(again.calib0, k)
    assert again.with_calib(camera.calib0) == camera


@each_camera
def test_behind_comes_before_outside(camera):
    camera = dataclasses.replace(camera, border=20.0, max_scale=0.0, max_angle=0.0)
    X = [[0, 0, -1.0, 1], [5, 0, 1, 1], [0, -5, 1, 1], [0, 0, 1, 1], [0, 0, 0, 1]]
    expected = [Fault.BEHIND, Fault.OUTSIDE, Fault.OUTSIDE, 0, Fault.BEHIND]
    assert faults(camera, X).tolist() == expected


@each_camera
def test_the_border_is_not_part_of_the_image(camera):
    h = np.array([[10.0, 100.0]])
    X = camera.backproject(h, np.ones((1, 1)), camera.calib0).X
    assert faults(dataclasses.replace(camera, border=9.0), X).tolist() == [0]
    assert faults(dataclasses.replace(camera, border=11.0), X).tolist() == [Fault.OUTSIDE]


@each_camera
@pytest.mark.parametrize(
    ("first_seen_from", "fault"),
    [
        ([0, 0, 1.01], Fault.SCALE),  # it is now 2.02 times as far
        ([0, 0, 0.99], 0),
        ([0, 0, -2.02], Fault.SCALE),
        ([0, 0, -1.98], 0),
        ([2.02, 0, 0], Fault.ANGLE),
        ([1.98, 0, 0], 0),
        ([6.0, 0, 0], Fault.SCALE | Fault.ANGLE),
    ],
)
def test_limits_of_scale_and_angle(camera, first_seen_from, fault):
    point = np.array([0.0, 0.0, 2.0, 1.0])
    pose0 = np.r_[first_seen_from, 1.0, 0.0, 0.0, 0.0]
    assert faults(camera, point, pose0).tolist() == [fault]
    unlimited = dataclasses.replace(camera, max_scale=0.0, max_angle=0.0)
    assert faults(unlimited, point, pose0).tolist() == [0]
    at_infinity = np.array([0.0, 0.0, 1.0, 0.0])
    assert faults(camera, at_infinity, pose0).tolist() == [0]


def test_beyond_the_fold_a_lens_shows_nothing():
    camera = Pinhole(width=640, height=480, u0=320, v0=240, f_u=320, f_v=320, distortion=(-0.3,))
    fold = radial.fold_radius(np.array([-0.3]))
    assert fold == pytest.approx(np.sqrt(1 / 0.9))
    far_out = np.array([[1.3 * fold, 0.0, 1.0, 1.0]])
    h = camera.project(far_out, camera.calib0).h
    assert 0.0 < h[0, 0] < 640.0  # the polynomial folds it back into the image
    assert faults(camera, far_out).tolist() == [Fault.OUTSIDE]


def test_pixels_no_ray_belongs_to_stay_finite():
    narrow = Pinhole(width=640, height=480, u0=320, v0=240, f_u=320, f_v=320, distortion=(-0.3,))
    wide = WideAngle(kd1=9e-5)
    for camera in (narrow, wide):
        corners = np.array([[0.0, 0.0], [camera.width, camera.height]])
        for part in camera.backproject(corners, np.zeros((2, 1)), camera.calib0):
            assert np.isfinite(part).all()
    edge = radial.undistort(np.array([[3.0, 4.0], [0.0, 0.0]]), np.array([-0.3]))
    assert np.linalg.norm(edge.p[0]) == pytest.approx(0.999 * np.sqrt(1 / 0.9))
    assert edge.p[0, 0] / edge.p[0, 1] == pytest.approx(0.75)


@pytest.mark.parametrize(
    "d",
    [(), (-0.3,), (0.4,), (-0.3, 0.1), (0.2, -0.05), (-0.4, 0.3, -0.05), (5.0, -3.0, 7.0)],
    ids=str,
)
def test_undistort_inverts_distort_with_the_implicit_jacobian(d):
    d = np.array(d)
    fold = min(radial.fold_radius(d), 2.0)
    angle = np.linspace(0.0, 6.0, 25)
    p = np.linspace(0.0, 0.98 * fold, 25)[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    out = radial.distort(p, d).p
    back = radial.undistort(out, d)
    np.testing.assert_allclose(back.p, p, atol=1e-10)
    inner = slice(0, 20)  # near the fold the inverse is too steep for differences
    for which, J in ((0, back.by_p), (1, back.by_d)):
        numeric = central_differences(lambda q, d: radial.undistort(q, d).p, (out, d), which)
        J = np.broadcast_to(J, numeric.shape)
        np.testing.assert_allclose(J[inner], numeric[inner], rtol=1e-5, atol=1e-6)


def test_noise_of_the_wide_angle_camera_doubles_at_the_corner():
    camera = WideAngle(sd_px=1.5)
    h = np.array([[camera.u0, camera.v0], [0.0, 0.0]])
    np.testing.assert_allclose(camera.R(h), [1.5**2 * np.eye(2), 3.0**2 * np.eye(2)])
    even = dataclasses.replace(camera, sd_grows_to_corner=False)
    np.testing.assert_allclose(even.R(h), [1.5**2 * np.eye(2)] * 2)
