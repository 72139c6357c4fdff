"""The painter of the sensor panes: ellipses, matches and ids over a picture or a chart.

All geometry is in pixels of the canvas, which is drawn larger than it is shown, so that lines and
ids stay crisp. A state differs in colour *and* in line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np

from scene_core.arrays import Mat, Vec
from web_panels.marks import Mark, Scene
from web_panels.style import RGB, C

SHIFT = 4
"""Sub-pixel bits of OpenCV's drawing functions."""
ORDER = ("out", "unselected", "ink", "partial", "nomatch", "accepted", "rejected")
"""Palette keys of the states, from the bottom to the top of the picture."""
WIDTH = {"accepted": 2.4, "nomatch": 2.4, "rejected": 2.8, "partial": 2.0}
THIN = 1.1
"""Line width of all other states."""
DASHES = 10
FONT = cv2.FONT_HERSHEY_SIMPLEX
CANDIDATES = 16
"""Places around a feature that are tried for its id, at each of two distances."""
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


class Chart(Protocol):
    """A measurement space on a canvas; `lane` is the row of a feature, where there are rows."""

    size: tuple[int, int]
    """Width and height of the canvas, px."""
    magnification: float
    """Canvas pixels per image pixel; 0 where there is no image."""

    def background(self, scene: Scene) -> np.ndarray:
        """A fresh RGB canvas with the raw measurements."""
        ...

    def place(self, z: Vec, lane: np.ndarray) -> Vec:
        """Canvas positions (N, 2) of measurements (N, m)."""
        ...

    def outlines(self, h: Vec, S: Mat, half_width: float, lane: np.ndarray) -> Vec:
        """Closed contours (N, K, 2) of the regions around h (N, m) with covariances S (N, m, m)."""
        ...

    def measurement(self, xy: Vec) -> tuple[float, ...] | None:
        """The measurement at a place on the canvas; None outside the sensor's limits."""
        ...


@dataclass(frozen=True)
class Shape:
    """A drawn mark on the canvas."""

    mark: Mark
    centre: Vec
    contours: Vec
    """(J, K, 2): none for a feature that was just started, several along an open ray."""
    match: Vec | None
    true: Vec | None
    half: float
    """Half the side of the square about the match, px: the size of the patch that was found."""


class Painter:
    """Draws on one canvas; `u` is the unit of all widths, 1 px of a 640 px wide canvas.

    Lines are filled polygons: OpenCV's anti-aliased thick lines cost four times as much.
    """

    def __init__(self, canvas: np.ndarray) -> None:
        self.canvas = canvas
        self.u = canvas.shape[1] / 640.0

    def fill(self, parts: Sequence[Vec], colour: RGB) -> None:
        """The area inside an odd number of the parts."""
        points = [np.round(q * (1 << SHIFT)).astype(np.int32) for q in parts]
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

    def line(self, a: Vec, b: Vec, colour: RGB, width: float) -> None:
        """A straight line."""
        along = b - a
        length = float(np.hypot(*along))
        if length < 1e-9:
            return
        side = np.array([-along[1], along[0]]) * (0.5 * width * self.u / length)
        self.fill([np.array([a + side, b + side, b - side, a - side])], colour)

    def cross(self, at: Vec, colour: RGB, size: float, width: float, turned: bool = False) -> None:
        """A cross, upright or turned by 45 degrees."""
        a = size * self.u
        arms = ((0.7 * a, 0.7 * a), (0.7 * a, -0.7 * a)) if turned else ((a, 0.0), (0.0, a))
        for arm in arms:
            self.line(at - arm, at + arm, colour, width)

    def square(self, at: Vec, colour: RGB, size: float, width: float) -> None:
        """The outline of a square with half side `size` px."""
        outer, inner = size + width / 2 * self.u, size - width / 2 * self.u
        self.fill([at + outer * CORNERS, at + inner * CORNERS], colour)

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


def dots(canvas: np.ndarray, at: Vec, radius: float) -> None:
    """Raw measurements: filled discs at (k, 2)."""
    r = round(radius * (1 << SHIFT))
    for x, y in np.round(at * (1 << SHIFT)).astype(int).tolist():
        cv2.circle(canvas, (x, y), r, C["ink"], -1, cv2.LINE_AA, SHIFT)


def _sides(contours: Vec, width: float) -> tuple[Vec, Vec]:
    """Outer and inner rim (N, K, 2) of lines of a width along closed contours."""
    along = np.roll(contours, -1, axis=1) - np.roll(contours, 1, axis=1)
    length = np.maximum(np.hypot(along[..., 0], along[..., 1]), 1e-9)
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1) * (0.5 * width / length)[..., None]
    return contours + normal, contours - normal


def paint(scene: Scene, chart: Chart, truth: bool) -> tuple[np.ndarray, list[Shape]]:
    """The picture of a pane, and where its features are, for clicks."""
    painter = Painter(chart.background(scene))
    shapes = shapes_of(scene, chart)
    for state in ORDER:
        for s in shapes:
            if s.mark.state == state:
                _draw(painter, s)
    for s in shapes:
        if s.mark.selected:
            _draw_selected(painter, s)
    if truth:
        for s in shapes:
            if s.true is not None:
                painter.cross(s.true, C["truth"], 5.5, 1.3, turned=True)
    _draw_ids(painter, shapes)
    return painter.canvas, shapes


