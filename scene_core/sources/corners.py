"""Where a new image patch is worth taking: corners, spread over the image.

Source: Shi and Tomasi, *Good features to track*, 1994.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.policies import Vision
from scene_core.filter.ports import Detection
from scene_core.sources.vision import extract

CELL = (64, 48)
"""Cells in which corners are looked for, pixels."""


def corner_scores(image: np.ndarray, patch_px: int) -> np.ndarray:
    """Shi-Tomasi score (height, width): square root of the smaller eigenvalue of the mean gradient
    matrix over the patch, grey levels per pixel. A pixel nearer to the border than the patch's
    half side sees a mirrored image."""
    return np.sqrt(np.maximum(cv2.cornerMinEigenVal(image, patch_px, ksize=3), 0.0)) * _GREY_PER_PX


_GREY_PER_PX = 255.0 / 2.0
"""cv2 scales 8-bit images to 1 and its Sobel filter, as it uses it, gives twice the gradient."""


def detect_corners(
    image: np.ndarray,
    occupied: Vec,
    count: int,
    vision: Vision,
    key: Sequence[int] = (0, 0),
) -> list[Detection]:
    """Up to `count` corners worth tracking, spread over the image, in the order they were found.

    The image is divided into cells; again and again the cell whose middle is farthest from all of
    `occupied` (N, 2) and from what was found so far is searched for the pixel of the largest
    Shi-Tomasi score that keeps `border_px` and `separation_px`; below `corner_min` the cell is
    left empty. `key` (seed, frame) shifts the grid of cells and orders cells that are equally far:
    the same key gives the same corners.
    """
    if count <= 0:
        return []
    border = max(vision.border_px, vision.patch_px // 2)
    cells = _cells(image.shape, border, np.random.Generator(np.random.Philox(key=_key(key))))
    taken = np.asarray(occupied, dtype=np.float64).reshape(-1, 2)
    taken = taken[np.isfinite(taken).all(axis=1)]
    middles = np.array([[(u0 + u1) / 2, (v0 + v1) / 2] for u0, v0, u1, v1 in cells]).reshape(-1, 2)
    free = _distances(middles, taken, float(np.hypot(*image.shape)))
    found: list[Detection] = []
    for _ in range(len(cells)):
        k = int(np.argmax(free))
        free[k] = -1.0
        corner = _best_corner(image, cells[k], taken, vision)
        detection = None if corner is None else extract(image, corner, vision)
        if detection is None:
            continue
        found.append(detection)
        if len(found) == count:
            break
        taken = np.vstack([taken, detection.z])
        open_ = free >= 0.0
        free[open_] = np.minimum(free[open_], np.hypot(*(middles[open_] - detection.z).T))
    return found


def _key(key: Sequence[int]) -> np.ndarray:
    return np.array([int(k) % 2**64 for k in key], dtype=np.uint64)


def _cells(
    shape: tuple[int, ...], border: int, rng: np.random.Generator
) -> list[tuple[int, int, int, int]]:
    """Boxes (u0, v0, u1, v1; the last exclusive) of whole or cut cells, in random order."""
    edges = []
    for size, cell in ((shape[1], CELL[0]), (shape[0], CELL[1])):
        first, last = border, size - border
        cuts = np.arange(first - int(rng.integers(cell)), last + cell, cell)
        cuts = np.unique(np.clip(cuts, first, max(first, last)))
        edges.append([(int(a), int(b)) for a, b in pairwise(cuts) if b - a > 3])
    boxes = [(u0, v0, u1, v1) for v0, v1 in edges[1] for u0, u1 in edges[0]]
    return [boxes[int(k)] for k in rng.permutation(len(boxes))]


def _distances(middles: Vec, taken: Vec, far: float) -> Vec:
    """Distance (K,) of each cell's middle from the nearest of `taken`."""
    if len(taken) == 0 or len(middles) == 0:
        return np.full(len(middles), far)
    return np.sqrt(((middles[:, None] - taken) ** 2).sum(-1).min(axis=1))


def _best_corner(
    image: np.ndarray, cell: tuple[int, int, int, int], taken: Vec, vision: Vision
) -> Vec | None:
    """The best corner of a cell that keeps its distance from `taken`, or None."""
    u0, v0, u1, v1 = cell
    m = vision.patch_px // 2 + 1
    top, left = max(v0 - m, 0), max(u0 - m, 0)
    scores = corner_scores(image[top : v1 + m, left : u1 + m], vision.patch_px)
    scores = scores[v0 - top : v0 - top + v1 - v0, u0 - left : u0 - left + u1 - u0]
    scores = np.ascontiguousarray(scores)
    near = np.abs(taken - ((u0 + u1) / 2, (v0 + v1) / 2))
    reach = ((u1 - u0) / 2 + vision.separation_px, (v1 - v0) / 2 + vision.separation_px)
    for u, v in taken[(near <= reach).all(axis=1)]:
        cv2.circle(scores, (round(u - u0), round(v - v0)), vision.separation_px, 0.0, -1)
    _, best, _, (j, i) = cv2.minMaxLoc(scores)
    if best < vision.corner_min or best <= 0.0:
        return None
    return np.array([u0 + j, v0 + i], dtype=np.float64)
