"""A one-dimensional sensor's measurement space: a ruler with one lane per feature."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import Sensor
from web_panels.marks import Scene, raw_points
from web_panels.painter import Painter
from web_panels.panel import Page
from web_panels.polar_charts import nice_reach
from web_panels.sensor_pane import SensorPane, limits_words
from web_panels.style import RGB, C

SIZE = (800, 360)
MARGIN = 44
LANES = 7
LANE_HEIGHT = 36
CAP = 10.0
TYPE = 0.6
"""Size of the numbers of the ruler."""


class BarChart:
    """Measurements (z,) on a horizontal ruler over the sensor's limits."""

    size: tuple[int, int] = SIZE
    magnification = 0.0
    wide = False

    def __init__(self, limits: tuple[float, float], unit: str) -> None:
        self.lo, self.hi, self.unit = limits[0], limits[1], unit
        self.scale = (SIZE[0] - 2 * MARGIN) / (self.hi - self.lo)
        self.axis = 40 + LANES * LANE_HEIGHT

    def background(self, scene: Scene) -> np.ndarray:
        canvas = np.full((SIZE[1], SIZE[0], 3), C["card"], np.uint8)
        painter = Painter(canvas)
        step = nice_reach((self.hi - self.lo) / 10.0)
        first = np.ceil(self.lo / step) * step
        for v in np.arange(first, self.hi + step / 1e3, step):
            self._upright(painter, v, 16.0, self.axis + 6.0, C["line"], 1.2)
            words = f"{v:g}"
            w, _ = painter.text_size(words, TYPE)
            at = (round(self._x(v) - w / 2), self.axis + 30)
            painter.text(words, at, C["dim"], TYPE)
        ends = np.array([[self._x(self.lo), self.axis], [self._x(self.hi), self.axis]])
        painter.line(ends[0], ends[1], C["dim"], 1.5)
        painter.text(self.unit, (SIZE[0] - MARGIN + 12, self.axis + 5), C["dim"], TYPE)
        if self.lo <= 0.0 <= self.hi:
            self._upright(painter, 0.0, 16.0, self.axis, C["estimate"], 1.5)
        for v in raw_points(scene.raw).reshape(-1):
            self._upright(painter, v, self.axis - 16.0, self.axis, C["ink"], 3.0)
        return canvas

    def _upright(
        self, painter: Painter, v: float, y0: float, y1: float, colour: RGB, width: float
    ) -> None:
        x = self._x(v)
        painter.line(np.array([x, y0]), np.array([x, y1]), colour, width)

    def _x(self, value: float) -> float:
        return MARGIN + (value - self.lo) * self.scale

    def place(self, z: Vec, lane: np.ndarray) -> Vec:
        x = MARGIN + (z[..., 0] - self.lo) * self.scale
        return np.stack([x, 34.0 + LANE_HEIGHT * (lane % LANES)], axis=-1)

    def outlines(self, h: Vec, S: Mat, half_width: float, lane: np.ndarray) -> Vec:
        """Capsules over h +- half_width sd."""
        half = half_width * np.sqrt(np.maximum(S[:, 0, 0], 0.0)) * self.scale
        round_ = np.minimum(CAP, half)
        a = np.linspace(-np.pi / 2, np.pi / 2, 12)
        cap = np.stack(
            [np.cos(a) * round_[:, None], np.broadcast_to(CAP * np.sin(a), (len(h), 12))], -1
        )
        cap[..., 0] += (half - round_)[:, None]
        return self.place(h, lane)[:, None, :] + np.concatenate([cap, -cap], axis=1)

    def measurement(self, xy: Vec) -> tuple[float, ...] | None:
        value = self.lo + (float(xy[0]) - MARGIN) / self.scale
        return (value,) if self.lo <= value <= self.hi else None


def bar_chart(sensor: Sensor, scene: Scene) -> BarChart:
    """The chart of a one-dimensional sensor."""
    return BarChart(sensor.limits[0], sensor.units[0])


class SensorBar(SensorPane):
    """The pane of a one-dimensional sensor."""

    def __init__(self, page: Page, mount: str) -> None:
        super().__init__(page, mount, bar_chart, limits_words, SIZE)
