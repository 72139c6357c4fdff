"""Where the ids of features go: beside them, touching nothing that is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from scene_core.arrays import Vec
from web_panels.painter import CORNERS, SHIFT, circle

DIRECTIONS = circle(16)
"""Places around a feature that are tried for its id, at each of two distances."""
LONG = 2.0
"""An id at the end of what reaches so many times farther there could be anything's."""


@dataclass(frozen=True)
class Drawn:
    """What is drawn of one feature, px of the canvas."""

    centre: Vec
    contours: Vec
    """(J, K, 2): none for a feature that was just started, several along an open ray."""
    match: Vec | None
    true: Vec | None
    half: float
    """Half the side of the square about the match: the size of the patch that was found."""


class Occupancy:
    """Which parts of the canvas are taken, on a grid of a quarter of its size."""

    GRID = 4
    PAD = 3

    def __init__(self, shape: tuple[int, ...], shapes: Sequence[Drawn], u: float) -> None:
        self.h, self.w = shape[0], shape[1]
        self.gap = 4.0 * u
        mask = np.zeros((self.h // self.GRID + 1, self.w // self.GRID + 1), np.uint8)
        cross = 5.0 * u * CORNERS
        for s in shapes:
            rim = [*s.contours, s.centre + cross]
            if s.match is not None:
                rim.append(s.match + (s.half + 2.0 * u) * CORNERS)
            if s.true is not None:
                rim.append(s.true + cross)
            for region in rim:
                points = [np.round(region * ((1 << SHIFT) / self.GRID)).astype(np.int32)]
                cv2.fillPoly(mask, points, 1, cv2.LINE_8, SHIFT)
                # The line is drawn on the rim, half of it outside.
                cv2.polylines(mask, points, True, 1, 1, cv2.LINE_8, SHIFT)
        self.sums = cv2.integral(mask)
        self.boxes: list[tuple[float, float, float, float]] = []

    def place(self, s: Drawn, w: int, h: int, must: bool) -> tuple[int, int] | None:
        """Left end of the baseline for a text of w x h px next to a shape; None: no room."""
        corners, size = self._candidates(s, w, h, must), np.array([w, h])
        inside = ((corners >= 3) & (corners + size <= (self.w - 3, self.h - 3))).all(1)
        corners = corners[inside]
        free = corners[self._free(corners, w, h)]
        chosen = next((c for c in free if not self._meets_text(c, w, h)), None)
        if chosen is None and must:
            beside = s.centre + self.gap
            chosen = corners[0] if len(corners) else np.clip(beside, 3, (self.w, self.h) - size - 3)
        if chosen is None:
            return None
        x, y = float(chosen[0]), float(chosen[1])
        self.boxes.append((x, y, x + w, y + h))
        return round(x), round(y + h)

    def _candidates(self, s: Drawn, w: int, h: int, outlined: bool) -> Vec:
        """Upper left corners (n, 2): around the shape, touching the tangent of each direction;
        those where the shape reaches far, as a line does along itself, last."""
        drawn = [s.contours.reshape(-1, 2), s.centre + self.gap * CORNERS]
        if s.match is not None:
            drawn.append(s.match + s.half * CORNERS)
        reach = ((np.concatenate(drawn) - s.centre) @ DIRECTIONS.T).max(0)
        reach = reach + (1.8 * self.gap if outlined else 0.0)
        half = np.abs(DIRECTIONS) @ np.array([w, h]) / 2
        near = [
            s.centre + DIRECTIONS * (reach + half + far * self.gap)[:, None] for far in (1.5, 5.0)
        ]
        long = np.tile(np.maximum(reach, LONG * reach.min()), 2)
        beside = np.concatenate(near)[np.argsort(long, kind="stable")]
        return np.round(beside - np.array([w, h]) / 2)

    def _free(self, corners: Vec, w: int, h: int) -> np.ndarray:
        lo = np.maximum((corners - self.PAD) // self.GRID, 0).astype(int)
        hi = ((corners + np.array([w, h]) + self.PAD) // self.GRID + 1).astype(int)
        hi = np.minimum(hi, (self.sums.shape[1] - 1, self.sums.shape[0] - 1))
        s = self.sums
        taken = s[hi[:, 1], hi[:, 0]] - s[lo[:, 1], hi[:, 0]]
        taken = taken - s[hi[:, 1], lo[:, 0]] + s[lo[:, 1], lo[:, 0]]
        return taken == 0

    def _meets_text(self, corner: Vec, w: int, h: int) -> bool:
        (x, y), pad = corner, self.PAD
        return any(
            x < b[2] + pad and b[0] < x + w + pad and y < b[3] + pad and b[1] < y + h + pad
            for b in self.boxes
        )
