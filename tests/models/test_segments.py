"""How sensors of directions see straight lines: whatever the lens, beyond 90 degrees too."""

from functools import partial

import numpy as np
import pytest

from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import THREE_D
from scene_core.models import registry, segments
from scene_core.models.features.inverse_depth_line import InverseDepthLine
from scene_core.models.judge import judge_jacobians, own_scale
from scene_core.models.sensors.fisheye import Fisheye
from scene_core.models.sensors.omnidirectional import Omnidirectional
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.models.sensors.stereo_pair import StereoPair
from scene_core.models.sensors.wide_angle import WideAngle

CAMERAS = [Pinhole(distortion=(-0.3, 0.1)), WideAngle(), Fisheye(), Omnidirectional()]
each_camera = pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.name)
rng = np.random.default_rng(11)


def in_view(camera, count=8):
    """Ends z (count, 4) inside the image, and the segments X (count, 8) they belong to."""
    lo, hi = np.array(camera.limits).T
    z = np.tile(lo + 0.2 * (hi - lo), 2) + 0.6 * np.tile(hi - lo, 2) * rng.random((count, 4))
    return z, segments.backproject(camera, z, rng.uniform(0.1, 0.6, (count, 2)), camera.calib0).X


def right(names, function, *args):
    """Every Jacobian of a function of single rows against central differences."""
    flat = np.zeros(len(function(*args)[0]), dtype=bool)
    assert not judge_jacobians(names, function, args, flat, [own_scale(a) for a in args])


@each_camera
def test_every_jacobian_is_exact(camera):
    z, X = in_view(camera)
    for zi, Xi in zip(z, X, strict=True):
        right(("by_X",), segments.normal, Xi)
        off, n = zi + rng.standard_normal(4), segments.normal(Xi).n
        measured = partial(segments.end_distances, camera)
        right(("by_n", "by_z", "by_k"), measured, n, off, camera.calib0)
        seen = partial(segments.backproject, camera)
        right(("by_z", "by_n", "by_k"), seen, zi, np.array([0.3, 0.1]), camera.calib0)


def test_seen_from_elsewhere_with_the_right_jacobians():
    X = rng.standard_normal((5, 8))
    xp = THREE_D.normalise(rng.standard_normal(7))[0]
    for move in (segments.to_local, segments.to_world):
        _, by_xp, by_X = move(THREE_D, xp, X)
        numeric = [
            central_differences(lambda xp, X, move=move: move(THREE_D, xp, X)[0], (xp, X), i)
            for i in range(2)
        ]
        np.testing.assert_allclose(by_xp, numeric[0], atol=1e-8)
        np.testing.assert_allclose(np.broadcast_to(by_X, (5, 8, 8)), numeric[1], atol=1e-8)
    there = segments.to_local(THREE_D, xp, X)[0]
    np.testing.assert_allclose(segments.to_world(THREE_D, xp, there)[0], X, atol=1e-12)


@each_camera
def test_ends_on_the_line_have_no_distance_wherever_they_are(camera):
    """Ends may slide: any two points of a line measure nothing against it."""
    _, X = in_view(camera)
    n = segments.normal(X).n
    for s in (0.1, 0.5, 0.9):
        place = (1.0 - s) * X[:, :4] + s * X[:, 4:]
        h = camera.project(place, camera.calib0).h
        nu = segments.end_distances(camera, n, np.tile(h, 2), camera.calib0).nu
        np.testing.assert_allclose(nu, 0.0, atol=1e-7)


def test_a_line_is_the_same_whichever_points_it_is_told_by():
    _, X = in_view(Pinhole())
    a, b, scale = rng.uniform(-2, 2, (3, len(X), 1))
    other = np.concatenate([X[:, :4] + a * X[:, 4:], scale * (X[:, 4:] + b * X[:, :4])], axis=1)
    n, m = segments.normal(X).n, segments.normal(other).n
    np.testing.assert_allclose(np.abs(np.vecdot(n, m)), 1.0, atol=1e-12)


def test_a_distance_is_an_angle():
    """An end 0.01 rad beside the line measures sin 0.01, near the axis and far from it."""
    camera = Omnidirectional()
    n = np.array([0.0, 1.0, 0.0])
    for a in (0.3, 1.2, 1.62):
        ray = np.array([np.cos(0.01) * np.sin(a), np.sin(0.01), np.cos(0.01) * np.cos(a), 0.0])
        z = np.tile(camera.project(ray, camera.calib0).h, 2)
        nu = segments.end_distances(camera, n, z, camera.calib0).nu
        np.testing.assert_allclose(nu, np.sin(0.01), rtol=1e-4)


@pytest.mark.parametrize("camera", [Omnidirectional(), Fisheye()], ids=lambda c: c.name)
def test_a_line_that_passes_beside_the_sensor_is_seen_whole(camera):
    """From 40 degrees to 93 degrees off the axis, behind the sensor's plane."""
    ahead, behind = (np.array([np.sin(a), 0.2, np.cos(a), 0.4]) for a in np.radians((40, 93)))
    h = [camera.project(X, camera.calib0).h for X in (ahead, behind)]
    assert np.isfinite(h).all()
    n = segments.normal(np.concatenate([ahead, behind])).n
    nu = segments.end_distances(camera, n, np.concatenate(h), camera.calib0).nu
    np.testing.assert_allclose(nu, 0.0, atol=1e-6)


def test_which_sensors_see_lines():
    for camera in CAMERAS:
        assert segments.seen_by(camera) is None
        assert registry.compatible(camera, InverseDepthLine()) is None
    assert "can not measure lines" in (registry.compatible(StereoPair(), InverseDepthLine()) or "")
    assert "2-D" in (registry.observable(RangeBearing(), InverseDepthLine()) or "")
