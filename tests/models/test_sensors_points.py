"""Facts about the sensors of ranges and angles, of depth and of two pictures, by hand."""

import dataclasses

import numpy as np
import pytest

from scene_core.geometry.spaces import THREE_D
from scene_core.models import directions
from scene_core.models.base import Fault
from scene_core.models.check import check
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_2d import Point2D
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.registry import compatible
from scene_core.models.sensors.bearing_2d import PlanarBearing
from scene_core.models.sensors.depth_camera import DepthCamera
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_2d import PlanarRange
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.models.sensors.range_bearing_3d import RangeBearingElevation
from scene_core.models.sensors.stereo_head import StereoHead
from scene_core.models.sensors.stereo_pair import StereoPair

NONE = np.zeros(0)
POSE = THREE_D.identity()
IMAGE = dict(width=640, height=480, u0=320.0, v0=240.0, f_u=400.0, f_v=500.0)
STEREO = StereoPair(**IMAGE, baseline=0.2)
DEPTH = DepthCamera(**IMAGE)
HEAD = StereoHead(interocular=0.2)


def faults(sensor, X, xws=None, pose0=None, world=None):
    X = np.atleast_2d(np.array(X, dtype=float))
    pose = sensor.space.identity()
    pose0 = pose if pose0 is None else pose0
    h = sensor.project(X, sensor.calib0).h
    world = X if world is None else np.atleast_2d(world)
    at = pose if xws is None else xws
    return sensor.visibility(h, X, at, np.broadcast_to(pose0, (len(X), len(pose))), world).tolist()


def h_of(sensor, X):
    return sensor.project(np.array(X, dtype=float), sensor.calib0).h


@pytest.mark.parametrize(
    "sensor",
    [
        PlanarBearing(field_of_view=1.0),
        PlanarRange(reach_max=100.0),
        RangeBearingElevation(field_of_view=1.0, elevation_max=np.pi / 2),
        dataclasses.replace(DEPTH, depth_growth=0.0, reach_max=40.0),
        dataclasses.replace(STEREO, baseline=0.05, sd_row=3.0),
        StereoHead(interocular=0.06, pan_max=3.0),
    ],
    ids=lambda s: s.name,
)
def test_other_parameters_keep_the_laws(sensor):
    report = check(sensor, seed=1)
    assert report.ok, str(report)


def test_bearing_and_range_are_the_halves_of_range_bearing():
    X = np.random.default_rng(0).normal(size=(20, 3))
    X[:, 2] = np.abs(X[:, 2]) + 0.1
    both = RangeBearing().project(X, NONE)
    for sensor, row in ((PlanarRange(), 0), (PlanarBearing(), 1)):
        half = sensor.project(X, NONE)
        np.testing.assert_allclose(half.h[:, 0], both.h[:, row])
        np.testing.assert_allclose(half.dh_by_dX[:, 0], both.dh_by_dX[:, row])


def test_a_bearing_reaches_infinity_and_wraps():
    sensor = PlanarBearing(field_of_view=2.0)
    np.testing.assert_allclose(h_of(sensor, [[0, 2, 1], [1, 1, 0]])[:, 0], [np.pi / 2, np.pi / 4])
    assert faults(sensor, [[1, 1, 0], [0, 2, 1]]) == [0, Fault.OUTSIDE]
    nu = sensor.nu(np.array([3.1]), np.array([-3.1])).nu
    np.testing.assert_allclose(nu, [2 * np.pi - 6.2])


def test_what_one_measurement_leaves_open_is_said_and_refused():
    assert "rho" in (compatible(PlanarBearing(), Point2D()) or "")
    assert "bearing" in (compatible(PlanarRange(), Point2D()) or "")
    for sensor in (RangeBearingElevation(), DEPTH, STEREO, HEAD):
        assert compatible(sensor, EuclideanPoint()) is None
        assert compatible(sensor, InverseDepth()) is None


def test_an_open_bearing_is_any_place_on_the_circle():
    X = PlanarRange().backproject(np.array([2.0]), np.array([np.pi / 2]), NONE).X
    place = Point2D().initialise(np.array([1.0, 1.0, 0.0]), X).y
    np.testing.assert_allclose(place, [1.0, 3.0])
    assert faults(PlanarRange(reach_max=3.0), [[1, 0, 1], [4, 0, 1], [0.01, 0, 1]]) == [
        0,
        Fault.OUTSIDE,
        Fault.OUTSIDE,
    ]


