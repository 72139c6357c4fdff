"""Lines, rings, crosses and words on a canvas.

Contours are filled polygons: OpenCV's anti-aliased thick polylines cost four times as much.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from scene_core.arrays import Vec
from web_panels.style import RGB, C

SHIFT = 4
"""Sub-pixel bits of OpenCV's drawing functions."""
DASHES = 10
"""Of a dashed contour."""
FONT = cv2.FONT_HERSHEY_SIMPLEX
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
Place = Vec | tuple[float, float]
"""x and y on the canvas, px."""


class Painter:
    """Draws on one canvas; `u` is the unit of all widths, 1 px of a 640 px wide canvas."""

    def __init__(self, canvas: np.ndarray) -> None:
        self.canvas = canvas
        self.u = canvas.shape[1] / 640.0

    def fill(self, parts: Sequence[Vec], colour: RGB) -> None:
        """The area inside an odd number of the parts."""
        points = [(q * (1 << SHIFT) + 0.5).astype(np.int32) for q in parts]
        cv2.fillPoly(self.canvas, points, colour, cv2.LINE_AA, SHIFT)

    def rings(self, contours: Vec, colour: RGB, width: float) -> None:
        """Closed contours (N, K, 2)."""
        for outer, inner in zip(*_sides(contours, width * self.u), strict=True):
            self.fill([outer, inner], colour)

    def dashed(self, contours: Vec, colour: RGB, width: float) -> None:
        """Closed contours (N, K, 2), dashed."""
        step = max(3, contours.shape[1] // DASHES)
        keep = max(2, round(step * 0.67)) + 1
        for outer, inner in zip(*_sides(contours, width * self.u), strict=True):
            loop, back = np.concatenate([outer, outer]), np.concatenate([inner, inner])
            dashes = [
                np.concatenate([loop[i : i + keep], back[i : i + keep][::-1]])
                for i in range(0, len(outer) - step + 1, step)
            ]
            self.fill(dashes, colour)

    def line(self, a: Place, b: Place, colour: RGB, width: float) -> None:
        """A straight line; short ones are cheap as they are."""
        start, end = ((round(x * (1 << SHIFT)), round(y * (1 << SHIFT))) for x, y in (a, b))
        thick = max(1, round(width * self.u))
        cv2.line(self.canvas, start, end, colour, thick, cv2.LINE_AA, SHIFT)

    def curve(self, points: Vec, colour: RGB, width: float) -> None:
        """A smooth open line through points (K, 2)."""
        if len(points) < 2:
            return
        along = np.gradient(points, axis=0)
        length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)
        normal = np.stack([along[:, 1], -along[:, 0]], axis=-1)
        normal *= (0.5 * width * self.u / length)[:, None]
        self.fill([np.concatenate([points + normal, (points - normal)[::-1]])], colour)

    def cross(self, at: Vec, colour: RGB, size: float, width: float) -> None:
        """An upright cross."""
        (x, y), a = at.tolist(), size * self.u
        self.line((x - a, y), (x + a, y), colour, width)
        self.line((x, y - a), (x, y + a), colour, width)

    def gapped_cross(self, at: Vec, colour: RGB) -> None:
        """A cross turned by 45 degrees, open in the middle so that it hides nothing."""
        (x, y), near, far = at.tolist(), 3.0 * self.u, 6.5 * self.u
        for sx, sy in CORNERS.tolist():
            self.line((x + sx * near, y + sy * near), (x + sx * far, y + sy * far), colour, 1.5)

    def square(self, at: Vec, colour: RGB, size: float, width: float) -> None:
        """The outline of a square with half side `size` px."""
        (x, y), thick = at.tolist(), max(1, round(width * self.u))
        lo, hi = (
            (round((x + d) * (1 << SHIFT)), round((y + d) * (1 << SHIFT))) for d in (-size, size)
        )
        cv2.rectangle(self.canvas, lo, hi, colour, thick, cv2.LINE_AA, SHIFT)

    def text(self, words: str, at: tuple[int, int], colour: RGB, scale: float) -> None:
        """Words with a dark edge, baseline at `at`."""
        size, thick = scale * self.u, max(1, round(1.5 * self.u))
        edge = thick + max(2, round(2.2 * self.u))
        cv2.putText(self.canvas, words, at, FONT, size, (10, 12, 16), edge, cv2.LINE_AA)
        cv2.putText(self.canvas, words, at, FONT, size, colour, thick, cv2.LINE_AA)

    def text_size(self, words: str, scale: float) -> tuple[int, int]:
        """Width and height on the canvas."""
        (w, h), _ = cv2.getTextSize(words, FONT, scale * self.u, max(1, round(1.5 * self.u)))
        return w, h


def dots(canvas: np.ndarray, at: Vec, radius: float, colour: RGB = C["ink"]) -> None:
    """Raw measurements or particles: filled discs at (k, 2)."""
    r = round(radius * (1 << SHIFT))
    for x, y in np.round(at * (1 << SHIFT)).astype(int).tolist():
        cv2.circle(canvas, (x, y), r, colour, -1, cv2.LINE_AA, SHIFT)


def _sides(contours: Vec, width: float) -> tuple[Vec, Vec]:
    """Outer and inner rim (N, K, 2) of lines of a width along closed contours."""
    along = np.roll(contours, -1, axis=1) - np.roll(contours, 1, axis=1)
    length = np.maximum(np.hypot(along[..., 0], along[..., 1]), 1e-9)
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1) * (0.5 * width / length)[..., None]
    return contours + normal, contours - normal


def circle(n: int) -> Vec:
    """n points (n, 2) of the unit circle."""
    a = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    return np.stack([np.cos(a), np.sin(a)], axis=-1)


def pale(channel: int) -> int:
    """A colour channel, lighter: thin letters need more light than lines."""
    return min(255, int(0.55 * channel + 115))
