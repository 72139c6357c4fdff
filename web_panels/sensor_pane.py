"""The pane of one mounted sensor: caption, picture with everything drawn in it, legend, clicks."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

import numpy as np
import viser

from scene_core.filter.records import Trace
from scene_core.models.base import Sensor
from scene_core.session.commands import InitialiseAt, Select
from scene_core.session.published import Published
from web_panels import style
from web_panels.clickable import Click, ClickableImage
from web_panels.drawing import Chart, Shape, hit, paint
from web_panels.marks import Scene, scene_of
from web_panels.panel import Page, Post
from web_panels.style import C, escape, shown

REMEMBERED = 40
"""Pictures whose clicks are still understood: a click travels back for a while."""
REACH = 14.0
"""A click this near to a feature means it, px of a 640 px wide picture."""

ChartFor = Callable[[Sensor, Scene], Chart]
"""The chart of a sensor, big enough for what is to be drawn."""

NO_FRAME = style.block("No frame yet: press <kbd>Space</kbd>.")

LEGEND = (
    ("fill", "accepted", "accepted"),
    ("ellipse", "nomatch", "no match"),
    ("dash", "rejected", "rejected"),
    ("thin", "unselected", "not selected"),
    ("ray", "partial", "partial"),
)
LEGEND_STYLE = (
    ".lgs{display:flex;justify-content:space-between;flex-wrap:wrap;gap:0 6px}"
    ".e .lgs .lg{margin-right:0;gap:3px;font-size:10.5px;letter-spacing:-.01em}"
)
"""All five in one line of the docked panel; in a narrower one they need two."""


class SensorPane:
    """Shared by all kinds of sensors; what differs is the chart and the words about it."""

    rate_hz = 12.0

    def __init__(
        self,
        page: Page,
        mount: str,
        chart_for: ChartFor,
        about: Callable[[Sensor], tuple[str, ...]],
        empty: tuple[int, int],
    ) -> None:
        self.page, self.mount = page, mount
        self.chart_for, self.about, self.empty = chart_for, about, empty
        self.shown: OrderedDict[int, tuple[list[Shape], Chart]] = OrderedDict()
        self._key: tuple | None = None
        self._trace: Trace | None = None
        """The one that is drawn: as long as it is kept, no other has its id."""
        self._run: int | None = None
        self._selected: int | None = None
        self._texts: tuple[str, str] = ("", "")

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.post = post
        width, height = self.empty
        self.blank = np.full((height, width, 3), C["card"], np.uint8)
        self.caption = server.gui.add_html(NO_FRAME)
        self.picture = ClickableImage(server, self.blank, self.clicked)
        self.legend = server.gui.add_html("")

    def render(self, p: Published) -> None:
        trace = p.trace
        if p.run != self._run:
            self._clear()
            self._run = p.run
        if trace is None or (p.mode == "playing" and not trace.complete):
            return
        look = self.page.look
        key = (p.run, id(trace), p.selected, look.truth)
        if key != self._key:
            scene = scene_of(p, self.mount)
            self.page.between()
            # A sensor that did not fire keeps its last picture.
            if scene is not None and (scene.raw is not None or not self.shown):
                self._draw(p, scene)
            self._key, self._selected, self._trace = key, p.selected, trace
        self._caption(p)

    def _clear(self) -> None:
        """Nothing of another run stays in sight."""
        if self.shown:
            self.shown.clear()
            self.picture.show(self.blank, -1)
            self.caption.content, self.legend.content = NO_FRAME, ""

    def _draw(self, p: Published, scene: Scene) -> None:
        assert p.trace is not None
        chart = self.chart_for(p.trace.world.mounts[self.mount].sensor, scene)
        canvas, shapes = paint(scene, chart, self.page.look.truth)
        self.page.between()
        self.shown[scene.frame] = (shapes, chart)
        self.shown.move_to_end(scene.frame)
        while len(self.shown) > REMEMBERED:
            self.shown.popitem(last=False)
        self.picture.show(canvas, scene.frame)
        self.scene = scene
        self.legend.content = style.block(legend(scene), "margin-top:-2px;line-height:1.35")

    def _caption(self, p: Published) -> None:
        if not self.shown or p.trace is None or self.mount not in p.trace.world.mounts:
            return
        sensor = p.trace.world.mounts[self.mount].sensor
        rate = f"{p.experiment.source.frame_rate:.3g} Hz"
        first, *more = self.about(sensor)
        facts = " · ".join((first, rate, regions(self.scene, p)))
        if self.scene.frame != p.trace.frame.index:
            facts += f" · from frame {self.scene.frame}"
        # Last, since the end is cut off where it is too long; the hint has all of it.
        facts = " · ".join((facts, *more))
        hint = "click: select" if p.mode == "playing" else "click: select or start one"
        if not p.trace.complete and not p.trace.predictions(self.mount):
            hint = "not predicted yet: press <kbd>P</kbd>"
        text = style.block(
            f'<div class="row" style="padding-bottom:4px;white-space:nowrap"><span class="d" '
            f'title="{facts}" style="overflow:hidden;text-overflow:ellipsis">{facts}</span>'
            '<span class="d" '
            'title="A click on a feature selects it; paused, a click on an empty place starts a '
            f'feature there, a shift-click even beside another one.">{hint}</span></div>'
        )
        if text != self.caption.content:
            self.caption.content = text

    def clicked(self, click: Click) -> None:
        """Select the feature under the click, or start one there."""
        at = self.shown.get(click.frame)
        if at is None:
            return
        shapes, chart = at
        width, height = chart.size
        xy = np.array([click.x * width, click.y * height]) - 0.5
        label = None if click.shift else hit(shapes, xy, REACH * width / 640.0)
        if label is not None:
            self.post(Select(None if label == self._selected else label))
            return
        z = chart.measurement(xy)
        if z is not None:
            self.post(InitialiseAt(self.mount, z, click.frame))


def legend(scene: Scene) -> str:
    """What the colours and lines mean, with how many there are."""
    items = [(kind, key, f"{word} {scene.counts.get(key, 0)}") for kind, key, word in LEGEND]
    return f'<style>{LEGEND_STYLE}</style><div class="lgs">{style.legend(items)}</div>'


def regions(scene: Scene, p: Published) -> str:
    """How wide the drawn regions are."""
    assert p.trace is not None
    policies = p.trace.world.policies
    if policies.association.kind == "search":
        return f"ellipses {scene.half_width:.3g} sigma"
    return f"gates {100.0 * policies.gate.confidence:.4g} %"


def limits_words(sensor: Sensor, first: int = 0, drawn: int = 2) -> tuple[str, ...]:
    """Ranges of what a sensor measures, e.g. r to 8 m, b ±180°, from its component `first` on: of
    those that are drawn, and of all others."""
    parts = list(zip(sensor.labels, sensor.limits, sensor.units, strict=True))
    words = [f"{escape(name)} {_range(lo, hi, unit)}" for name, (lo, hi), unit in parts]
    groups = (words[first:drawn], words[max(first, drawn) :])
    return tuple(", ".join(group) for group in groups if group)


def _range(lo: float, hi: float, unit: str) -> str:
    if lo == -hi:
        return f"±{_end(hi, unit)}"
    to = f"to {_end(hi, unit)}"
    return to if lo == 0 else f"{_end(lo, '' if unit == 'm' else unit)} {to}"


def _end(value: float, unit: str) -> str:
    """An end of a range, which mostly is a round number."""
    v, u = shown(value, unit)
    return f"{float(f'{v:.3g}'):g}{'' if u.startswith('°') else ' '}{u}".strip().replace("-", "−")
