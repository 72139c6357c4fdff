"""Every kind of sensor in its pane: what it measures is drawn where it was measured, and a click
there means it."""

from __future__ import annotations

import re
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from scene_core import params
from scene_core.filter.ports import Points
from scene_core.filter.records import Trace
from scene_core.models.base import Sensor
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.sensors.bearing_2d import PlanarBearing
from scene_core.models.sensors.depth_camera import DepthCamera
from scene_core.models.sensors.range_2d import PlanarRange
from scene_core.models.sensors.range_bearing_3d import RangeBearingElevation
from scene_core.models.sensors.stereo_head import StereoHead
from scene_core.models.sensors.stereo_pair import StereoPair
from scene_core.session.commands import InitialiseAt
from scene_core.session.published import Published
from scene_core.session.session import Session
from tests.sensor_worlds import (
    FLU_ON_FLU,
    OPTICAL_ON_FLU,
    SCENE_ON_FLU,
    cloister_seen_by,
    field_seen_by,
)
from web_panels import map_geometry
from web_panels.drawing import Chart, hit, paint, shapes_of
from web_panels.inspector import inspector_html
from web_panels.marks import Scene, scene_of
from web_panels.panel import Page
from web_panels.sensor_image import image_chart, image_words
from web_panels.sensor_pane import limits_words
from web_panels.sensor_polar import SensorPolar
from web_panels.style import C

IMAGE: dict[str, Any] = dict(width=640, height=480, u0=320.0, v0=240.0, f_u=400.0, f_v=400.0)
POSES = {
    RangeBearingElevation(): FLU_ON_FLU,
    DepthCamera(**IMAGE): OPTICAL_ON_FLU,
    StereoPair(**IMAGE): OPTICAL_ON_FLU,
    StereoHead(): SCENE_ON_FLU,
    PlanarBearing(): None,
    PlanarRange(): None,
}
each_sensor = pytest.mark.parametrize("sensor", POSES, ids=lambda s: s.name)


@cache
def session_of(sensor: Sensor) -> Session:
    """Four frames seen by a sensor; depths are open where that makes sense."""
    pose = POSES[sensor]
    experiment = (
        field_seen_by(sensor) if pose is None else cloister_seen_by(sensor, pose, InverseDepth())
    )
    session = Session(experiment)
    for _ in range(4):
        session.advance()
    return session


def shown(sensor: Sensor) -> tuple[Scene, Chart]:
    """What the pane of a sensor draws, and its chart."""
    trace = session_of(sensor).trace
    p = SimpleNamespace(trace=trace, selected=_accepted(trace), mode="paused", run=1, seq=1)
    scene = scene_of(cast(Published, p), "sensor")
    assert scene is not None
    if sensor.pane == "image":
        return scene, image_chart(sensor, scene)
    return scene, SensorPolar(Page(), "sensor").chart(sensor, scene)


def _accepted(trace: Trace | None) -> int:
    assert trace is not None
    return next(a.label for a in trace.associations() if a.verdict == "accepted")


def near(picture: np.ndarray, at: np.ndarray, colour: str) -> bool:
    x, y = np.round(at).astype(int)
    patch = picture[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3].astype(int)
    return bool((np.abs(patch - C[colour]).max(-1) < 60).any())


@each_sensor
def test_everything_a_sensor_gives_is_drawn(sensor):
    scene, chart = shown(sensor)
    picture, shapes = paint(scene, chart, truth=True)
    assert picture.shape == (chart.size[1], chart.size[0], 3)
    assert scene.counts["accepted"] > 3
    assert len(shapes) == len(scene.marks)
    assert all(np.isfinite(s.contours).all() and np.isfinite(s.centre).all() for s in shapes)
    assert isinstance(scene.raw, Points) and len(scene.raw.z) > 3
    plain = chart.background(scene)
    lane = np.zeros(len(scene.raw.z))
    if sensor.measurement_size > 1:
        assert all(near(plain, at, "ink") for at in chart.place(scene.raw.z, lane))


def test_the_inspector_tells_angles_in_degrees():
    trace = session_of(PlanarBearing()).trace
    assert trace is not None
    page = inspector_html(trace, _accepted(trace), own_choice=False)
    assert "1 sigma" in page and not re.search(r"\d rad", page)


@each_sensor
def test_a_click_on_a_place_is_the_measurement_there(sensor):
    scene, chart = shown(sensor)
    z = scene.marks[0].h
    at = chart.measurement(chart.place(z[None], np.array([3]))[0])
    assert at is not None and 1 <= len(at) <= sensor.measurement_size
    np.testing.assert_allclose(at, z[: len(at)], atol=1e-6)
    assert chart.measurement(np.array([-900.0, -900.0])) is None
    shapes = shapes_of(scene, chart)
    assert hit(shapes, shapes[0].centre, 5.0) is not None