def test_azimuth_turns_left_and_elevation_up_from_forward():
    sensor = RangeBearingElevation()
    seen = h_of(
        sensor, [[2, 0, 0, 1], [0, 3, 0, 1], [1, 0, 1, 1], [-1, 0, 0, 0.5], [0, 0, 1, 0.25]]
    )
    expected = [
        [2, 0, 0],
        [3, np.pi / 2, 0],
        [np.sqrt(2), 0, np.pi / 4],
        [2, np.pi, 0],
        [4, 0, np.pi / 2],
    ]
    np.testing.assert_allclose(seen, expected, atol=1e-8)
    X = sensor.backproject(np.array([4.0, np.pi / 2, np.pi / 6]), NONE, NONE).X
    np.testing.assert_allclose(X, [0, np.cos(np.pi / 6), 0.5, 0.25], atol=1e-12)
    assert faults(sensor, [[0.0, 0, 1, 0.25], [1, 0, 0, 0.01]]) == [Fault.OUTSIDE] * 2
    turned = sensor.nu(np.array([1.0, 3.1, 0.0]), np.array([1.0, -3.1, 0.1])).nu
    np.testing.assert_allclose(turned, [0, 2 * np.pi - 6.2, 0.1])


@pytest.mark.parametrize("sensor", [RangeBearingElevation(), HEAD], ids=lambda s: s.name)
def test_straight_up_everything_is_finite(sensor):
    poles = np.vstack([np.eye(4), -np.eye(4)[:3], np.zeros((1, 4)), [[0, 0, 1e-9, 1]]])
    for part in sensor.project(poles, sensor.calib0):
        assert np.isfinite(part).all()


@pytest.mark.parametrize("axes", [directions.FLU, directions.SCENE], ids=str)
def test_angles_and_direction_are_inverse_with_their_jacobians(axes):
    a, e = np.random.default_rng(1).uniform(-1.4, 1.4, (2, 30))
    ray = directions.direction(a, e, axes)
    back = directions.angles(3.0 * ray.m, axes)
    np.testing.assert_allclose(back.value, np.stack([a, e], -1), atol=1e-12)
    np.testing.assert_allclose(
        3.0 * back.by_m @ ray.by_angles, np.broadcast_to(np.eye(2), (30, 2, 2)), atol=1e-12
    )


def test_depth_is_measured_along_the_axis_not_along_the_ray():
    np.testing.assert_allclose(h_of(DEPTH, [1.5, -1, 2, 1]), [620, -10, 2])
    np.testing.assert_allclose(h_of(DEPTH, [1.5, -1, 2, 0.5])[2], 4.0)
    X = DEPTH.backproject(np.array([620.0, 240.0, 2.0]), NONE, DEPTH.calib0).X
    np.testing.assert_allclose(X, [0.6, 0.0, 0.8, 0.4], atol=1e-12)


def test_the_noise_of_a_depth_grows_with_its_square():
    sensor = DepthCamera(sd_px=0.5, sd_depth=0.01, depth_growth=0.02, reach_max=5.0)
    R = sensor.R(np.array([[10.0, 10.0, 0.0], [10.0, 10.0, 2.0], [10.0, 10.0, 1e12]]))
    np.testing.assert_allclose(np.sqrt(R[:, 2, 2]), [0.01, 0.09, 0.51])
    np.testing.assert_allclose(R[:, 0, 0], 0.25)


def test_a_depth_camera_sees_what_a_camera_sees_within_its_reach():
    X = [[0, 0, 2, 1], [0, 0, 0.2, 1], [0, 0, 9, 1], [0, 0, -2, 1], [5, 0, 2, 1], [0, 0, 1, 0]]
    out, behind = Fault.OUTSIDE, Fault.BEHIND
    assert faults(DEPTH, X) == [0, out, out, behind, out, out]
    again = DEPTH.with_calib(DEPTH.calib0 * 1.1)
    np.testing.assert_allclose(again.calib0, DEPTH.calib0 * 1.1)


def test_the_right_picture_is_that_of_a_camera_one_baseline_to_the_right():
    left, X = Pinhole(**IMAGE), np.array([[0.3, -0.1, 2.0, 1.0], [0.1, 0.1, 1.0, 0.0]])
    right = THREE_D.to_local(np.array([0.2, 0, 0, 1, 0, 0, 0]), X).X
    expected = np.hstack([left.project(X, left.calib0).h, left.project(right, left.calib0).h])
    np.testing.assert_allclose(h_of(STEREO, X), expected)
    np.testing.assert_allclose(h_of(STEREO, X[0]), [380, 215, 340, 215])
    assert expected[1, 0] == expected[1, 2]  # at infinity there is no disparity


