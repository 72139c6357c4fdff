"""Measurement spaces around a sensor as charts: range and bearing, one of them alone, two angles.

Seen from above the sensor looks up the page and has its left to the left, so a positive bearing
turns to the left, as in the map.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise

import cv2
import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.ellipses import ellipse_points
from web_panels.marks import Scene, raw_points
from web_panels.painter import FONT, Painter, circle, dots
from web_panels.style import C

SIZE = (800, 600)
ROBOT = np.array([[0.0, -14.0], [9.0, 10.0], [-9.0, 10.0]])
STEPS = (1.0, 2.0, 5.0)
AXIS_TYPE = 0.75
"""Size of the numbers of a grid, on a canvas that is shown at half its size."""
GOLDEN = 0.618034
"""Of a turn: multiples of it stay apart from each other, however many there are."""
Limits = tuple[tuple[float, float], ...]


def nice_reach(distance: float) -> float:
    """The smallest of 1, 2, 5, 10, 20, .. that is not below a distance."""
    if not (math.isfinite(distance) and distance > 0):
        return 1.0
    decade = 10.0 ** math.floor(math.log10(distance))
    return next((s * decade for s in STEPS if s * decade >= distance), 10.0 * decade)


class PolarChart:
    """Range and bearing (r, b, ...) about a robot; `reach` metres fit on the canvas."""

    size: tuple[int, int] = SIZE
    magnification = 0.0
    wide = False

    def __init__(self, limits: Limits, reach: float) -> None:
        self.limits, self.reach = limits, reach
        self.half_angle = min(math.pi, max(abs(v) for v in limits[1]))
        forward_only = self.half_angle <= math.pi / 2 + 1e-9
        w, h = SIZE
        self.origin = np.array([w / 2, 0.93 * h if forward_only else h / 2])
        room = min(0.87 * h, w / 2 - 20) if forward_only else h / 2 - 14
        if forward_only:
            side = math.sin(self.half_angle)
            room = min(0.87 * h, (w / 2 - 20) / max(side, 1e-9))
        self.scale = room / reach

    def background(self, scene: Scene) -> np.ndarray:
        canvas = self._grid.copy()
        z = raw_points(scene.raw)
        if len(z):
            dots(canvas, self.place(z), 4.0 * canvas.shape[1] / 640)
        return canvas

    @cached_property
    def _grid(self) -> np.ndarray:
        canvas = np.full((SIZE[1], SIZE[0], 3), C["card"], np.uint8)
        painter = Painter(canvas)
        radii = self.radii()
        for r in radii:
            self.arc(painter, r)
        self.spokes(painter)
        for r in radii:
            x, y = self.place(np.array([r, 0.0]))
            at = (round(x + 5), round(y + 22))
            cv2.putText(canvas, f"{r:g} m", at, FONT, AXIS_TYPE, C["dim"], 1, cv2.LINE_AA)
        self.robot(painter)
        return canvas

    def radii(self) -> Vec:
        """Round ranges of the grid's arcs."""
        step = nice_reach(self.reach / 5.0)
        return np.arange(step, self.reach * 1.001, step)

    def arc(self, painter: Painter, r: float) -> None:
        """An arc of the grid."""
        fan = np.linspace(-self.half_angle, self.half_angle, 73)
        arc = self.place(np.stack([np.full_like(fan, r), fan], axis=-1))
        for a, b in pairwise(arc):
            painter.line(a, b, C["line"], 1.2)

    def spokes(self, painter: Painter) -> None:
        """Lines of equal bearing, every 30 degrees."""
        angles = [-self.half_angle, self.half_angle] if self.half_angle < math.pi else []
        whole = math.floor(math.degrees(self.half_angle) / 30.0)
        angles += [math.radians(30.0 * k) for k in range(-whole, whole + 1)]
        for b in angles:
            end = self.place(np.array([self.reach, b]))
            painter.line(self.origin, end, C["line"], 1.2)

    def robot(self, painter: Painter) -> None:
        """The robot, looking up the page."""
        painter.fill([self.origin + ROBOT], C["estimate"])

    def place(self, z: Vec, lane: np.ndarray | None = None) -> Vec:
        r, b = z[..., 0] * self.scale, z[..., 1]
        return self.origin + np.stack([-r * np.sin(b), -r * np.cos(b)], axis=-1)

    def outlines(self, h: Vec, S: Mat, half_width: float, lane: np.ndarray) -> Vec:
        contours = ellipse_points(h[..., :2], S[..., :2, :2], half_width, 48)
        contours[..., 0] = np.maximum(contours[..., 0], 0.0)
        return self.place(contours)

    def measurement(self, xy: Vec) -> tuple[float, ...] | None:
        left, up = self.origin - np.asarray(xy)
        z = (math.hypot(left, up) / self.scale, math.atan2(left, up))
        return z if within(z, self.limits) else None


