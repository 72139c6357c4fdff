"""Smooth random pictures that can be looked at from anywhere."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

FINE = 4
"""Subdivisions of a pixel in the world picture."""


@cache
def _world(seed: int, width: int, height: int, detail: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    shape = ((height + 40) * FINE, (width + 40) * FINE)
    noise = rng.standard_normal(shape, dtype=np.float32)
    small = cv2.resize(noise, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    coarse = cv2.GaussianBlur(small, (0, 0), detail * FINE)
    coarse = cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC)
    smooth = (cv2.GaussianBlur(noise, (0, 0), detail * FINE) + 4 * coarse) * detail
    return cv2.normalize(smooth, smooth, 20, 235, cv2.NORM_MINMAX)


class Picture:
    """A picture with detail of about two pixels; pixels average over their area."""

    def __init__(self, seed: int, width: int = 320, height: int = 240, detail: float = 1.5) -> None:
        self.size = (width, height)
        self.world = _world(seed, width, height, detail)
        self.rng = np.random.default_rng(seed)

    def seen(
        self, shift: np.ndarray, A: np.ndarray | None = None, noise: float = 2.0
    ) -> np.ndarray:
        """The image in which what was at x is at A (x - c) + c + shift, c the middle."""
        width, height = self.size
        A = np.eye(2) if A is None else A
        c = np.array([(width - 1) / 2, (height - 1) / 2])
        # Fine pixel of image position x: FINE (x + 20) + (FINE - 1) / 2.
        o = FINE * 20 + (FINE - 1) / 2
        t = FINE * (c + shift - A @ c) + o - A @ np.array([o, o])
        M = np.column_stack([A, t])
        moved = cv2.warpAffine(
            self.world,
            M,
            self.world.shape[::-1],
            flags=cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REFLECT,
        )
        cut = moved[20 * FINE : (20 + height) * FINE, 20 * FINE : (20 + width) * FINE]
        image = cv2.resize(cut, (width, height), interpolation=cv2.INTER_AREA)
        image = image + noise * self.rng.standard_normal(image.shape)
        return np.clip(np.rint(image), 0, 255).astype(np.uint8)