def test_a_stereo_measurement_is_placed_by_its_disparity():
    X = STEREO.backproject(np.array([380.0, 215.0, 340.0, 215.0]), NONE, STEREO.calib0).X
    np.testing.assert_allclose(X[:3] / X[3], [0.3, -0.1, 2.0])
    np.testing.assert_allclose(np.linalg.norm(X[:3]), 1.0)


def test_rows_that_differ_are_averaged_which_is_least_squares():
    z, k = np.array([380.0, 217.0, 340.0, 213.0]), STEREO.calib0
    X = STEREO.backproject(z, NONE, k).X
    h = STEREO.project(X, k)
    np.testing.assert_allclose(h.h, [380, 215, 340, 215])
    # At the least-squares point no move of it brings the residual down.
    np.testing.assert_allclose((z - h.h) @ h.dh_by_dX, 0.0, atol=1e-9)


@pytest.mark.parametrize("disparity", [0.1, 0.0, -3.0])
def test_a_pair_beyond_infinity_starts_far_away_and_uncertain(disparity):
    sensor = dataclasses.replace(STEREO, reach_max=100.0)
    z = np.array([320.0 + disparity, 240.0, 320.0, 240.0])
    r = sensor.backproject(z, NONE, sensor.calib0)
    assert r.X[2] / r.X[3] == pytest.approx(100.0)
    np.testing.assert_allclose(r.dX_by_dz[3], np.array([1, 0, -1, 0]) / (400 * 0.2), rtol=1e-4)


def test_both_pictures_must_show_a_point():
    # At depth 1 the right picture is 80 px to the left.
    left_edge, right_edge = [-0.75, 0, 1, 1], [0.79, 0, 1, 1]
    assert faults(STEREO, [left_edge, right_edge, [0, 0, -1, 1]]) == [
        Fault.OUTSIDE,
        0,
        Fault.BEHIND,
    ]
    assert h_of(STEREO, left_edge)[0] > 0


def test_rows_of_a_pair_may_be_noisier_than_columns():
    h = np.zeros((1, 4))
    R = dataclasses.replace(STEREO, sd_px=2.0, sd_row=3.0).R(h)[0]
    np.testing.assert_allclose(np.diag(R), [4, 9, 4, 9])
    np.testing.assert_allclose(dataclasses.replace(STEREO, sd_px=2.0).R(h)[0], 4 * np.eye(4))


def test_the_head_pans_to_the_left_and_converges_on_near_points():
    seen = h_of(HEAD, [[0, 0, 0.1, 1], [2, 0, 2, 1], [0, 1, 1, 1], [0, 0, 1, 0]])
    expected = [
        [0, 0, np.pi / 4],
        [np.pi / 4, 0, np.arctan(0.1 / np.sqrt(8))],
        [0, np.pi / 4, np.arctan(0.1 / np.sqrt(2))],
        [0, 0, 0],
    ]
    np.testing.assert_allclose(seen, expected, atol=1e-12)
    z = np.array([0.0, np.pi / 6, np.arctan(0.1 / 2)])
    X = HEAD.backproject(z, NONE, HEAD.calib0).X
    np.testing.assert_allclose(X[:3] / X[3], [0, 1, np.sqrt(3)], atol=1e-12)


def test_what_the_head_can_turn_to_and_recognise():
    out = Fault.OUTSIDE
    X = [[0, 0, 2, 1], [1, 0, -0.1, 1], [0, 2, 2, 1], [0, 0, 0.09, 1], [0, 0, 1, 0]]
    assert faults(HEAD, X) == [0, out, out, out, 0]
    point, at = [0.0, 0.0, 2.0, 1.0], lambda *t: np.r_[t, 1.0, 0.0, 0.0, 0.0]
    assert faults(HEAD, point, pose0=at(0, 0, -0.81)) == [Fault.SCALE]  # 2.81 m then, 2 m now
    assert faults(HEAD, point, pose0=at(0, 0, -0.79)) == [0]
    assert faults(HEAD, point, pose0=at(1.4, 0, 0.58)) == [0]
    assert faults(HEAD, point, pose0=at(1.4, 0, 0.62)) == [Fault.ANGLE]  # 45.4 degrees


def test_the_score_of_the_head_is_the_volume_to_search():
    E = np.tile(np.diag([1e-4, 4e-4, 1e-6]), (2, 1, 1))
    E[1] = 0.0
    R = np.array([0.002, 0.01, 0.002]) ** 2
    S = np.array([np.prod(np.array([1e-4, 4e-4, 1e-6]) + R), np.prod(R)])
    np.testing.assert_allclose(HEAD.selection_score(E), 4 / 3 * np.pi * np.sqrt(S))