class BearingChart:
    """Bearings (b,) about a robot: a measurement is a ray, a region a sector. How far away a
    feature's cross is drawn means nothing; it only keeps them apart."""

    size: tuple[int, int] = SIZE
    magnification = 0.0
    wide = True

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.disc = PolarChart(((0.0, 1.0), *limits), 1.0)

    def background(self, scene: Scene) -> np.ndarray:
        canvas = self._grid.copy()
        painter = Painter(canvas)
        for b in raw_points(scene.raw)[:, :1].ravel():
            painter.line(self.disc.origin, self.disc.place(np.array([1.0, b])), C["ink"], 1.4)
        return canvas

    @cached_property
    def _grid(self) -> np.ndarray:
        canvas = np.full((SIZE[1], SIZE[0], 3), C["card"], np.uint8)
        painter = Painter(canvas)
        self.disc.arc(painter, 1.0)
        self.disc.spokes(painter)
        self.disc.robot(painter)
        return canvas

    def place(self, z: Vec, lane: np.ndarray) -> Vec:
        r = 0.45 + 0.45 * np.mod(GOLDEN * lane, 1.0)
        return self.disc.place(np.stack([r, z[..., 0]], axis=-1))

    def outlines(self, h: Vec, S: Mat, half_width: float, lane: np.ndarray) -> Vec:
        """Sectors h +- half_width sd from the robot to the rim, at most all around."""
        half = half_width * np.sqrt(np.maximum(S[:, 0, 0], 0.0))
        half = np.minimum(half, 0.999 * math.pi)[:, None]
        b = h + half * np.linspace(-1.0, 1.0, 40)
        rim = self.disc.place(np.stack([np.ones_like(b), b], axis=-1))
        tip = np.broadcast_to(self.disc.origin, (len(h), 1, 2))
        return np.concatenate([tip, rim], axis=1)

    def measurement(self, xy: Vec) -> tuple[float, ...] | None:
        left, up = self.disc.origin - np.asarray(xy)
        z = (math.atan2(left, up),)
        near = math.hypot(left, up) <= self.disc.scale
        return z if near and within(z, self.limits) else None


class RangeChart:
    """Ranges (r,) about a robot: a measurement is a circle, a region a ring. On which side a
    feature's cross is drawn means nothing; it only keeps them apart."""

    size: tuple[int, int] = SIZE
    magnification = 0.0
    wide = True

    def __init__(self, limits: Limits, reach: float) -> None:
        self.limits, self.reach = limits, reach
        self.disc = PolarChart((*limits, (-math.pi, math.pi)), reach)

    def background(self, scene: Scene) -> np.ndarray:
        canvas = self._grid.copy()
        r = raw_points(scene.raw)[:, :1, None] * self.disc.scale
        if len(r):
            Painter(canvas).rings(self.disc.origin + r * circle(96), C["ink"], 1.4)
        return canvas

    @cached_property
    def _grid(self) -> np.ndarray:
        canvas = np.full((SIZE[1], SIZE[0], 3), C["card"], np.uint8)
        painter = Painter(canvas)
        for r in self.disc.radii():
            self.disc.arc(painter, r)
            x, y = self.disc.place(np.array([r, 0.0]))
            at = (round(x + 5), round(y + 22))
            cv2.putText(canvas, f"{r:g} m", at, FONT, AXIS_TYPE, C["dim"], 1, cv2.LINE_AA)
        self.disc.robot(painter)
        return canvas

    def place(self, z: Vec, lane: np.ndarray) -> Vec:
        b = _side(lane)
        return self.disc.place(np.stack([z[..., 0], np.broadcast_to(b, z.shape[:-1])], axis=-1))

    def outlines(self, h: Vec, S: Mat, half_width: float, lane: np.ndarray) -> Vec:
        """Rings h +- half_width sd, cut open where the feature's cross is."""
        half = half_width * np.sqrt(np.maximum(S[:, 0, 0], 0.0))[:, None]
        b = _side(lane)[:, None] + np.linspace(0.0, 2.0 * math.pi, 72)
        outer, inner = np.broadcast_to(h + half, b.shape), np.maximum(h - half, 0.0)
        there = np.stack([outer, b], axis=-1)
        back = np.stack([np.broadcast_to(inner, b.shape), b], axis=-1)[:, ::-1]
        return self.disc.place(np.concatenate([there, back], axis=1))

    def measurement(self, xy: Vec) -> tuple[float, ...] | None:
        z = (float(np.linalg.norm(self.disc.origin - np.asarray(xy))) / self.disc.scale,)
        return z if within(z, self.limits) else None


