"""Lines and particles in a camera's pane and in the inspector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene_core.filter.ports import Points
from scene_core.filter.records import Predictions, Trace
from scene_core.geometry.ellipses import sigma
from scene_core.models import segments
from scene_core.session.published import Published
from tests.web.line_runs import shown
from web_panels import line_marks
from web_panels.drawing import from_curve, hit, paint, shapes_of
from web_panels.inspector import inspector_html
from web_panels.inspector_more import histogram, settling
from web_panels.marks import Scene, scene_of
from web_panels.sensor_image import image_chart
from web_panels.style import C


def scene(p: Published) -> Scene:
    found = scene_of(p, "camera")
    assert found is not None
    return found


def trace_of(kind: str) -> Trace:
    trace = shown(kind).trace
    assert trace is not None
    return trace


def lines_of(trace: Trace) -> Predictions:
    return next(p for p in trace.predictions("camera") if p.shape == "segment")


def coloured(picture: np.ndarray, at: np.ndarray, colour: str) -> bool:
    x, y = np.round(at).astype(int)
    patch = picture[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3].astype(int)
    return bool((np.abs(patch - C[colour]).max(-1) < 60).any())


def test_drawn_lines_lie_in_their_planes() -> None:
    """n . r = 0 along the predicted curve, and sin(half_width sd) along the rim of its band."""
    trace = trace_of("house")
    p = lines_of(trace)
    world = next(r.world for r in trace.records if r.phase == "select")
    sensor, k = world.mounts["camera"].sensor, world.mount_calib("camera")
    drawn = line_marks.shapes(sensor, k, p, p.S, [(None, None)] * len(p.labels), 0.99)
    some = 0
    for i, shape in enumerate(drawn):
        if p.fault[i] or shape is None:
            continue
        some += 1
        rays = line_marks.rays(sensor, k, shape.curve)
        np.testing.assert_allclose(rays @ p.h[i], 0.0, atol=1e-5)
        off = line_marks.rays(sensor, k, shape.band) @ p.h[i]
        expected = np.sin(np.minimum(sigma(2, 0.99) * np.sqrt(np.diag(p.S[i])), 0.5))
        np.testing.assert_allclose(off[[0, 16]], expected, rtol=1e-4)
        np.testing.assert_allclose(off[[33, 17]], -expected, rtol=1e-4)
    assert some > 5


def test_a_distorting_lens_bends_lines() -> None:
    trace = trace_of("house")
    camera = trace.world.mounts["camera"].sensor
    ends = np.array([[40.0, 30.0, 600.0, 40.0]])
    (bent,) = line_marks.curves(camera, camera.calib0, ends)
    straight = np.array([*camera.calib0[:4], 0.0, 0.0])
    (flat,) = line_marks.curves(camera, straight, ends)
    np.testing.assert_allclose(bent[[0, -1]], ends.reshape(2, 2), atol=1e-6)
    assert from_curve(bent[8], ends.reshape(2, 2)) > 5.0
    assert max(from_curve(q, ends.reshape(2, 2)) for q in flat) < 1e-6


def test_the_pane_shows_measured_and_predicted_lines_and_a_click_selects() -> None:
    p = shown("house")
    drawn = scene(p)
    raw = drawn.raw
    assert isinstance(raw, Points) and raw.lines is not None
    assert len(drawn.raw_lines) == len(raw.lines.z) > 5
    chart = image_chart(trace_of("house").world.mounts["camera"].sensor, drawn)
    picture, shapes = paint(drawn, chart, truth=True)
    plain = chart.background(drawn)
    middle = chart.place(drawn.raw_lines[:, 8])
    assert all(coloured(plain, at, "ink") for at in middle)
    accepted = [s for s in shapes if s.mark.state == "accepted"]
    assert len(accepted) > 3 and drawn.counts["partial"] == 0
    for s in accepted:
        assert s.seen is not None and s.true_curve is not None and len(s.contours) == 1
        assert hit(shapes, s.seen[3], 2.0) is not None
    assert hit(shapes, np.array([-300.0, -300.0]), 5.0) is None
    alone = accepted[0]
    assert alone.curve is not None
    assert hit([alone], alone.curve[5], 1.0) == alone.mark.label
    chosen, _ = paint(scene(replace(p, selected=alone.mark.label)), chart, truth=False)
    white = (chosen == 255).all(-1).sum()
    assert white > (picture == 255).all(-1).sum() + 100


def test_the_truth_does_not_hide_what_became_of_a_line() -> None:
    """Along a measured line the colour of its state is on top, on all but where others cross it."""
    s = scene(shown("house"))
    chart = image_chart(trace_of("house").world.mounts["camera"].sensor, s)
    picture, shapes = paint(s, chart, truth=True)
    told = 0
    for shape in shapes:
        if shape.mark.state != "accepted" or shape.seen is None or shape.true_curve is None:
            continue
        x, y = np.round(shape.seen[1:-1]).astype(int).T
        inside = (x >= 0) & (x < picture.shape[1]) & (y >= 0) & (y < picture.shape[0])
        off = np.abs(picture[y[inside], x[inside]].astype(int) - C["accepted"]).max(-1)
        assert np.mean(off < 60) > 0.7
        told += 1
    assert told > 3


def test_points_and_lines_share_a_pane() -> None:
    drawn = scene(shown("corridor"))
    chart = image_chart(trace_of("corridor").world.mounts["camera"].sensor, drawn)
    shapes = shapes_of(drawn, chart)
    assert any(s.curve is None for s in shapes) and any(s.curve is not None for s in shapes)


@pytest.mark.parametrize("verdict", ["accepted", "rejected", "no match", "not selected"])
def test_the_inspector_says_how_far_the_ends_are_off_the_line(verdict: str) -> None:
    trace = trace_of("house")
    a = next(a for a in trace.associations() if a.verdict == "accepted")
    assert a.nu is not None and a.z is not None
    changed = replace(a, verdict=verdict)
    records = tuple(
        replace(r, associations=tuple(changed if x is a else x for x in r.associations))
        for r in trace.records
    )
    html = inspector_html(replace(trace, records=records), a.label, own_choice=False)
    assert "ends expected" in html and "normal of the plane" in html and "mrad" in html
    assert all(f'<td class="d">{name}</td>' in html for name in segments.LABELS)
    assert f"{1e3 * a.nu[0]:+.2f}".replace("-", "\N{MINUS SIGN}") in html


def test_pixels_per_radian_is_what_a_small_turn_moves() -> None:
    """Of a lens without distortion, at its centre, the focal length."""
    camera = trace_of("house").world.mounts["camera"].sensor
    k = np.array([*camera.calib0[:4], 0.0, 0.0])
    z = np.array([320.0, 240.0, 320.0, 240.0])
    px = line_marks.pixels_per_radian(camera, k, z, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(px, 320.0, rtol=1e-6)


def test_particles_are_dots_and_a_histogram() -> None:
    trace = trace_of("particles")
    p = next(p for p in trace.predictions("camera") if p.particles is not None)
    drawn = scene(shown("particles"))
    mark = next(m for m in drawn.marks if m.label == p.labels[0])
    assert mark.particles is not None and p.particles is not None
    h, w = mark.particles
    alive = p.particles[1][0] > 0.0
    np.testing.assert_array_equal(h, p.particles[0][0][alive])
    assert w.max() == 1.0
    chart = image_chart(trace.world.mounts["camera"].sensor, drawn)
    picture, _ = paint(drawn, chart, truth=False)
    assert (np.abs(picture.astype(int) - C["partial"]).max(-1) < 40).sum() > 50
    html = inspector_html(trace, p.labels[0], own_choice=False)
    f = next(f for f in trace.world.features.values() if f.particles is not None)
    assert f.particles is not None and "nearest particle" in html
    half_done = replace(trace, records=trace.records[:-1])
    assert " left, mean" in inspector_html(half_done, p.labels[0], own_choice=False)
    assert "0.3" in settling(f) and "mean" in settling(f)
    bars = histogram(f.particles, 0, 2.0, 0.5, "m")
    assert bars.count("<rect") > 5


def test_lines_and_particles_are_told_as_they_are_born() -> None:
    for kind in ("house", "particles"):
        trace = trace_of(kind)
        first = min(f.label for f in trace.world.features.values() if f.born > 0)
        born = replace(trace, start=replace(trace.start, features={}))
        html = inspector_html(born, first, own_choice=True)
        assert "Started in this frame" in html
        assert any(m.label == first for m in scene(replace(shown(kind), trace=born)).marks)
