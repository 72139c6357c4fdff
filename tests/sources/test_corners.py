"""Corners are what Shi and Tomasi say, spread over the image, and the same for the same key."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scene_core.filter.policies import Vision
from scene_core.sources.corners import corner_scores, detect_corners
from tests.sources.pictures import Picture

VISION = Vision()
NOTHING = np.zeros((0, 2))


def test_the_score_is_the_smaller_eigenvalue_of_the_mean_gradient_matrix() -> None:
    v, u = np.mgrid[:100, :100].astype(float)
    image = 128 + 40 * np.sin(u / 5) + 40 * np.sin(v / 5)
    gv, gu = np.gradient(image)
    for n in (9, 13, 15):
        window = (slice(46 - n // 2, 47 + n // 2),) * 2
        a, b, c = (np.mean((x * y)[window]) for x, y in ((gu, gu), (gu, gv), (gv, gv)))
        expected = np.sqrt(np.linalg.eigvalsh([[a, b], [b, c]])[0])
        assert np.isclose(
            corner_scores(image.round().astype(np.uint8), n)[46, 46], expected, rtol=0.02
        )


def test_an_edge_is_no_corner() -> None:
    image = np.full((240, 320), 40, np.uint8)
    image[:, 160:] = 220
    assert detect_corners(image, NOTHING, 10, VISION) == []


def test_corners_keep_their_distances() -> None:
    image = Picture(0).seen(np.zeros(2))
    occupied = np.array([[100.0, 100.0], [200.0, 60.0], [np.nan, 3.0]])
    found = np.array([d.z for d in detect_corners(image, occupied, 40, VISION)])
    assert len(found) > 15
    everything = np.vstack([found, occupied[:2]])
    gaps = np.hypot(*(everything[:, None] - everything).transpose(2, 0, 1)) + 1e9 * np.eye(
        len(everything)
    )
    assert gaps.min() > VISION.separation_px - 1.0
    assert found.min() >= VISION.border_px
    assert np.all(found < np.array([320, 240]) - VISION.border_px)
    assert all(
        corner_scores(image, VISION.patch_px)[int(v), int(u)] >= VISION.corner_min for u, v in found
    )


def test_empty_parts_of_the_image_come_first() -> None:
    image = Picture(0).seen(np.zeros(2))
    left = np.column_stack([np.linspace(20, 180, 30), np.tile([60.0, 120.0, 180.0], 10)])
    for seed in range(5):
        (first, *_) = detect_corners(image, left, 3, VISION, (seed, 0))
        assert first.z[0] > 220


def test_twelve_corners_reach_every_quarter() -> None:
    image = Picture(0).seen(np.zeros(2))
    z = np.array([d.z for d in detect_corners(image, NOTHING, 12, VISION)])
    quarters = {(u > 160, v > 120) for u, v in z}
    assert len(quarters) == 4


def test_the_key_decides_and_nothing_else() -> None:
    image = Picture(0).seen(np.zeros(2))
    places = [
        np.array([d.z for d in detect_corners(image, NOTHING, 8, VISION, key)]).tobytes()
        for key in ((0, 0), (0, 0), (1, 0), (0, 1))
    ]
    assert places[0] == places[1]
    assert len(set(places)) == 3


def test_nothing_is_found_where_nothing_is_asked_or_fits() -> None:
    image = Picture(0).seen(np.zeros(2))
    assert detect_corners(image, NOTHING, 0, VISION) == []
    assert detect_corners(image, NOTHING, 5, replace(VISION, border_px=150)) == []
    assert detect_corners(np.zeros((240, 320), np.uint8), NOTHING, 5, VISION) == []
