"""Image patches: what recognises a landmark in an image, and where it is found again.

Positions are pixels (u right, v down), the centre of the top left pixel is (0, 0). A patch is
searched by normalised cross-correlation over the ellipse in which the filter expects it (Davison,
*Real-time simultaneous localisation and mapping with a single camera*, 2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.policies import Vision
from scene_core.filter.ports import Detection, Match, Query, SourceError
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
    for i, region in enumerate(_regions(query, float(vision.max_radius_px))):
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


@dataclass(frozen=True)
class _Region:
    """The ellipse a (u-h)^2 + 2 b (u-h)(v-h) + c (v-h)^2 < gate, and half the sides of its box."""

    u: float
    v: float
    half_u: float
    half_v: float
    a: float
    b: float
    c: float
    gate: float

    def moved(self, shift: tuple[float, float]) -> _Region:
        """The places of a template's middle when the landmark lies `shift` away from it."""
        if shift == (0.0, 0.0):
            return self
        return replace(self, u=self.u - shift[0], v=self.v - shift[1])

    def holds(self, u: float, v: float) -> bool:
        x, y = u - self.u, v - self.v
        return self.a * x * x + 2.0 * self.b * x * y + self.c * y * y < self.gate


def _regions(query: Query, limit: float) -> list[_Region | None]:
    """The search regions; None where the prediction is not a number or S not positive."""
    if not query.labels:
        return []
    S = query.S
    det = S[:, 0, 0] * S[:, 1, 1] - S[:, 0, 1] * S[:, 1, 0]
    good = np.isfinite(query.h).all(-1) & np.isfinite(det) & (det > 0.0) & (S[:, 0, 0] > 0.0)
    det = np.where(good, det, 1.0)
    half = np.minimum(np.sqrt(query.gate * np.abs(S[:, [0, 1], [0, 1]])), limit)
    inverse = np.stack([S[:, 1, 1], -S[:, 0, 1], S[:, 0, 0]], axis=1) / det[:, None]
    return [
        _Region(u, v, half_u, half_v, a, b, c, query.gate) if ok else None
        for (u, v), (half_u, half_v), (a, b, c), ok in zip(
            query.h.tolist(), half.tolist(), inverse.tolist(), good.tolist(), strict=True
        )
    ]


def _search(image: np.ndarray, patch: Patch, warp: Mat, region: _Region, vision: Vision) -> _Found:
    template = warped_template(patch, warp) if vision.warp else patch.template
    if template is None:
        return _Found(why="the view changed too much since it was first seen")
    if patch.contrast < MIN_CONTRAST:
        return _Found(why=f"its patch has no contrast ({patch.contrast:.1f} grey levels)")
    r = template.shape[0] // 2
    u0, v0, u1, v1 = _box(region, r, image.shape)
    if u1 - u0 < 2 or v1 - v0 < 2:
        return _Found(why="its search region lies outside the image")
    window = image[v0 - r : v1 + r + 1, u0 - r : u1 + r + 1]
    ncc = cv2.matchTemplate(window, template, cv2.TM_CCOEFF_NORMED)
    positions = _count(region, u0 + 1, v0 + 1, u1 - 1, v1 - 1)
    peaks = _peaks(ncc, u0, v0, region)
    for score, u, v in peaks:
        at = (float(u), float(v))
        if vision.subpixel:
            du, dv = _between_pixels(image[v - r : v + r + 1, u - r : u + r + 1], template)
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
    best = _best_inside(ncc, u0, v0, region)
    return _Found(score=best, positions=positions, why="no peak of the correlation inside")


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


def _box(region: _Region, r: int, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Positions (first and last, inclusive) of the ellipse's bounding box where the template fits,
    one more on each side so that a peak on the rim is seen to be one and can be interpolated."""
    return (
        max(math.floor(region.u - region.half_u) - 1, r),
        max(math.floor(region.v - region.half_v) - 1, r),
        min(math.ceil(region.u + region.half_u) + 1, shape[1] - 1 - r),
        min(math.ceil(region.v + region.half_v) + 1, shape[0] - 1 - r),
    )


def _peaks(ncc: np.ndarray, u0: int, v0: int, region: _Region) -> list[tuple[float, int, int]]:
    """Local maxima (value, u, v) of the correlation at whole pixels, highest first, that may lie in
    the ellipse once they are interpolated."""
    top = cv2.dilate(ncc, _RING)
    places = cv2.findNonZero(cv2.compare(ncc, top, cv2.CMP_GE))
    if places is None:
        return []
    height, width = ncc.shape
    out = []
    for j, i in places.reshape(-1, 2).tolist():
        if 0 < i < height - 1 and 0 < j < width - 1:
            u, v = j + u0, i + v0
            x, y = region.u - u, region.v - v
            if region.holds(u + max(-0.5, min(0.5, x)), v + max(-0.5, min(0.5, y))):
                out.append((float(ncc[int(i), int(j)]), int(u), int(v)))
    out.sort(key=lambda peak: -peak[0])
    return out


_RING = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=np.uint8)


def _best_inside(ncc: np.ndarray, u0: int, v0: int, region: _Region) -> float:
    """Highest correlation in the ellipse, peak or not."""
    x = np.arange(ncc.shape[1]) + (u0 - region.u)
    y = (np.arange(ncc.shape[0]) + (v0 - region.v))[:, None]
    inside = region.a * x * x + 2.0 * region.b * x * y + region.c * y * y < region.gate
    return float(ncc[inside].max()) if inside.any() else 0.0


def _count(region: _Region, u0: int, v0: int, u1: int, v1: int) -> int:
    """Whole-pixel positions of the box that lie in the ellipse, row by row."""
    a, b, total = region.a, region.b, 0
    outer, inner = a * region.gate, b * b - a * region.c
    for v in range(v0, v1 + 1):
        y = v - region.v
        root = inner * y * y + outer
        if root > 0.0:
            root = math.sqrt(root)
            left = math.ceil(region.u + (-b * y - root) / a)
            right = math.floor(region.u + (-b * y + root) / a)
            total += max(min(right, u1) - max(left, u0) + 1, 0)
    return total


def _between_pixels(window: np.ndarray, template: np.ndarray) -> tuple[float, float]:
    """How far (du, dv) the content of `window` has moved from `template`, both (n, n) and aligned
    to the nearest pixel: one Gauss-Newton step on the difference of the images at mean 0 and norm
    1, with the mean of their gradients, which makes it exact to second order; at most half a
    pixel and a little.

    Source: Benhimane, Malis, *Real-time image-based tracking of planes using efficient
    second-order minimization*, IROS 2004.
    """
    w, t = window.astype(np.float64), template.astype(np.float64)
    w -= w.mean()
    t -= t.mean()
    size = math.sqrt(np.vdot(w, w) * np.vdot(t, t))
    if size == 0.0:
        return 0.0, 0.0
    t *= np.vdot(w, t) / np.vdot(t, t)
    both, less = w + t, (t - w)[1:-1, 1:-1]
    x, y = both[1:-1, 2:] - both[1:-1, :-2], both[2:, 1:-1] - both[:-2, 1:-1]
    xx, xy, yy = float(np.vdot(x, x)), float(np.vdot(x, y)), float(np.vdot(y, y))
    ex, ey = float(np.vdot(x, less)), float(np.vdot(y, less))
    det = xx * yy - xy * xy
    if det <= 1e-9 * xx * yy:
        return 0.0, 0.0
    du, dv = 4.0 * (yy * ex - xy * ey) / det, 4.0 * (xx * ey - xy * ex) / det
    return max(-0.7, min(0.7, du)), max(-0.7, min(0.7, dv))


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
