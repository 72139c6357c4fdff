"""Smooth random pictures that can be looked at from anywhere."""

from __future__ import annotations

import cv2
import numpy as np

FINE = 4
"""Subdivisions of a pixel in the world picture."""


class Picture:
    """A picture with detail of about two pixels; pixels average over their area."""

    def __init__(self, seed: int, width: int = 320, height: int = 240, detail: float = 1.5) -> None:
        rng = np.random.default_rng(seed)
        self.size = (width, height)
        fine = rng.standard_normal(((height + 40) * FINE, (width + 40) * FINE)).astype(np.float32)
        coarse = cv2.GaussianBlur(fine, (0, 0), 4 * detail * FINE) * 4 * detail
        smooth = cv2.GaussianBlur(fine, (0, 0), detail * FINE) * detail + coarse
        self.world = cv2.normalize(smooth, smooth, 20, 235, cv2.NORM_MINMAX)
        self.rng = rng

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
