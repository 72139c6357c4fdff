"""A surface to paint on, in metres.

Sizes are metres, x to the right and y down from the top left corner of a surface; colours are
RGB in grey levels 0 to 255.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

Colour = tuple[float, float, float]

INK: Colour = (34, 36, 42)
PAPER: Colour = (236, 233, 224)
WOOD: Colour = (122, 92, 66)
DARK_WOOD: Colour = (72, 54, 42)
WALL: Colour = (176, 172, 164)
ACCENTS: tuple[Colour, ...] = (
    (176, 78, 58),
    (212, 162, 74),
    (62, 104, 138),
    (70, 128, 104),
    (104, 74, 110),
    (222, 206, 176),
    (40, 58, 82),
)

_SHIFT = 4
"""Fractional bits of the polygon coordinates given to OpenCV."""


class Canvas:
    """A surface of width x height metres that is being painted."""

    def __init__(self, width: float, height: float, density: float, colour: Colour, seed: int):
        self.width, self.height, self.density = width, height, density
        self.rng = np.random.default_rng(seed)
        rows, columns = round(height * density), round(width * density)
        self.pixels = np.empty((rows, columns, 3), np.float32)
        self.pixels[:] = colour
        self.glow = np.zeros((rows, columns), np.float32)
        """Light a texel gives off itself, as a factor of its colour."""

    def shine(self, x: float, y: float, w: float, h: float, strength: float) -> None:
        """Let what is painted in a rectangle give off light."""
        x0, y0, x1, y1 = (round(v * self.density) for v in (x, y, x + w, y + h))
        self.glow[y0:y1, x0:x1] = strength

    def mottle(self, amount: float, scale: float) -> None:
        """Uneven paint: smooth noise of `amount` grey levels in patches of about `scale` metres."""
        rows, columns = self.pixels.shape[:2]
        for octave in range(3):
            size = scale / 2**octave
            coarse = self.rng.standard_normal(
                (max(2, round(self.height / size)) + 1, max(2, round(self.width / size)) + 1)
            ).astype(np.float32)
            wide = cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC)
            self.pixels += (amount * 0.6**octave * wide)[..., None]

    def polygon(self, corners: Sequence[tuple[float, float]], colour: Colour) -> None:
        """A filled polygon with smooth edges."""
        at = (np.array(corners) * self.density - 0.5) * 2**_SHIFT
        cv2.fillPoly(self.pixels, [np.rint(at).astype(np.int32)], colour, cv2.LINE_8, _SHIFT)

    def rectangle(self, x: float, y: float, w: float, h: float, colour: Colour) -> None:
        """A filled rectangle; edges fall on whole texels."""
        x0, y0, x1, y1 = (round(v * self.density) for v in (x, y, x + w, y + h))
        self.pixels[max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)] = colour

    def disc(self, x: float, y: float, radius: float, colour: Colour, line: float = 0.0) -> None:
        """A filled disc, or a ring of the given line width."""
        centre = tuple(int(v) for v in np.rint((np.array([x, y]) * self.density - 0.5) * 2**_SHIFT))
        size = round(radius * self.density * 2**_SHIFT)
        width = max(1, round(line * self.density)) if line else -1
        cv2.circle(self.pixels, centre, size, colour, width, cv2.LINE_8, _SHIFT)

    def line(self, points: Sequence[tuple[float, float]], width: float, colour: Colour) -> None:
        """A line through points."""
        at = (np.array(points) * self.density - 0.5) * 2**_SHIFT
        thick = max(1, round(width * self.density))
        cv2.polylines(
            self.pixels, [np.rint(at).astype(np.int32)], False, colour, thick, cv2.LINE_8, _SHIFT
        )

    def ellipse(
        self, x: float, y: float, a: float, b: float, degrees: float, width: float, colour: Colour
    ) -> None:
        """The outline of an ellipse with half axes a and b."""
        t = np.linspace(0.0, 2.0 * np.pi, 49)
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        ring = [
            (x + a * c * np.cos(v) - b * s * np.sin(v), y + a * s * np.cos(v) + b * c * np.sin(v))
            for v in t
        ]
        self.line(ring, width, colour)

    def text(self, words: str, x: float, y: float, height: float, colour: Colour) -> None:
        """Words whose capitals are `height` tall, standing on the base line y."""
        scale = height * self.density / 21.0
        at = (round(x * self.density), round(y * self.density))
        mask = np.zeros(self.pixels.shape[:2], np.uint8)
        thick = max(1, round(scale * 2.4))
        cv2.putText(mask, words, at, cv2.FONT_HERSHEY_SIMPLEX, scale, 255, thick, cv2.LINE_AA)
        cover = mask[..., None] / np.float32(255)
        self.pixels += cover * (np.array(colour, np.float32) - self.pixels)

    def pick(self) -> Colour:
        """One of the accent colours."""
        return ACCENTS[int(self.rng.integers(len(ACCENTS)))]
