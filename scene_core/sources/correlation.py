"""Where a template fits best: the correlation surface over a search ellipse, and its peak.

Places are pixels (u, v). A surface `ncc` (rows, columns) starts at the place (u0, v0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from scene_core.filter.ports import Query


@dataclass(frozen=True)
class Region:
    """The ellipse a (u-h)^2 + 2 b (u-h)(v-h) + c (v-h)^2 < gate, and half the sides of its box."""

    u: float
    v: float
    half_u: float
    half_v: float
    a: float
    b: float
    c: float
    gate: float

    def moved(self, shift: tuple[float, float]) -> Region:
        """The places of a template's middle when the landmark lies `shift` away from it."""
        if shift == (0.0, 0.0):
            return self
        return replace(self, u=self.u - shift[0], v=self.v - shift[1])

    def holds(self, u: float, v: float) -> bool:
        x, y = u - self.u, v - self.v
        return self.a * x * x + 2.0 * self.b * x * y + self.c * y * y < self.gate


def regions(query: Query, limit: float) -> list[Region | None]:
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
        Region(u, v, half_u, half_v, a, b, c, query.gate) if ok else None
        for (u, v), (half_u, half_v), (a, b, c), ok in zip(
            query.h.tolist(), half.tolist(), inverse.tolist(), good.tolist(), strict=True
        )
    ]


def box(region: Region, r: int, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Positions (first and last, inclusive) of the ellipse's bounding box where the template fits,
    one more on each side so that a peak on the rim is seen to be one and can be interpolated."""
    return (
        max(math.floor(region.u - region.half_u) - 1, r),
        max(math.floor(region.v - region.half_v) - 1, r),
        min(math.ceil(region.u + region.half_u) + 1, shape[1] - 1 - r),
        min(math.ceil(region.v + region.half_v) + 1, shape[0] - 1 - r),
    )


def peaks_in(ncc: np.ndarray, u0: int, v0: int, region: Region) -> list[tuple[float, int, int]]:
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


def best_inside(ncc: np.ndarray, u0: int, v0: int, region: Region) -> float:
    """Highest correlation in the ellipse, peak or not."""
    x = np.arange(ncc.shape[1]) + (u0 - region.u)
    y = (np.arange(ncc.shape[0]) + (v0 - region.v))[:, None]
    inside = region.a * x * x + 2.0 * region.b * x * y + region.c * y * y < region.gate
    return float(ncc[inside].max()) if inside.any() else 0.0


def count(region: Region, u0: int, v0: int, u1: int, v1: int) -> int:
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


def between_pixels(window: np.ndarray, template: np.ndarray) -> tuple[float, float]:
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
