"""A range-bearing sensor's measurement space as a chart seen from above.

The robot looks up the page (its z axis) and has x to the left, so a bearing from z towards x turns
to the left, as in the map.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise

import cv2
import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.ellipses import ellipse_points
from scene_core.models.base import Sensor
from web_panels.marks import Scene, raw_points
from web_panels.painter import FONT, Painter, dots
from web_panels.panel import Page
from web_panels.sensor_pane import SensorPane, limits_words
from web_panels.style import C

SIZE = (800, 600)
ROBOT = np.array([[0.0, -14.0], [9.0, 10.0], [-9.0, 10.0]])
STEPS = (1.0, 2.0, 5.0)


def nice_reach(distance: float) -> float:
    """The smallest of 1, 2, 5, 10, 20, .. that is not below a distance."""
    if not (math.isfinite(distance) and distance > 0):
        return 1.0
    decade = 10.0 ** math.floor(math.log10(distance))
    return next((s * decade for s in STEPS if s * decade >= distance), 10.0 * decade)


class PolarChart:
    """Range and bearing (r, b) about a robot; `reach` metres fit on the canvas."""

    size: tuple[int, int] = SIZE
    magnification = 0.0

    def __init__(self, limits: tuple[tuple[float, float], ...], reach: float) -> None:
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
        dots(canvas, self.place(raw_points(scene.raw).reshape(-1, 2)), 4.0 * canvas.shape[1] / 640)
        return canvas

    @cached_property
    def _grid(self) -> np.ndarray:
        canvas = np.full((SIZE[1], SIZE[0], 3), C["card"], np.uint8)
        painter = Painter(canvas)
        step = nice_reach(self.reach / 5.0)
        radii = np.arange(step, self.reach * 1.001, step)
        fan = np.linspace(-self.half_angle, self.half_angle, 73)
        for r in radii:
            arc = self.place(np.stack([np.full_like(fan, r), fan], axis=-1))
            for a, b in pairwise(arc):
                painter.line(a, b, C["line"], 1.2)
        self._spokes(painter)
        for r in radii:
            x, y = self.place(np.array([r, 0.0]))
            at = (round(x + 5), round(y + 18))
            cv2.putText(canvas, f"{r:g} m", at, FONT, 0.5, C["dim"], 1, cv2.LINE_AA)
        painter.fill([self.origin + ROBOT], C["estimate"])
        return canvas

    def _spokes(self, painter: Painter) -> None:
        angles = [-self.half_angle, self.half_angle] if self.half_angle < math.pi else []
        whole = math.floor(math.degrees(self.half_angle) / 30.0)
        angles += [math.radians(30.0 * k) for k in range(-whole, whole + 1)]
        for b in angles:
            end = self.place(np.array([self.reach, b]))
            painter.line(self.origin, end, C["line"], 1.2)

    def place(self, z: Vec, lane: np.ndarray | None = None) -> Vec:
        r, b = z[..., 0] * self.scale, z[..., 1]
        return self.origin + np.stack([-r * np.sin(b), -r * np.cos(b)], axis=-1)

    def outlines(self, h: Vec, S: Mat, half_width: float, lane: np.ndarray) -> Vec:
        contours = ellipse_points(h, S, half_width, 48)
        contours[..., 0] = np.maximum(contours[..., 0], 0.0)
        return self.place(contours)

    def measurement(self, xy: Vec) -> tuple[float, ...] | None:
        left, up = self.origin - np.asarray(xy)
        z = (math.hypot(left, up) / self.scale, math.atan2(left, up))
        inside = all(lo <= v <= hi for v, (lo, hi) in zip(z, self.limits, strict=True))
        return z if inside else None


class SensorPolar(SensorPane):
    """The pane of a range-bearing sensor; its reach only grows, so that the picture is steady."""

    def __init__(self, page: Page, mount: str) -> None:
        super().__init__(page, mount, self.chart, limits_words, SIZE)
        self._chart: PolarChart | None = None

    def chart(self, sensor: Sensor, scene: Scene) -> PolarChart:
        """A chart that holds everything that was measured so far, and no more than the limits."""
        limits = tuple(sensor.limits)
        ranges = [float(m.h[0]) for m in scene.marks] + list(raw_points(scene.raw)[:, :1].ravel())
        needed = max((r for r in ranges if math.isfinite(r)), default=1.0)
        reach = min(nice_reach(needed), limits[0][1])
        old = self._chart
        if old is not None and old.limits == limits and old.reach >= reach:
            return old
        self._chart = PolarChart(limits, reach)
        return self._chart