class AngleChart:
    """Two angles (pan, elevation, ...) as the sensor looks: left to the left, up is up."""

    magnification = 0.0
    wide = False

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.spans = np.array([hi - lo for lo, hi in limits[:2]])
        self.scale = min((SIZE[0] - 60) / self.spans[0], (SIZE[1] - 60) / self.spans[1])
        self.size: tuple[int, int] = (SIZE[0], round(self.spans[1] * self.scale) + 60)
        self.middle = 0.5 * np.sum(limits[:2], axis=1)

    def background(self, scene: Scene) -> np.ndarray:
        canvas = self._grid.copy()
        z = raw_points(scene.raw)
        if len(z):
            dots(canvas, self.place(z), 4.0 * canvas.shape[1] / 640)
        return canvas

    @cached_property
    def _grid(self) -> np.ndarray:
        canvas = np.full((self.size[1], self.size[0], 3), C["card"], np.uint8)
        painter = Painter(canvas)
        ends = np.array(self.limits[:2])
        step = math.radians(nice_reach(math.degrees(self.spans.max()) / 10.0))
        for axis in (0, 1):
            lo, hi = ends[axis]
            for v in step * np.arange(math.ceil(lo / step), math.floor(hi / step) + 1):
                line = np.array(ends.T)
                line[:, axis] = v
                a, b = self.place(line)
                painter.line(a, b, C["line"], 1.2)
                words = f"{math.degrees(v):.0f}"
                (wide, _), _ = cv2.getTextSize(words, FONT, AXIS_TYPE, 1)
                right = self.size[0] - wide - 2
                x, y = a + np.array((-wide / 2, 22.0) if axis == 0 else (0.0, -4.0))
                at = (round(min(x, right)) if axis == 0 else right, round(y))
                cv2.putText(canvas, words, at, FONT, AXIS_TYPE, C["dim"], 1, cv2.LINE_AA)
        return canvas

    def place(self, z: Vec, lane: np.ndarray | None = None) -> Vec:
        return 0.5 * np.array(self.size) - self.scale * (z[..., :2] - self.middle)

    def outlines(self, h: Vec, S: Mat, half_width: float, lane: np.ndarray) -> Vec:
        return self.place(ellipse_points(h[..., :2], S[..., :2, :2], half_width, 40))

    def measurement(self, xy: Vec) -> tuple[float, ...] | None:
        z = self.middle + (0.5 * np.array(self.size) - np.asarray(xy)) / self.scale
        at = (float(z[0]), float(z[1]))
        return at if within(at, self.limits) else None


def within(z: tuple[float, ...], limits: Limits) -> bool:
    """Whether the leading components z of a measurement lie inside the limits."""
    return all(lo <= v <= hi for v, (lo, hi) in zip(z, limits, strict=False))


def _side(lane: np.ndarray) -> Vec:
    """A bearing for every feature."""
    return 2.0 * math.pi * np.mod(GOLDEN * lane, 1.0)