@each_sensor
def test_regions_hold_the_prediction_and_grow_with_their_sigma(sensor):
    _, chart = shown(sensor)
    scene, _ = shown(sensor)
    mark = next(m for m in scene.marks if m.S is not None and m.string is None)
    lane = np.array([mark.label])
    assert mark.S is not None
    area = []
    for half in (1.0, 3.0):
        c = chart.outlines(mark.h[None], mark.S[None], half, lane)[0]
        x, y = c.T
        area.append(0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
    assert area[1] > 2.5 * area[0] > 0.0


def test_a_bearing_is_a_ray_and_its_region_a_sector():
    sensor = PlanarBearing()
    scene, chart = shown(sensor)
    picture = chart.background(scene)
    assert isinstance(scene.raw, Points)
    middle = np.array(chart.size) / 2
    for (b,) in scene.raw.z:
        way = np.array([-np.sin(b), -np.cos(b)])
        assert all(near(picture, middle + r * way, "ink") for r in (60.0, 150.0, 240.0))
    contour = chart.outlines(np.array([[0.3]]), np.array([[[0.01]]]), 2.0, np.zeros(1))[0]
    out = contour[1:] - contour[0]
    angles = np.arctan2(-out[:, 0], -out[:, 1])
    np.testing.assert_allclose([angles.min(), angles.max()], [0.1, 0.5], atol=1e-9)


def test_a_range_is_a_circle_and_its_region_a_ring():
    scene, chart = shown(PlanarRange())
    picture = chart.background(scene)
    middle, scale = np.array(chart.size) / 2, chart.disc.scale  # type: ignore[attr-defined]
    assert isinstance(scene.raw, Points)
    for (r,) in scene.raw.z:
        for b in (0.4, 2.0, 5.0):
            assert near(picture, middle + scale * r * np.array([np.cos(b), np.sin(b)]), "ink")
    contour = chart.outlines(np.array([[3.0]]), np.array([[[0.01]]]), 2.0, np.zeros(1))[0]
    radii = np.linalg.norm(contour - middle, axis=1) / scale
    np.testing.assert_allclose(np.unique(np.round(radii, 6)), [2.8, 3.2])


def test_the_head_has_its_left_on_the_left_and_up_above():
    _, chart = shown(StereoHead())
    ahead, left, up = chart.place(np.array([[0, 0, 0.1], [0.5, 0, 0], [0, 0.5, 0]]), np.zeros(3))
    np.testing.assert_allclose(ahead, np.array(chart.size) / 2)
    assert left[0] < ahead[0] and left[1] == ahead[1]
    assert up[1] < ahead[1] and up[0] == ahead[0]


def test_the_words_about_a_sensor_name_all_it_measures():
    assert image_words(DepthCamera(**IMAGE)) == ("640 × 480 px", "depth 0.3 to 8 m")
    assert image_words(StereoPair(**IMAGE)) == ("two pictures of 640 × 480 px",)
    assert limits_words(PlanarBearing()) == ("b ±180°",)
    drawn, other = limits_words(StereoHead())
    assert drawn == "pan ±90°, elevation ±40°"
    assert other == "vergence 0.516° to 45°"


@pytest.mark.parametrize(
    "sensor", [DepthCamera(**IMAGE), StereoPair(**IMAGE)], ids=lambda s: s.name
)
def test_a_camera_that_measures_more_has_the_frustum_of_a_camera(sensor):
    fov, aspect = map_geometry.view_angle(sensor, sensor.calib0)
    assert fov == pytest.approx(2 * np.arctan(240 / 400))
    assert aspect == pytest.approx(640 / 480)


@pytest.mark.parametrize("sensor", [s for s, pose in POSES.items() if pose], ids=lambda s: s.name)
def test_a_feature_can_be_started_by_a_click(sensor):
    """The click has as many components as the picture; the measurement there supplies the rest."""
    pose = POSES[sensor]
    assert pose is not None
    experiment = cloister_seen_by(sensor, pose, InverseDepth())
    experiment = params.replace(experiment, "estimator.policies.management.keep_visible", 0)
    session = Session(experiment)
    session.advance()
    assert session.trace is not None and not session.world.features
    raw = session.trace.frame.raw["sensor"]
    assert isinstance(raw, Points)
    session.apply(InitialiseAt("sensor", tuple(raw.z[0, :2].tolist()), session.frame))
    (feature,) = session.world.features.values()
    np.testing.assert_array_equal(feature.z0, raw.z[0])


def test_ids_stand_at_the_crosses_where_regions_span_the_chart():
    """One that was put outside a ring as large as the chart would belong to nothing."""
    scene, chart = shown(PlanarRange())
    inside, shapes = paint(scene, chart, truth=False)
    chart.wide = False
    outside, _ = paint(scene, chart, truth=False)
    moved = (inside != outside).any(-1)
    for s in shapes:
        if s.mark.state == "accepted":
            x, y = np.round(s.centre).astype(int)
            assert moved[max(0, y - 40) : y + 40, max(0, x - 70) : x + 70].sum() > 30
