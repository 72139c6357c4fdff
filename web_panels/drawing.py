"""The painter of the sensor panes: ellipses, matches and ids over a picture or a chart.

All geometry is in pixels of the canvas, which is drawn larger than it is shown, so that lines and
ids stay crisp. A state differs in colour *and* in line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np

from scene_core.arrays import Mat, Vec
from web_panels.labels import Drawn, Occupancy
from web_panels.marks import Mark, Scene
from web_panels.painter import Painter, circle, dots, pale
from web_panels.style import C

ORDER = ("out", "unselected", "ink", "partial", "nomatch", "accepted", "rejected")
"""Palette keys of the states, from the bottom to the top of the picture."""
WIDTH = {"accepted": 2.4, "nomatch": 2.4, "rejected": 2.8, "partial": 2.0}
THIN = 1.1
"""Line width of all other states."""


class Chart(Protocol):
    """A measurement space on a canvas; `lane` tells features apart where they get rows."""

    size: tuple[int, int]
    """Width and height of the canvas, px."""
    magnification: float
    """Canvas pixels per image pixel; 0 where there is no image."""
    wide: bool
    """Regions reach across the chart: ids stand at the crosses, over the lines."""

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
        """The measurement at a place on the canvas, or its leading components where it has more
        than are drawn; None outside the sensor's limits."""
        ...


@dataclass(frozen=True)
class Shape(Drawn):
    """A mark on the canvas."""

    mark: Mark
    curve: Vec | None = None
    """Of a line: (K, 2) where it is predicted."""
    seen: Vec | None = None
    """(K, 2) where it was measured."""
    true_curve: Vec | None = None
    """(K, 2) where it really is."""
    particles: tuple[Vec, Vec] | None = None
    """Where the particles of an open feature are, and their weights."""


def paint(scene: Scene, chart: Chart, truth: bool) -> tuple[np.ndarray, list[Shape]]:
    """The picture of a pane, and where its features are, for clicks."""
    painter = Painter(chart.background(scene))
    shapes = shapes_of(scene, chart)
    if truth:
        # Below the rest: a line is measured so near to the truth that this would hide its state.
        for s in shapes:
            if s.true_curve is not None:
                painter.curve(s.true_curve, C["truth"], 1.2)
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
                painter.gapped_cross(s.true, C["truth"])
    _draw_ids(painter, [_bare(s) for s in shapes] if chart.wide else shapes)
    return painter.canvas, shapes


def shapes_of(scene: Scene, chart: Chart) -> list[Shape]:
    """All marks on the canvas, computed together."""
    marks = scene.marks
    if not marks:
        return []
    lane = np.array([m.label for m in marks])
    centres = chart.place(np.array([m.h for m in marks]), lane)
    regions = [(i, h, S) for i, m in enumerate(marks) for h, S in _regions(m)]
    owner = np.array([i for i, _, _ in regions], dtype=int)
    if regions:
        h, S = np.array([h for _, h, _ in regions]), np.array([S for _, _, S in regions])
        contours = chart.outlines(h, S, scene.half_width, lane[owner])
    else:
        contours = np.zeros((0, 3, 2))
    matched = _placed(chart, [m.z for m in marks], lane)
    u = chart.size[0] / 640.0
    half = [max(6.0 * u, chart.magnification * m.patch / 2) for m in marks]
    true = _placed(chart, [m.true_z for m in marks], lane)
    shapes = [
        Shape(centres[i], contours[owner == i], matched.get(i), true.get(i), half[i], m)
        for i, m in enumerate(marks)
    ]
    return [_with_line(_with_particles(s, chart), chart) for s in shapes]


def _with_line(s: Shape, chart: Chart) -> Shape:
    """A line has curves, and its band as its region."""
    line = s.mark.line
    if line is None:
        return s

    def place(z: Vec | None) -> Vec | None:
        return None if z is None else chart.place(z, np.full(len(z), s.mark.label))

    banded = len(line.band) > 0 and s.mark.state not in ("unselected", "out")
    band = place(line.band) if banded else None
    return replace(
        s,
        contours=s.contours if band is None else band[None],
        half=4.0 * chart.size[0] / 640.0,
        curve=place(line.curve),
        seen=place(line.seen),
        true_curve=place(line.true),
    )


def _with_particles(s: Shape, chart: Chart) -> Shape:
    if s.mark.particles is None:
        return s
    h, w = s.mark.particles
    return replace(s, particles=(chart.place(h, np.full(len(h), s.mark.label)), w))


def _regions(m: Mark) -> list[tuple[Vec, Mat]]:
    if m.string is not None:
        return [(h, m.string.S) for h in m.string.h]
    return [] if m.S is None else [(m.h, m.S)]


