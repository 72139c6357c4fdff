"""Image patches: what recognises a landmark in an image, and where it is found again.

Positions are pixels (u right, v down), the centre of the top left pixel is (0, 0). A patch is
searched by normalised cross-correlation over the ellipse in which the filter expects it (Davison,
*Real-time simultaneous localisation and mapping with a single camera*, 2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.policies import Vision
from scene_core.filter.ports import Detection, Match, Query, SourceError
from scene_core.sources.correlation import (
    Region,
    best_inside,
    between_pixels,
    box,
    count,
    peaks_in,
    regions,
)
from scene_core.sources.grey import read_grey

MIN_CONTRAST = 4.0
"""Grey levels: a template or an image region with a smaller standard deviation says nothing."""
MIN_SIDE = 7
"""A template is never cut smaller than this, pixels."""
DET_RANGE = (0.2, 5.0)
"""A patch is not searched when its area should have changed by more than these factors."""


@dataclass(frozen=True)
class Patch:
    """What recognises a landmark in an image: the template and its surroundings when first seen."""

    template: np.ndarray
    """uint8 (n, n), n odd, read-only."""
    surround: np.ndarray
    """uint8 (m, m), m >= n odd, the same middle: what a warped template is cut from."""
    offset: tuple[float, float] = (0.0, 0.0)
    """The landmark relative to the middle pixel, in the first view."""
    place: Vec | None = None
    """The true place (3,) of the landmark, m, where a simulation took it: for counting wrong
    matches, never for finding them."""

    def offset_in(self, warp: Mat) -> tuple[float, float]:
        """Where the landmark lies from the middle in another view, warp @ offset."""
        du, dv = self.offset
        if du == 0.0 and dv == 0.0:
            return self.offset
        (a, b), (c, d) = warp.tolist()
        return a * du + b * dv, c * du + d * dv

    @cached_property
    def contrast(self) -> float:
        """Standard deviation of the template, grey levels."""
        return float(self.template.std())


def patch_from(pixels: np.ndarray) -> Patch:
    """A patch that is all there is, e.g. read from a file: uint8 (n, n), n odd.

    It was cut out at whole pixels around something that lies between them: the landmark is the
    corner nearest to the middle (cv2.cornerSubPix), or the middle when none is within 2 pixels.
    """
    own = np.ascontiguousarray(pixels)
    own = own.copy() if own.flags.writeable else own
    own.flags.writeable = False
    middle = len(own) // 2
    if len(own) < 9 or own.std() < MIN_CONTRAST:
        return Patch(own, own)
    start = np.full((1, 1, 2), middle, dtype=np.float32)
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-4)
    du, dv = (cv2.cornerSubPix(own, start, (2, 2), (-1, -1), until).ravel() - middle).tolist()
    return Patch(own, own, (du, dv) if math.hypot(du, dv) < 2.0 else (0.0, 0.0))


def extract(image: np.ndarray, z: Vec, vision: Vision) -> Detection | None:
    """The landmark at the pixel nearest to z (2,); None when its patch would leave the image or has
    no contrast.

    The detection's z is the whole pixel on which the template is centred, exactly.
    """
    r = vision.patch_px // 2
    height, width = image.shape
    if not np.all(np.isfinite(z)):
        return None
    u, v = round(float(z[0])), round(float(z[1]))
    if not (r <= u < width - r and r <= v < height - r):
        return None
    template = image[v - r : v + r + 1, u - r : u + r + 1].copy()
    R = min(2 * r, u, v, width - 1 - u, height - 1 - v)
    surround = image[v - R : v + R + 1, u - R : u + R + 1].copy()
    if float(template.std()) < MIN_CONTRAST:
        return None
    template.flags.writeable = False
    surround.flags.writeable = False
    return Detection(np.array([float(u), float(v)]), Patch(template, surround))


def search_patches(image: np.ndarray, query: Query, vision: Vision) -> list[Match]:
    """One match per queried label: the highest peak of the correlation inside its ellipse.

    The template, warped by query.warp (2x2, from the first view to this one), is compared at all
    z with (z - h)' S^-1 (z - h) < gate and |z - h| <= max_radius_px in each direction; the peak
    must be a local maximum of at least vision.ncc_min and is interpolated between pixels.
    """
    out = []
    for i, region in enumerate(regions(query, float(vision.max_radius_px))):
        patch = query.appearance[i]
        if not isinstance(patch, Patch):
            found = _Found(why="it carries no image patch: it was mapped by another kind of sensor")
        elif region is None:
            found = _Found(why="its predicted place in the image is not a number")
        else:
            shift = patch.offset_in(query.warp[i]) if vision.warp else patch.offset
            found = _search(image, patch, query.warp[i], region.moved(shift), vision)
            if found.z is not None:
                found.z += shift
        out.append(
            Match(
                query.mount,
                query.labels[i],
                found.z,
                score=found.score,
                threshold=vision.ncc_min,
                runner_up=found.runner_up,
                positions=found.positions,
                why=found.why,
            )
        )
    return out


@dataclass
class _Found:
    z: Vec | None = None
    score: float = 0.0
    runner_up: float | None = None
    positions: int = 0
    why: str = ""


def _search(image: np.ndarray, patch: Patch, warp: Mat, region: Region, vision: Vision) -> _Found:
    template = warped_template(patch, warp) if vision.warp else patch.template
    if template is None:
        return _Found(why="the view changed too much since it was first seen")
    if patch.contrast < MIN_CONTRAST:
        return _Found(why=f"its patch has no contrast ({patch.contrast:.1f} grey levels)")
    r = template.shape[0] // 2
    u0, v0, u1, v1 = box(region, r, image.shape)
    if u1 - u0 < 2 or v1 - v0 < 2:
        return _Found(why="its search region lies outside the image")
    window = image[v0 - r : v1 + r + 1, u0 - r : u1 + r + 1]
    ncc = cv2.matchTemplate(window, template, cv2.TM_CCOEFF_NORMED)
    positions = count(region, u0 + 1, v0 + 1, u1 - 1, v1 - 1)
    peaks = peaks_in(ncc, u0, v0, region)
    for score, u, v in peaks:
        at = (float(u), float(v))
        if vision.subpixel:
            du, dv = between_pixels(image[v - r : v + r + 1, u - r : u + r + 1], template)
            at = (u + du, v + dv)
        if not region.holds(*at):
            continue
        apart = (s for s, x, y in peaks if abs(x - u) > 2 or abs(y - v) > 2)
        found = _Found(np.array(at, dtype=np.float64), score, max(apart, default=None), positions)
        if score < vision.ncc_min:
            found.z = None
            found.why = f"its best correlation {score:.2f} is below {vision.ncc_min:.2f}"
        elif _contrast(image[v - r : v + r + 1, u - r : u + r + 1]) < MIN_CONTRAST:
            found.z = None
            found.why = "the image has no contrast where it should be"
        return found
    best = best_inside(ncc, u0, v0, region)
    return _Found(score=best, positions=positions, why="no peak inside the search region")


def _contrast(pixels: np.ndarray) -> float:
    return float(cv2.meanStdDev(pixels)[1][0, 0])


def warped_template(patch: Patch, warp: Mat) -> np.ndarray | None:
    """The template as it should look after the affine change of view `warp` (2, 2); None when the
    change is too large (determinant outside DET_RANGE) or not a number.

    A pixel d from the middle of the new template shows what was at warp^-1 d in the first view;
    the template shrinks where the surroundings that were stored do not reach.
    """
    a, b, c, d = (float(x) for x in np.ravel(warp))
    det = a * d - b * c
    if not math.isfinite(det) or not DET_RANGE[0] <= det <= DET_RANGE[1]:
        return None
    n = patch.template.shape[0]
    back = ((d / det, -b / det), (-c / det, a / det))
    reach = max(abs(back[0][0]) + abs(back[0][1]), abs(back[1][0]) + abs(back[1][1]))
    largest = max(math.sqrt(x * x + y * y) for x, y in back)
    if largest > 4.0:
        return None
    r = n // 2
    if r * max(abs(a - 1), abs(b), abs(c), abs(d - 1)) < 0.1:
        return patch.template
    R = patch.surround.shape[0] // 2
    side = 2 * min(r, max(int(R / reach), MIN_SIDE // 2)) + 1
    source = patch.surround
    if largest > 1.3:
        source = cv2.GaussianBlur(source, (0, 0), 0.5 * math.sqrt(largest * largest - 1.0))
    m = side // 2
    M = np.array(
        [
            [back[0][0], back[0][1], R - (back[0][0] + back[0][1]) * m],
            [back[1][0], back[1][1], R - (back[1][0] + back[1][1]) * m],
        ]
    )
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(source, M, (side, side), flags=flags, borderMode=cv2.BORDER_REPLICATE)


def load_patch(path: str | Path) -> Patch:
    """A patch from an image file: grey, square, odd side of 5 to 63 pixels.

    Raises SourceError naming the file, what was found and what is expected.
    """
    pixels = read_grey(path)
    height, width = pixels.shape
    if height != width or height % 2 == 0 or not 5 <= height <= 63:
        raise SourceError(
            f"the patch {path} is {width} x {height} pixels: a patch is square with an odd side "
            "of 5 to 63 pixels"
        )
    return patch_from(pixels)
