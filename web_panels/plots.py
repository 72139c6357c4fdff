"""Histories: error with its bounds, NEES, NIS, landmarks, time per phase, calibrations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser

from scene_core.arrays import Vec
from scene_core.filter.records import Trace
from scene_core.session.published import Published, RobotSeries, Series
from web_panels.panel import Page, Post
from web_panels.style import HEX, PHASES, UPLOT_AXIS, shown

POINTS = 400
"""Samples of one curve; more than the pixels it is drawn on."""
HEIGHT = 138
"""Two of these fit into the docked panel."""
X_SERIES: Any = dict(label="s")
BLUE, GREEN, AMBER, INK = HEX["nomatch"], HEX["estimate"], HEX["unselected"], HEX["ink"]
BLUE_FILL, GREEN_FILL = "rgba(72,149,255,.13)", "rgba(64,206,112,.10)"


def thinned(n: int, points: int = POINTS) -> np.ndarray:
    """Indices of at most `points` of n samples, the last one always among them."""
    step = max(1, math.ceil(n / points))
    return np.arange((n - 1) % step, n, step)


def curve(label: str, colour: str, **extra: Any) -> Any:
    """A line of a plot."""
    return dict(label=label, stroke=colour, width=1.5, points=dict(show=False)) | extra


class Plot:
    """One uPlot, invisible while it has nothing to show."""

    def __init__(self, server: viser.ViserServer) -> None:
        self.server = server
        self.kind: tuple = ()
        nothing = np.zeros(1)
        axes: Any = (dict(UPLOT_AXIS), dict(UPLOT_AXIS))
        legend: Any = dict(show=False)
        scales: Any = dict(x=dict(time=False))
        self.handle = server.gui.add_uplot(
            (nothing, nothing),
            (X_SERIES, curve("nothing yet", INK)),
            title="",
            axes=axes,
            scales=scales,
            legend=legend,
            height=HEIGHT,
            padding=(4, 12, 0, 0),
            visible=False,
        )

    def show(
        self,
        title: str,
        unit: str,
        x: Vec,
        curves: Sequence[tuple[Any, Vec]],
        band: tuple[int, int, str] | None = None,
    ) -> None:
        """Draw curves over x; `band` fills between two of them (counted from 1)."""
        if len(x) < 2:
            self.hide()
            return
        kind = (unit, tuple(c["label"] for c, _ in curves), band)
        data = (
            np.ascontiguousarray(x, dtype=np.float64),
            *(np.ascontiguousarray(y, dtype=np.float64) for _, y in curves),
        )
        h = self.handle
        with self.server.atomic():
            if kind != self.kind:
                named = dict(label=unit, labelSize=16) if unit else {}
                axes: Any = (dict(UPLOT_AXIS), dict(UPLOT_AXIS, space=26) | named)
                bands: Any = () if band is None else (dict(series=list(band[:2]), fill=band[2]),)
                h.series = (X_SERIES, *(c for c, _ in curves))
                h.bands, h.axes = bands, axes
                self.kind = kind
            h.data = data
            h.title = title
            h.visible = True

    def hide(self) -> None:
        """Take the plot off the page."""
        self.handle.visible = False


class Plots:
    """The Plots tab."""

    rate_hz = 5.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self._key: tuple | None = None
        self._trace: Trace | None = None
        """The one that is shown: as long as it is kept, no other has its id."""

    @property
    def restless(self) -> bool:
        """Another curve was chosen; the session need not have moved."""
        return self._key is None

    def build(self, server: viser.ViserServer, post: Post) -> None:
        gui = server.gui
        self.error_choice = gui.add_dropdown(
            "Error of", ["–"], hint="Component of the pose whose error is plotted."
        )
        self.note = gui.add_html("")
        self.error, self.nees = Plot(server), Plot(server)
        self.calibration_choice = gui.add_dropdown(
            "Calibration", ["–"], hint="Calibration that is estimated.", visible=False
        )
        self.calibration, self.nis = Plot(server), Plot(server)
        self.ms, self.landmarks = Plot(server), Plot(server)

        async def chosen(event: viser.GuiEvent) -> None:
            if event.client_id is not None:
                self._key = None

        self.error_choice.on_update(chosen)
        self.calibration_choice.on_update(chosen)

    def render(self, p: Published) -> None:
        s = p.series
        n = len(s.frames)
        key = (p.run, n, None if n == 0 else s.frames[-1], id(p.trace))
        if key == self._key:
            return
        self._key, self._trace = key, p.trace
        if n < 2:
            self.note.content = (
                '<div class="e d">Curves start with the second frame: press <kbd>Space</kbd>.</div>'
            )
            for plot in (self.error, self.nees, self.calibration, self.nis):
                plot.hide()
            self.ms.hide()
            self.landmarks.hide()
            return
        if self.note.content:
            self.note.content = ""
        at = thinned(n)
        x = s.times[at]
        self._robot(s, at, x)
        self._nis(s, at)
        self._ms(s, at, x)
        self.landmarks.show(
            f"Landmarks in the map: {s.landmarks[-1]:.0f}", "", x,
            [(curve("landmarks", HEX["partial"]), s.landmarks[at])],
        )  # fmt: skip
        self._calibration(s, at, x)

    def _robot(self, s: Series, at: np.ndarray, x: Vec) -> None:
        options = [f"{robot} {label}" for robot, r in s.robots.items() for label in r.labels]
        if not options:
            return
        robot, _, label = offered(self.error_choice, options).rpartition(" ")
        r = s.robots[robot]
        self._error(r, r.labels.index(label), at, x)
        if r.nees is None:
            self.nees.hide()
            return
        lo, hi = r.nees_band
        at = at[np.isfinite(r.nees[at])]
        x, one = s.times[at], np.ones(len(at))
        self.nees.show(
            f"NEES of {robot}'s pose, 95 % band {lo:.2f} to {hi:.2f} ({r.nees_dof} DoF)", "NEES", x,
            [
                (curve("2.5 %", AMBER, dash=[5, 4]), lo * one),
                (curve("97.5 %", AMBER, dash=[5, 4]), hi * one),
                (curve("NEES", INK), r.nees[at]),
            ],
            (2, 1, GREEN_FILL),
        )  # fmt: skip

    def _error(self, r: RobotSeries, i: int, at: np.ndarray, x: Vec) -> None:
        there = np.isfinite(r.sd[at, i])
        at, x = at[there], x[there]
        factor, unit = shown(1.0, r.units[i])
        bound = 3.0 * r.sd[at, i] * factor
        if unit == "m" and float(np.nanmax(bound, initial=0.0)) < 0.3:
            bound, factor, unit = 1e3 * bound, 1e3, "mm"
        curves = [(curve("-3 sigma", BLUE), -bound), (curve("+3 sigma", BLUE), bound)]
        title = f"3-sigma bounds of {r.labels[i]}, {unit} over s (no truth, no error)"
        if r.error is not None:
            known = np.isfinite(r.error[at, i])
            at, x = at[known], x[known]
            curves = [(c, y[known]) for c, y in curves]
            curves.append((curve("error", GREEN), factor * r.error[at, i]))
            title = f"Error of {r.labels[i]}, {unit}, with 3-sigma bounds, over s"
        self.error.show(title, unit, x, curves, (2, 1, BLUE_FILL))

    def _nis(self, s: Series, at: np.ndarray) -> None:
        at = at[np.isfinite(s.nis[at])]
        x, band = s.times[at], np.asarray(s.nis_band)[at]
        self.nis.show(
            "NIS per degree of freedom, 95 % band of the frame", "NIS", x,
            [
                (curve("2.5 %", AMBER, dash=[5, 4]), band[:, 0]),
                (curve("97.5 %", AMBER, dash=[5, 4]), band[:, 1]),
                (curve("NIS", INK), s.nis[at]),
            ],
            (2, 1, GREEN_FILL),
        )  # fmt: skip

    def _ms(self, s: Series, at: np.ndarray, x: Vec) -> None:
        known = [phase for phase in PHASES if phase in s.ms]
        curves = [(curve(PHASES[k][0], PHASES[k][1]), np.asarray(s.ms[k])[at]) for k in known]
        if curves:
            total = sum(np.nanmedian(y) for _, y in curves)
            self.ms.show(f"Time per phase, median {total:.1f} ms a frame", "ms", x, curves)

    def _calibration(self, s: Series, at: np.ndarray, x: Vec) -> None:
        self.calibration_choice.visible = bool(s.calibrations)
        if not s.calibrations:
            self.calibration.hide()
            return
        name = offered(self.calibration_choice, list(s.calibrations))
        mean, sd, truth = s.calibrations[name]
        m, w = mean[at], 3.0 * sd[at]
        curves = [
            (curve("-3 sigma", BLUE), m - w),
            (curve("+3 sigma", BLUE), m + w),
            (curve("estimate", GREEN), m),
        ]
        if truth is not None:
            curves.append((curve("truth", HEX["truth"], dash=[5, 4]), truth[at]))
        title = f"{name}: {m[-1]:.4g} ± {w[-1]:.2g} (3 sigma)"
        self.calibration.show(title, "", x, curves, (2, 1, BLUE_FILL))


def offered(choice: viser.GuiDropdownHandle[str], options: list[str]) -> str:
    """The chosen one of the options, which may have changed; the first when it is gone."""
    if list(choice.options) != options:
        choice.options = options
    return choice.value if choice.value in options else options[0]
