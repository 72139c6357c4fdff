"""The pictures of the sensor panes: what is drawn where, and what a click hits."""

import numpy as np
import pytest

from scene_core.filter.ports import Image, Points, Raw
from scene_core.geometry.ellipses import ellipse_points
from web_panels.drawing import hit, paint, shapes_of
from web_panels.labels import Drawn, Occupancy
from web_panels.marks import Mark, Scene
from web_panels.painter import Painter
from web_panels.polar_charts import PolarChart, nice_reach
from web_panels.ray_marks import String
from web_panels.sensor_bar import BarChart
from web_panels.sensor_image import ImageChart
from web_panels.style import C

GREY = Image(np.full((240, 320), 90, np.uint8))
CHART = ImageChart(320, 240)
S = np.array([[30.0, 8.0], [8.0, 20.0]])


def scene(*marks: Mark, raw: Raw = GREY) -> Scene:
    return Scene("camera", 3, raw, marks, 3.0)


def near(picture: np.ndarray, at: np.ndarray, colour: str, reach: int = 2) -> bool:
    """Whether the colour is found within some pixels of a place."""
    x, y = np.round(at).astype(int)
    patch = picture[max(0, y - reach) : y + reach + 1, max(0, x - reach) : x + reach + 1]
    return bool((np.abs(patch.astype(int) - C[colour]).max(-1) < 40).any())


@pytest.mark.parametrize("state", ["accepted", "nomatch", "unselected", "ink"])
def test_the_outline_is_the_ellipse_at_the_stated_sigma(state):
    h = np.array([120.0, 100.0])
    picture, _ = paint(scene(Mark(7, state, h, S)), CHART, truth=False)
    for half, drawn in ((3.0, True), (2.0, False), (4.0, False)):
        rim = CHART.place(ellipse_points(h, S, half, 24))
        found = np.mean([near(picture, q, state) for q in rim])
        assert found == 1.0 if drawn else found < 0.3


def test_a_rejected_outline_is_dashed():
    h = np.array([120.0, 100.0])
    picture, _ = paint(scene(Mark(7, "rejected", h, S)), CHART, truth=False)
    rim = CHART.place(ellipse_points(h, S, 3.0, 120))
    found = [near(picture, q, "rejected", 1) for q in rim]
    assert 0.3 < np.mean(found) < 0.9


def test_an_accepted_match_has_its_patch_at_its_place_and_size_and_a_line_to_it():
    h, z = np.array([120.0, 100.0]), np.array([140.0, 100.0])
    mark = Mark(7, "accepted", h, S / 4, z=z, patch=13)
    picture, _ = paint(scene(mark), CHART, truth=False)
    centre, half = CHART.place(z), 13 / 2 * CHART.magnification
    for corner in ([-1, -1], [1, -1], [1, 1], [-1, 1], [0, 1]):
        assert near(picture, centre + half * np.array(corner), "accepted")
    assert near(picture, CHART.place((h + z) / 2), "accepted", 1)


def test_truth_is_drawn_only_when_it_is_to_be_shown():
    mark = Mark(7, "accepted", np.array([120.0, 100.0]), S, true_z=np.array([130.0, 110.0]))
    for truth in (True, False):
        picture, _ = paint(scene(mark), CHART, truth)
        assert near(picture, CHART.place(np.array([130.0, 110.0])), "truth", 6) is truth


def test_the_selected_one_has_a_white_outline_and_its_id():
    mark = Mark(7, "unselected", np.array([120.0, 100.0]), S)
    plain, _ = paint(scene(mark), CHART, truth=False)
    chosen, _ = paint(scene(Mark(**{**vars(mark), "selected": True})), CHART, truth=False)
    white = [(np.abs(p.astype(int) - 255).max(-1) < 20).sum() for p in (plain, chosen)]
    assert white[0] == 0 and white[1] > 200


def test_a_partial_feature_is_a_string_of_ellipses():
    h = np.array([[80.0, 100.0], [120.0, 110.0], [160.0, 120.0]])
    mark = Mark(7, "accepted", h[1], S, partial=True, string=String(h, S / 4))
    picture, _ = paint(scene(mark), CHART, truth=False)
    for middle in h:
        rim = CHART.place(ellipse_points(middle, S / 4, 3.0, 16))
        assert all(near(picture, q, "partial") for q in rim)


def test_ids_touch_neither_ellipses_nor_each_other():
    rng = np.random.default_rng(1)
    marks = []
    for i in range(24):
        A = rng.normal(size=(2, 2)) * 5
        h = rng.uniform((25, 25), (295, 215))
        marks.append(Mark(i + 80, "accepted", h, A @ A.T + np.eye(2), z=h + 3, patch=11))
    shapes = shapes_of(scene(*marks), CHART)
    painter = Painter(CHART.background(scene()))
    boxes = Occupancy(painter.canvas.shape, shapes, painter.u)
    w, h = painter.text_size("88", 0.58)
    placed = [at for s in shapes if (at := boxes.place(s, w, h, must=False)) is not None]
    assert len(placed) >= 12
    taken = np.zeros(painter.canvas.shape[:2], bool)
    outline = np.zeros_like(painter.canvas)
    bare = Painter(outline)
    for s in shapes:
        bare.rings(s.contours, (255, 255, 255), 2.4)
        assert s.match is not None
        bare.square(s.match, (255, 255, 255), s.half, 1.8)
    for x, y in placed:
        box = (slice(y - h, y), slice(x, x + w))
        assert not outline[box].any()
        assert not taken[box].any()
        taken[box] = True