def _placed(chart: Chart, z: Sequence[Vec | None], lane: np.ndarray) -> dict[int, Vec]:
    known = [i for i, v in enumerate(z) if v is not None]
    if not known:
        return {}
    places = chart.place(np.array([z[i] for i in known]), lane[known])
    return dict(zip(known, places, strict=True))


def _draw(painter: Painter, s: Shape) -> None:
    if s.curve is not None:
        _draw_line(painter, s, s.curve)
        return
    state, colour = s.mark.state, C[s.mark.state]
    width = WIDTH.get(state, THIN)
    if s.particles is not None:
        _draw_particles(painter, *s.particles)
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


def _draw_line(painter: Painter, s: Shape, curve: Vec) -> None:
    """The band of the gate thin, the predicted line, and the measured one with its ends."""
    state, colour = s.mark.state, C[s.mark.state]
    if state == "rejected":
        painter.dashed(s.contours, colour, THIN)
    else:
        painter.rings(s.contours, colour, THIN)
    painter.curve(curve, colour, 0.6 * WIDTH.get(state, THIN / 0.6))
    if s.seen is not None:
        pieces = np.array_split(s.seen, 5)[::2] if state == "rejected" else [s.seen]
        for piece in pieces:
            painter.curve(piece, colour, 2.6)
        for end in (s.seen[0], s.seen[-1]):
            painter.square(end, colour, s.half, 1.8)


def _draw_particles(painter: Painter, at: Vec, w: Vec) -> None:
    """Discs with an area that grows with the weight."""
    for place, weight in zip(at, w, strict=True):
        dots(painter.canvas, place[None], (1.0 + 3.0 * weight**0.5) * painter.u, C["partial"])


def _draw_selected(painter: Painter, s: Shape) -> None:
    """A white line around all that belongs to the selected feature."""
    if s.curve is not None and not len(s.contours):
        hull = cv2.convexHull(s.curve.astype(np.float32))[:, 0]
    elif len(s.contours):
        hull = cv2.convexHull(s.contours.reshape(-1, 2).astype(np.float32))[:, 0]
    else:
        hull = s.centre + 12.0 * painter.u * circle(32)
    out = hull - hull.mean(0)
    far = np.maximum(np.hypot(out[:, 0], out[:, 1]), 1e-9)[:, None]
    painter.rings((hull + out * (4.5 * painter.u / far))[None], C["white"], 1.8)


def _draw_ids(painter: Painter, shapes: Sequence[Shape]) -> None:
    """Ids of the features that were measured, at the first free place around each.

    An id that finds no place is left out; the one of the selected feature is always drawn.
    """
    wanted = [s for s in shapes if s.mark.selected or s.mark.state not in ("unselected", "out")]
    boxes = Occupancy(painter.canvas.shape, shapes, painter.u)
    for s in sorted(wanted, key=lambda s: (not s.mark.selected, s.mark.label)):
        words, scale = str(s.mark.label), 0.76 if s.mark.selected else 0.66
        w, h = painter.text_size(words, scale)
        at = boxes.place(s, w, h, s.mark.selected)
        if at is None:
            continue
        r, g, b = C["white"] if s.mark.selected else C[s.mark.state]
        painter.text(words, at, (pale(r), pale(g), pale(b)), scale)


def _bare(s: Shape) -> Shape:
    """A shape without its region."""
    return replace(s, contours=np.zeros((0, 3, 2)))


def from_curve(xy: Vec, curve: Vec) -> float:
    """Distance of a place from the straight pieces of a curve (K, 2)."""
    way, off = np.diff(curve, axis=0), xy - curve[:-1]
    t = np.clip(np.vecdot(off, way) / np.maximum(np.vecdot(way, way), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(off - t[:, None] * way, axis=1).min())


def hit(shapes: Sequence[Shape], xy: Vec, reach: float) -> int | None:
    """The feature under a click: the nearest one inside whose ellipse it is, or within reach."""
    best: tuple[float, int] | None = None
    for s in shapes:
        spots = [s.centre] if s.match is None else [s.centre, s.match]
        distance = min(float(np.linalg.norm(xy - q)) for q in spots)
        for curve in (s.curve, s.seen):
            if curve is not None:
                distance = min(distance, from_curve(xy, curve))
        inside = any(
            cv2.pointPolygonTest(c.astype(np.float32), (float(xy[0]), float(xy[1])), False) >= 0
            for c in s.contours
        )
        near = distance <= reach or (inside and s.mark.state not in ("unselected", "out"))
        if near and (best is None or distance < best[0]):
            best = (distance, s.mark.label)
    return None if best is None else best[1]
