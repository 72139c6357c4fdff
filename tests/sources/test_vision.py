"""Patches are found where they went, to a fraction of a pixel, and a failure says why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from scene_core.filter.policies import Vision
from scene_core.filter.ports import Match, Query
from scene_core.sources.vision import (
    Patch,
    extract,
    patch_from,
    search_patches,
    warped_template,
)
from tests.sources.pictures import Picture

VISION = Vision()


def query(
    h: np.ndarray,
    patches: Sequence[object],
    S: float | np.ndarray = 2.0,
    warp: np.ndarray | None = None,
) -> Query:
    n = len(patches)
    one = S if isinstance(S, np.ndarray) else S * np.eye(2)
    cov = np.broadcast_to(one, (n, 2, 2))
    warps = np.broadcast_to(np.eye(2) if warp is None else warp, (n, 2, 2))
    return Query("camera", tuple(range(n)), np.asarray(h, float), cov, 9.0, tuple(patches), warps)


def patches_at(image: np.ndarray, places: np.ndarray, vision: Vision = VISION) -> list[Patch]:
    found = [extract(image, z, vision) for z in places]
    return [d.appearance for d in found if d is not None]


def grid(margin: int = 40, n: int = 12) -> np.ndarray:
    u, v = np.meshgrid(np.linspace(margin, 319 - margin, 6).round(), [60.0, 120.0, 180.0])
    return np.column_stack([u.ravel(), v.ravel()])[:n]


def errors(matches: list[Match], truth: np.ndarray) -> np.ndarray:
    assert all(m.z is not None for m in matches), [m.why for m in matches]
    return np.array([m.z for m in matches]) - truth


def test_a_shift_is_measured_to_a_tenth_of_a_pixel() -> None:
    all_errors = []
    for seed in range(4):
        picture = Picture(seed)
        places, shift = grid(), np.random.default_rng(seed).uniform(-2, 2, 2)
        patches = patches_at(picture.seen(np.zeros(2)), places)
        matches = search_patches(picture.seen(shift), query(places, patches), VISION)
        all_errors.append(errors(matches, places + shift))
    rms = np.sqrt(np.mean(np.concatenate(all_errors) ** 2, axis=0))
    assert np.all(rms < 0.1), rms


def test_without_interpolation_the_position_is_a_whole_pixel() -> None:
    picture = Picture(0)
    places = grid()
    patches = patches_at(picture.seen(np.zeros(2)), places)
    image = picture.seen(np.array([0.4, -0.3]))
    whole = search_patches(image, query(places, patches), replace(VISION, subpixel=False))
    assert all(m.z is not None and np.array_equal(m.z, np.rint(m.z)) for m in whole)


@pytest.mark.parametrize(("angle", "scale"), [(0.5, 1.0), (0.0, 0.7), (0.0, 1.4), (-0.4, 1.25)])
def test_a_turned_and_scaled_patch_is_found_where_it_went(angle: float, scale: float) -> None:
    c, s = scale * np.cos(angle), scale * np.sin(angle)
    A = np.array([[c, -s], [s, c]])
    middle, places = np.array([159.5, 119.5]), grid(margin=90)
    picture = Picture(3, detail=2.0)
    patches = patches_at(picture.seen(np.zeros(2)), places)
    image = picture.seen(np.zeros(2), A)
    truth = (places - middle) @ A.T + middle
    inside = np.all((truth > 20) & (truth < [299, 219]), axis=1)
    chosen = [p for p, ok in zip(patches, inside, strict=True) if ok]
    matches = search_patches(image, query(truth[inside], chosen, warp=A), VISION)
    rms = np.sqrt(np.mean(errors(matches, truth[inside]) ** 2))
    assert rms < 0.2
    unwarped = search_patches(
        image, query(truth[inside], chosen, warp=A), replace(VISION, warp=False)
    )
    assert np.mean([m.score for m in matches]) > np.mean([m.score for m in unwarped])


def test_the_peak_lies_inside_the_ellipse_whatever_is_outside() -> None:
    picture = Picture(1)
    image = picture.seen(np.zeros(2), noise=0.0)
    z = np.array([160.0, 120.0])
    patches = patches_at(image, z[None])
    S = np.array([[9.0, 7.0], [7.0, 9.0]])
    # The true place lies in the box of the ellipse, but off its long axis.
    (match,) = search_patches(image, query(z[None] + np.array([5.0, -5.0]), patches, S), VISION)
    assert match.z is None or (match.z - z) @ (match.z - z) > 4.0
    (match,) = search_patches(image, query(z[None] + np.array([5.0, 5.0]), patches, S), VISION)
    assert match.z is not None and np.allclose(match.z, z, atol=0.05)


def test_the_positions_are_those_of_the_ellipse() -> None:
    picture = Picture(1)
    image = picture.seen(np.zeros(2))
    h, S = np.array([[160.3, 119.6]]), np.array([[5.0, 2.0], [2.0, 3.0]])
    (match,) = search_patches(image, query(h, patches_at(image, h), S), VISION)
    v, u = np.mgrid[:240, :320]
    nu = np.stack([u - h[0, 0], v - h[0, 1]], axis=-1)
    assert match.positions == np.sum(np.einsum("ijk,kl,ijl->ij", nu, np.linalg.inv(S), nu) < 9.0)


def test_repeated_texture_shows_in_the_runner_up() -> None:
    x, y = np.meshgrid(np.arange(320), np.arange(240))
    image = (128 + 60 * np.sin(x * 2 * np.pi / 8) * np.sin(y * 2 * np.pi / 9)).astype(np.uint8)
    z = np.array([[160.0, 120.0]])
    (match,) = search_patches(image, query(z, patches_at(image, z), S=16.0), VISION)
    assert match.runner_up is not None and match.runner_up > 0.98


def test_a_patch_near_the_border_is_searched_where_it_fits() -> None:
    image = Picture(2).seen(np.zeros(2), noise=0.0)
    z = np.array([[8.0, 231.0]])
    (match,) = search_patches(image, query(z + np.array([1.0, 1.5]), patches_at(image, z)), VISION)
    assert match.z is not None and np.allclose(match.z, z[0], atol=0.05)
    (match,) = search_patches(image, query(z - 40.0 * np.array([1, -1]), [match_patch()]), VISION)
    assert match.z is None and "outside the image" in match.why


def match_patch() -> Patch:
    return patches_at(Picture(2).seen(np.zeros(2)), np.array([[100.0, 100.0]]))[0]


def flat_patch() -> Patch:
    return patch_from(np.full((13, 13), 90, np.uint8))


@pytest.mark.parametrize(
    ("patch", "change", "why"),
    [
        (match_patch(), {"warp": 3.0 * np.eye(2)}, "changed too much"),
        (match_patch(), {"warp": np.full((2, 2), np.nan)}, "changed too much"),
        (match_patch(), {"warp": np.zeros((2, 2))}, "changed too much"),
        (flat_patch(), {}, "no contrast"),
        (7, {}, "no image patch"),
        (match_patch(), {"h": np.array([[np.nan, 100.0]])}, "not a number"),
        (match_patch(), {"S": -1.0}, "not a number"),
        (match_patch(), {"h": np.array([[250.0, 30.0]])}, ""),
    ],
)
def test_every_failure_says_why(patch: object, change: dict, why: str) -> None:
    image = Picture(2).seen(np.zeros(2))
    arguments = {"h": np.array([[100.0, 100.0]]), **change}
    (match,) = search_patches(image, query(patches=[patch], **arguments), VISION)
    assert match.z is None
    assert match.why and why in match.why
    assert np.isfinite(match.score)


def test_an_image_without_contrast_matches_nothing() -> None:
    image = np.full((240, 320), 128, np.uint8)
    (match,) = search_patches(image, query(np.array([[100.0, 100.0]]), [match_patch()]), VISION)
    assert match.z is None and match.why


def test_no_query_no_match() -> None:
    empty = query(np.zeros((0, 2)), [])
    assert search_patches(np.zeros((240, 320), np.uint8), empty, VISION) == []


def test_the_warped_template_is_what_the_camera_would_have_seen() -> None:
    picture = Picture(5, detail=2.5)
    A = np.array([[1.1, 0.3], [-0.2, 0.9]])
    (patch,) = patches_at(picture.seen(np.zeros(2), noise=0.0), np.array([[160.0, 120.0]]))
    template = warped_template(patch, A)
    assert template is not None and template.shape == (13, 13)
    place = A @ (np.array([160.0, 120.0]) - [159.5, 119.5]) + [159.5, 119.5]
    seen = cv2.getRectSubPix(picture.seen(np.zeros(2), A, noise=0.0), (13, 13), tuple(place))
    assert np.abs(template.astype(float) - seen).mean() < 2.5


def test_a_patch_without_surroundings_shrinks_rather_than_invents() -> None:
    lonely = patch_from(match_patch().template)
    small = warped_template(lonely, 0.7 * np.eye(2))
    assert small is not None and 7 <= small.shape[0] < 13 and small.shape[0] % 2 == 1


def test_the_corner_in_a_patch_file_is_the_landmark() -> None:
    corner = np.array([0.7, -0.4])
    v, u = np.mgrid[-60:61, -60:61] / 11.0
    fine = np.where((u > corner[0]) & (v > corner[1]), 30.0, 200.0).astype(np.float32)
    pixels = cv2.resize(fine, (11, 11), interpolation=cv2.INTER_AREA).astype(np.uint8)
    patch = patch_from(pixels)
    assert np.allclose(patch.offset, corner, atol=0.15)
    image = np.full((240, 320), 200, np.uint8)
    image[95:106, 95:106] = pixels
    image[106:130, 100:130] = image[100:130, 106:130] = 30
    (match,) = search_patches(image, query(np.array([[101.0, 99.0]]), [patch]), VISION)
    assert match.z is not None and np.allclose(match.z, np.array([100, 100]) + corner, atol=0.3)


def test_a_click_takes_a_patch_or_nothing() -> None:
    image = Picture(0).seen(np.zeros(2))
    detection = extract(image, np.array([50.4, 60.6]), VISION)
    assert detection is not None and np.array_equal(detection.z, [50.0, 61.0])
    assert np.array_equal(detection.appearance.template, image[55:68, 44:57])
    for outside in ([3.0, 100.0], [1e9, 0.0], [np.nan, 5.0]):
        assert extract(image, np.array(outside), VISION) is None
    assert extract(np.full((240, 320), 7, np.uint8), np.array([50.0, 60.0]), VISION) is None
