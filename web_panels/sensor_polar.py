"""The measurement space of a sensor of ranges and angles, as a chart of whichever it has."""

from __future__ import annotations

import math

from scene_core.models.base import Sensor
from web_panels.drawing import Chart
from web_panels.marks import Scene, raw_points
from web_panels.panel import Page
from web_panels.polar_charts import (
    SIZE,
    AngleChart,
    BearingChart,
    PolarChart,
    RangeChart,
    nice_reach,
)
from web_panels.sensor_pane import SensorPane, limits_words


class SensorPolar(SensorPane):
    """The pane of a sensor of ranges and angles; its reach only grows, so that the picture is
    steady."""

    def __init__(self, page: Page, mount: str) -> None:
        super().__init__(page, mount, self.chart, limits_words, SIZE)
        self._key_of_chart: tuple | None = None
        self._chart: Chart | None = None
        self._reach = 0.0

    def chart(self, sensor: Sensor, scene: Scene) -> Chart:
        """A chart that holds everything that was measured so far, and no more than the limits."""
        key = sensor.units, tuple(sensor.limits)
        if key != self._key_of_chart:
            self._key_of_chart, self._chart, self._reach = key, None, 0.0
        reach = _reach(sensor, scene) if sensor.units[0] == "m" else 0.0
        if self._chart is None or reach > self._reach:
            self._reach = max(reach, self._reach)
            self._chart = chart_of(sensor, self._reach)
        return self._chart


def chart_of(sensor: Sensor, reach: float) -> Chart:
    """The chart for the units of a sensor's leading components."""
    limits = tuple(sensor.limits)
    match sensor.units[:2]:
        case ("rad",):
            return BearingChart(limits)
        case ("m",):
            return RangeChart(limits, reach)
        case ("rad", "rad"):
            return AngleChart(limits)
        case _:
            return PolarChart(limits, reach)


def _reach(sensor: Sensor, scene: Scene) -> float:
    ranges = [float(m.h[0]) for m in scene.marks] + list(raw_points(scene.raw)[:, :1].ravel())
    needed = max((r for r in ranges if math.isfinite(r)), default=1.0)
    return min(nice_reach(needed), sensor.limits[0][1])