def test_the_id_of_a_line_is_beside_it_not_at_its_far_end():
    along = np.stack([np.linspace(100.0, 700.0, 17), np.linspace(120.0, 480.0, 17)], axis=-1)
    line = Drawn(along[8], along[None], None, None, 5.0)
    at = Occupancy((600, 800, 3), [line], 1.25).place(line, 30, 15, must=False)
    assert at is not None
    middle = np.array([at[0] + 15.0, at[1] - 7.5])
    assert np.linalg.norm(along - middle, axis=1).min() < 90
    assert np.linalg.norm(along[8] - middle) < 110


def test_an_id_without_room_is_left_out_but_not_that_of_the_selected_one():
    huge = Mark(1, "nomatch", np.array([160.0, 120.0]), np.eye(2) * 1e4)
    shapes = shapes_of(scene(huge), CHART)
    boxes = Occupancy((600, 800, 3), shapes, 1.25)
    assert boxes.place(shapes[0], 30, 15, must=False) is None
    at = boxes.place(shapes[0], 30, 15, must=True)
    assert at is not None and 0 <= at[0] <= 770 and 15 <= at[1] <= 600


def test_a_click_hits_the_nearest_feature_or_nothing():
    marks = (
        Mark(1, "accepted", np.array([100.0, 100.0]), S, z=np.array([104.0, 101.0])),
        Mark(2, "nomatch", np.array([108.0, 100.0]), S),
        Mark(3, "unselected", np.array([200.0, 200.0]), S * 9),
    )
    shapes = shapes_of(scene(*marks), CHART)
    assert hit(shapes, CHART.place(np.array([99.0, 100.0])), 17) == 1
    assert hit(shapes, CHART.place(np.array([109.0, 100.0])), 17) == 2
    assert hit(shapes, CHART.place(np.array([220.0, 215.0])), 17) is None
    assert hit(shapes, CHART.place(np.array([160.0, 40.0])), 17) is None


@pytest.mark.parametrize(
    ("chart", "z"),
    [
        (CHART, [[17.25, 201.5]]),
        (PolarChart(((0.1, 8.0), (-np.pi, np.pi)), 8.0), [[3.0, 2.5]]),
        (PolarChart(((0.1, 8.0), (-1.0, 1.0)), 8.0), [[5.0, -0.9]]),
        (BarChart((-4.0, 4.0), "m"), [[-2.25]]),
    ],
)
def test_a_place_on_the_canvas_leads_back_to_the_measurement(chart, z):
    xy = chart.place(np.array(z), np.arange(1))[0]
    np.testing.assert_allclose(chart.measurement(xy), z[0], atol=1e-9)
    assert chart.measurement(np.array([-500.0, -500.0])) is None


def test_in_the_chart_forward_is_up_and_a_positive_bearing_turns_left():
    chart = PolarChart(((0.1, 8.0), (-np.pi, np.pi)), 8.0)
    ahead, left = chart.place(np.array([[2.0, 0.0], [2.0, np.pi / 2]]))
    assert ahead[1] < chart.origin[1] and ahead[0] == pytest.approx(chart.origin[0])
    assert left[0] < chart.origin[0] and left[1] == pytest.approx(chart.origin[1])


def test_the_region_in_the_chart_bends_about_the_robot():
    """Points of the contour at the same range lie on a circle, not on a chord."""
    chart = PolarChart(((0.1, 8.0), (-np.pi, np.pi)), 8.0)
    P = np.diag([1e-6, 0.2**2])
    contour = chart.outlines(np.array([[4.0, 0.5]]), P[None], 3.0, np.zeros(1))[0]
    radii = np.hypot(*(contour - chart.origin).T) / chart.scale
    np.testing.assert_allclose(radii, 4.0, atol=0.02)
    assert np.linalg.norm(np.ptp(contour, 0)) > 100


def test_raw_points_are_drawn_where_they_were_measured():
    z = np.array([[60.0, 50.0], [250.0, 199.0]])
    picture, _ = paint(scene(raw=Points(z)), CHART, truth=False)
    assert all(near(picture, CHART.place(q), "ink", 1) for q in z)


@pytest.mark.parametrize(
    ("distance", "reach"), [(0.9, 1), (1.1, 2), (4.0, 5), (5.1, 10), (70, 100)]
)
def test_reaches_are_round_numbers(distance, reach):
    assert nice_reach(distance) == reach


def test_odd_sized_and_tiny_images_are_drawn():
    for height, width in ((33, 47), (1080, 1920)):
        chart = ImageChart(width, height)
        raw = Image(np.zeros((height, width), np.uint8))
        picture, _ = paint(
            scene(Mark(1, "accepted", np.array([5.0, 5.0]), S), raw=raw), chart, True
        )
        assert picture.shape == (chart.size[1], chart.size[0], 3)
