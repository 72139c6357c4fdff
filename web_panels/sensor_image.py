"""A camera's measurement space: the picture itself, enlarged, in pixels.

A sensor that measures more than a pixel (a depth, a second picture) is drawn where its leading two
components, u and v, are.
"""

from __future__ import annotations

import cv2
import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.ellipses import ellipse_points
from scene_core.models.base import Sensor
from web_panels.marks import Scene, raw_pixels, raw_points
from web_panels.painter import Painter, dots
from web_panels.panel import Page
from web_panels.sensor_pane import SensorPane, limits_words
from web_panels.style import C

CANVAS_WIDTH = 800
"""About this wide, px; twice what the docked panel shows."""
DARKEN = (np.arange(256) * 0.82).astype(np.uint8)
"""The picture is dimmed a little, so that the drawings stand out."""


class ImageChart:
    """Pixels (u, v) of an image of `width` x `height`, magnified by `magnification`."""

    wide = False

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self.magnification = min(3.0, max(1.0, CANVAS_WIDTH / width))
        self.size = (round(width * self.magnification), round(height * self.magnification))

    def background(self, scene: Scene) -> np.ndarray:
        pixels = raw_pixels(scene.raw)
        if pixels is None:
            canvas = np.full((self.size[1], self.size[0], 3), C["card"], np.uint8)
            self._points(canvas, raw_points(scene.raw))
            painter = Painter(canvas)
            for curve in scene.raw_lines:
                painter.curve(self.place(curve), C["ink"], 1.2)
            return canvas
        grey = cv2.resize(cv2.LUT(pixels, DARKEN), self.size, interpolation=cv2.INTER_LINEAR)
        return cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB)

    def _points(self, canvas: np.ndarray, z: Vec) -> None:
        painter = Painter(canvas)
        w, h = self.size
        step = 10.0 ** np.floor(np.log10(self.width / 2.0)) * self.magnification
        for x in np.arange(step, w, step):
            painter.line(np.array([x, 0.0]), np.array([x, h]), C["line"], 1.0)
        for y in np.arange(step, h, step):
            painter.line(np.array([0.0, y]), np.array([w, y]), C["line"], 1.0)
        if len(z):
            dots(canvas, self.place(z), 3.2 * painter.u)

    def place(self, z: Vec, lane: np.ndarray | None = None) -> Vec:
        # Pixel centres are at whole numbers; the first pixel covers -0.5 to 0.5.
        return (z[..., :2] + 0.5) * self.magnification - 0.5

    def outlines(self, h: Vec, S: Mat, half_width: float, lane: np.ndarray) -> Vec:
        return self.place(ellipse_points(h[..., :2], S[..., :2, :2], half_width, 40))

    def measurement(self, xy: Vec) -> tuple[float, ...] | None:
        u, v = (np.asarray(xy) + 0.5) / self.magnification - 0.5
        inside = 0 <= u <= self.width and 0 <= v <= self.height
        return (float(u), float(v)) if inside else None


def image_chart(sensor: Sensor, scene: Scene) -> ImageChart:
    """The chart of a camera."""
    (_, width), (_, height) = sensor.limits[:2]
    return ImageChart(width, height)


def image_words(sensor: Sensor) -> tuple[str, ...]:
    """Size of the picture, and the range of what else is measured."""
    (_, width), (_, height) = sensor.limits[:2]
    size = f"{width:.0f} × {height:.0f} px"
    if sensor.measurement_size == 2:
        return (size,)
    if sensor.limits[2:] == sensor.limits[:2]:
        return (f"two pictures of {size}",)
    return (size, *limits_words(sensor, first=2))


class SensorImage(SensorPane):
    """The pane of a camera."""

    def __init__(self, page: Page, mount: str) -> None:
        super().__init__(page, mount, image_chart, image_words, (800, 600))
