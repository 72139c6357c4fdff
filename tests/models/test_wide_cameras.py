"""OpenCV's own lenses against OpenCV, and lenses that see behind themselves."""

import dataclasses

import cv2
import numpy as np
import pytest

from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import THREE_D
from scene_core.models import equidistant
from scene_core.models.base import Fault
from scene_core.models.check import check
from scene_core.models.sensors.fisheye import Fisheye
from scene_core.models.sensors.omnidirectional import Omnidirectional
from scene_core.models.sensors.opencv import OpenCV
from scene_core.params import ParamError

POSE = THREE_D.identity()
IMAGE = {"width": 1280, "height": 800, "u0": 640.0, "v0": 400.0}
BARREL = OpenCV(**IMAGE, f_u=800.0, f_v=820.0, k1=-0.28, k2=0.1, p1=2e-3, p2=-3e-3, k3=-0.015)
DISTORTED = Fisheye(**IMAGE, f_u=330.0, f_v=325.0, k1=-0.02, k2=0.004, k3=-0.002, k4=2e-4)
CONICAL = Omnidirectional(affine_c=1.02, affine_d=0.012, affine_e=-0.007)
WIDE = [DISTORTED, Fisheye(**IMAGE, f_u=300.0, f_v=300.0, theta_max=2.6), CONICAL]
each_wide = pytest.mark.parametrize("camera", WIDE, ids=lambda c: f"{c.name} {WIDE.index(c)}")
NOTHING = np.zeros(3)


def matrix(camera):
    return np.array([[camera.f_u, 0, camera.u0], [0, camera.f_v, camera.v0], [0, 0, 1.0]])


def homogeneous(m):
    return np.column_stack([m, np.ones(len(m))])


def directions(theta, count=24):
    """Unit rays on a cone of half angle theta about the axis."""
    phi = np.linspace(0.1, 0.1 + 2 * np.pi, count, endpoint=False)
    return np.column_stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.full(count, np.cos(theta))]
    )


def faults(camera, X):
    h = camera.project(X, camera.calib0).h
    return camera.visibility(h, X, POSE, np.tile(POSE, (len(X), 1)), X)


@pytest.mark.parametrize("model", [BARREL, *WIDE], ids=lambda m: m.name)
def test_lenses_in_use_conform(model):
    report = check(model, seed=3)
    assert report.ok, str(report)


def test_opencv_projects_like_opencv():
    m = np.random.default_rng(0).uniform([-0.7, -0.45, 1.0], [0.7, 0.45, 1.5], (200, 3))
    d = BARREL.calib0[4:]
    expected, by_all = cv2.projectPoints(m, NOTHING, NOTHING, matrix(BARREL), d)
    r = BARREL.project(homogeneous(m), BARREL.calib0)
    np.testing.assert_allclose(r.h, expected[:, 0], atol=1e-9)
    # OpenCV's Jacobian: rotation, translation, focal lengths, centre, distortion.
    by_all = by_all.reshape(200, 2, -1)
    np.testing.assert_allclose(r.dh_by_dX[..., :3], by_all[..., 3:6], atol=1e-6)
    np.testing.assert_allclose(r.dh_by_dk[..., 2:4], by_all[..., 6:8], atol=1e-9)
    np.testing.assert_allclose(r.dh_by_dk[..., 4:], by_all[..., 10:15], atol=1e-6)


def test_opencv_undistorts_like_opencv_but_to_the_last_bit():
    z = np.random.default_rng(1).uniform([0, 0], [1280, 800], (200, 2))
    back = BARREL.backproject(z, np.ones((200, 1)), BARREL.calib0).X
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    d = BARREL.calib0[4:]
    expected = cv2.undistortPoints(z[:, None], matrix(BARREL), d, criteria=stop)[:, 0]
    np.testing.assert_allclose(back[:, :2] / back[:, 2:3], expected, atol=1e-6)
    np.testing.assert_allclose(BARREL.project(back, BARREL.calib0).h, z, atol=1e-9)


def test_beyond_the_fold_of_a_tilted_lens_nothing_is_seen():
    narrow = OpenCV(**IMAGE, f_u=500.0, f_v=500.0, k1=-0.3, k2=0.0, p1=0.01, p2=-0.01)
    fold = np.sqrt(1 / 0.9)
    far_out = np.column_stack([directions(np.arctan(1.3 * fold)), np.ones(24)])
    h = narrow.project(far_out, narrow.calib0).h
    inside = ((h > 0) & (h < [1280, 800])).all(-1)
    assert inside.all()  # the polynomial folds them back into the image
    assert (faults(narrow, far_out) == Fault.OUTSIDE).all()
    within = np.column_stack([directions(np.arctan(0.7 * fold)), np.ones(24)])
    assert (faults(narrow, within) == 0).all()
    corners = np.array([[0.0, 0.0], [1280.0, 800.0]])
    for part in narrow.backproject(corners, np.ones((2, 1)), narrow.calib0):
        assert np.isfinite(part).all()


def test_a_fisheye_projects_like_opencv_in_front():
    m = np.random.default_rng(2).uniform([-3, -3, 0.3], [3, 3, 1.5], (200, 3))
    d = DISTORTED.calib0[4:]
    expected, _ = cv2.fisheye.projectPoints(m[:, None], NOTHING, NOTHING, matrix(DISTORTED), d)
    h = DISTORTED.project(homogeneous(m), DISTORTED.calib0).h
    np.testing.assert_allclose(h, expected[:, 0], atol=1e-9)