def shapes_of(scene: Scene, chart: Chart) -> list[Shape]:
    """All marks on the canvas, computed together."""
    marks = scene.marks
    if not marks:
        return []
    lane = np.arange(len(marks))
    centres = chart.place(np.array([m.h for m in marks]), lane)
    regions = [(i, h, S) for i, m in enumerate(marks) for h, S in _regions(m)]
    owner = np.array([i for i, _, _ in regions], dtype=int)
    if regions:
        h, S = np.array([h for _, h, _ in regions]), np.array([S for _, _, S in regions])
        contours = chart.outlines(h, S, scene.half_width, owner)
    else:
        contours = np.zeros((0, 3, 2))
    matched = _placed(chart, [m.z for m in marks])
    u = chart.size[0] / 640.0
    half = [max(6.0 * u, chart.magnification * m.patch / 2) for m in marks]
    true = _placed(chart, [m.true_z for m in marks])
    return [
        Shape(m, centres[i], contours[owner == i], matched.get(i), true.get(i), half[i])
        for i, m in enumerate(marks)
    ]


def _regions(m: Mark) -> list[tuple[Vec, Mat]]:
    if m.string is not None:
        return [(h, m.string.S) for h in m.string.h]
    return [] if m.S is None else [(m.h, m.S)]


def _placed(chart: Chart, z: Sequence[Vec | None]) -> dict[int, Vec]:
    known = [i for i, v in enumerate(z) if v is not None]
    if not known:
        return {}
    places = chart.place(np.array([z[i] for i in known]), np.array(known))
    return dict(zip(known, places, strict=True))


def _draw(painter: Painter, s: Shape) -> None:
    state, colour = s.mark.state, C[s.mark.state]
    width = WIDTH.get(state, THIN)
    if s.mark.string is not None:
        painter.rings(s.contours, C["partial"], 1.6)
    elif state == "rejected":
        painter.dashed(s.contours, colour, width)
    else:
        painter.rings(s.contours, colour, width)
    if s.match is not None:
        painter.line(s.centre, s.match, colour, 1.6)
        painter.square(s.match, colour, s.half, 1.8)
    painter.cross(s.centre, C["partial"] if s.mark.partial else colour, 4.0, 1.4)


def _draw_selected(painter: Painter, s: Shape) -> None:
    """A white line around all that belongs to the selected feature."""
    if len(s.contours):
        hull = cv2.convexHull(s.contours.reshape(-1, 2).astype(np.float32))[:, 0]
    else:
        hull = s.centre + 12.0 * painter.u * _circle(32)
    out = hull - hull.mean(0)
    far = np.maximum(np.hypot(out[:, 0], out[:, 1]), 1e-9)[:, None]
    painter.rings((hull + out * (4.5 * painter.u / far))[None], C["white"], 1.8)


def _circle(n: int) -> Vec:
    a = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    return np.stack([np.cos(a), np.sin(a)], axis=-1)


DIRECTIONS = _circle(CANDIDATES)


def pale(channel: int) -> int:
    """A colour channel, lighter: thin letters need more light than lines."""
    return min(255, int(0.55 * channel + 115))


def _draw_ids(painter: Painter, shapes: Sequence[Shape]) -> None:
    """Ids of the features that were measured, at the first free place around each.

    An id that finds no place is left out; the one of the selected feature is always drawn.
    """
    wanted = [s for s in shapes if s.mark.selected or s.mark.state not in ("unselected", "out")]
    boxes = Occupancy(painter.canvas.shape, shapes, painter.u)
    for s in sorted(wanted, key=lambda s: (not s.mark.selected, s.mark.label)):
        words, scale = str(s.mark.label), 0.72 if s.mark.selected else 0.58
        w, h = painter.text_size(words, scale)
        at = boxes.place(s, w, h, s.mark.selected)
        if at is None:
            continue
        r, g, b = C["white"] if s.mark.selected else C[s.mark.state]
        painter.text(words, at, (pale(r), pale(g), pale(b)), scale)


class Occupancy:
    """Which parts of the canvas are taken, on a grid of a quarter of its size."""

    GRID = 4
    PAD = 3

    def __init__(self, shape: tuple[int, ...], shapes: Sequence[Shape], u: float) -> None:
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

    def place(self, s: Shape, w: int, h: int, must: bool) -> tuple[int, int] | None:
        """Left end of the baseline for a text of w x h px next to a shape; None: no room."""
        corners, size = self._candidates(s, w, h), np.array([w, h])
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

    def _candidates(self, s: Shape, w: int, h: int) -> Vec:
        """Upper left corners (n, 2): around the shape, touching the tangent of each direction."""
        drawn = [s.contours.reshape(-1, 2), s.centre + self.gap * CORNERS]
        if s.match is not None:
            drawn.append(s.match + s.half * CORNERS)
        reach = ((np.concatenate(drawn) - s.centre) @ DIRECTIONS.T).max(0)
        half = np.abs(DIRECTIONS) @ np.array([w, h]) / 2
        near = [
            s.centre + DIRECTIONS * (reach + half + far * self.gap)[:, None] for far in (1.5, 5.0)
        ]
        return np.round(np.concatenate(near) - np.array([w, h]) / 2)

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


def hit(shapes: Sequence[Shape], xy: Vec, reach: float) -> int | None:
    """The feature under a click: the nearest one inside whose ellipse it is, or within reach."""
    best: tuple[float, int] | None = None
    for s in shapes:
        spots = [s.centre] if s.match is None else [s.centre, s.match]
        distance = min(float(np.linalg.norm(xy - q)) for q in spots)
        inside = any(
            cv2.pointPolygonTest(c.astype(np.float32), (float(xy[0]), float(xy[1])), False) >= 0
            for c in s.contours
        )
        near = distance <= reach or (inside and s.mark.state not in ("unselected", "out"))
        if near and (best is None or distance < best[0]):
            best = (distance, s.mark.label)
    return None if best is None else best[1]