def test_a_fisheye_undistorts_like_opencv():
    h = DISTORTED.project(
        np.concatenate([homogeneous(directions(t)) for t in (0.3, 1.0, 1.4)]), DISTORTED.calib0
    ).h
    expected = cv2.fisheye.undistortPoints(h[:, None], matrix(DISTORTED), DISTORTED.calib0[4:])
    X = DISTORTED.backproject(h, np.ones((len(h), 1)), DISTORTED.calib0).X
    np.testing.assert_allclose(X[:, :2] / X[:, 2:3], expected[:, 0], atol=1e-6)


@each_wide
def test_a_wide_lens_keeps_right_right_and_its_axis_in_the_middle(camera):
    X = np.array([[0, 0, 1.0, 1], [1e-3, 0, 1, 1], [0, 1e-3, 1, 1]])
    axis, right, down = camera.project(X, camera.calib0).h
    np.testing.assert_allclose(axis, [camera.u0, camera.v0], atol=1e-5)
    assert right[0] > axis[0]
    assert down[1] > axis[1]


@each_wide
@pytest.mark.parametrize("theta", [0.0, 1e-4, 5e-3, 0.02, 1.0, np.pi / 2, 1.64])
def test_rays_survive_the_image_on_both_sides_of_90_degrees(camera, theta):
    m = directions(theta)
    z = camera.project(homogeneous(m), camera.calib0).h
    back = camera.backproject(z, np.ones((len(z), 1)), camera.calib0)
    np.testing.assert_allclose(back.X[:, :3], m, atol=1e-9)
    J = camera.project(homogeneous(m), camera.calib0).dh_by_dX
    numeric = central_differences(
        lambda X, k: camera.project(X, k).h, (homogeneous(m), camera.calib0), 0
    )
    np.testing.assert_allclose(J, numeric, atol=2e-4)


@each_wide
def test_what_is_seen_ends_at_the_last_angle_not_at_the_plane_of_the_lens(camera):
    last = getattr(camera, "theta_max", None) or np.pi / 2 - camera.theta_min
    near_edge = np.pi / 2 + 0.5 * (last - np.pi / 2)
    behind_lens, beyond = (homogeneous(directions(t)) for t in (near_edge, last + 0.05))
    assert (behind_lens[:, 2] < 0).all()
    assert not (faults(camera, behind_lens) & Fault.BEHIND).any()
    assert (faults(camera, beyond) == Fault.BEHIND).all()
    assert faults(camera, np.array([[0, 0, 0.0, 1.0]])).tolist() == [Fault.BEHIND]


def test_the_default_omnidirectional_camera_sees_190_degrees_across():
    camera = Omnidirectional()
    edges = np.array([[0.0, 400.0], [1280.0, 400.0]])
    X = camera.backproject(edges, np.ones((2, 1)), camera.calib0).X
    across = np.rad2deg(equidistant.angle(X).sum())
    assert across == pytest.approx(189.5, abs=0.5)
    assert (faults(camera, X) == 0).all()


@each_wide
def test_pixels_outside_the_circle_of_a_lens_give_its_edge(camera):
    small = dataclasses.replace(camera, width=4000, height=4000)
    z = np.array([[0.0, 0.0], [4000.0, 4000.0], [4000.0, 300.0]])
    back = small.backproject(z, np.ones((3, 1)), small.calib0)
    for part in back:
        assert np.isfinite(part).all()


def test_any_order_of_the_polynomial_is_inverted():
    """A stereographic mirror, rho = 540 tan(alpha / 2), fitted by polynomials of growing order."""
    theta = np.linspace(-0.4, np.pi / 2, 200)
    rho = 540.0 * np.tan(0.5 * (np.pi / 2 - theta))
    for order in (3, 5, 9):
        # Exactly zero on the axis: fitted in alpha, then expanded in theta.
        alpha = np.pi / 2 - theta
        b = np.linalg.lstsq(alpha[:, None] ** np.arange(1, order + 1), rho)[0]
        in_theta = np.polynomial.Polynomial([0.0, *b])(np.polynomial.Polynomial([np.pi / 2, -1.0]))
        camera = Omnidirectional(polynomial=tuple(in_theta.coef), theta_min=-0.4)
        assert len(camera.calib_labels) == 5 + order + 1
        report = check(camera, seed=4)
        assert report.ok, str(report)


def test_on_the_axis_series_and_formula_meet():
    for theta in (0.999e-3, 1.001e-3):
        X = np.array([[theta, 0.0, 1.0, 1.0]])
        p, J = equidistant.flat(X)
        np.testing.assert_allclose(p, [[np.arctan(theta), 0.0]], rtol=1e-14)
        np.testing.assert_allclose(
            J[0, 0], [1 / (1 + theta**2), 0, -theta / (1 + theta**2)], rtol=1e-11
        )
    for t in (0.999e-2, 1.001e-2):
        m, J = equidistant.ray(np.array([[t, 0.0]]))
        np.testing.assert_allclose(m, [[np.sin(t), 0.0, np.cos(t)]], rtol=1e-13)
        np.testing.assert_allclose(J[0, :, 0], [np.cos(t), 0.0, -np.sin(t)], rtol=1e-11)


@pytest.mark.parametrize("polynomial", [(), (600.0,), (1.0, 200.0), (np.nan, -300.0)])
def test_a_polynomial_that_does_not_fall_is_refused(polynomial):
    with pytest.raises(ParamError, match="must fall"):
        Omnidirectional(polynomial=polynomial)
