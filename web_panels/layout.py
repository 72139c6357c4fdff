"""Where everything is on the page: the only file that docks panels.

Sensors left, one tab each; below them the tabs that explain; controls right; the map between.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from scene_core.session.published import Published
from web_panels import style, viser_hooks
from web_panels.covariance import Covariance
from web_panels.drive import Drive
from web_panels.events import Events
from web_panels.frame_card import FrameCard
from web_panels.head import Head
from web_panels.inspector import Inspector
from web_panels.map_panel import MapPanel
from web_panels.models_panel import ModelsPanel
from web_panels.panel import Page, Panel, Post
from web_panels.parameters import EstimatorParameters, TruthParameters
from web_panels.phase_card import PhaseCard
from web_panels.plots import Plots
from web_panels.sensor_bar import SensorBar
from web_panels.sensor_image import SensorImage
from web_panels.sensor_polar import SensorPolar
from web_panels.transport import Transport
from web_panels.view import ViewPanel
from web_panels.waypoint_list import WaypointList

LEFT_PX, RIGHT_PX = 452, 320
"""At 900 px height the upper left half holds a 4:3 image of this width, a caption and a legend."""

SENSOR_PANES: dict[str, Callable[[Page, str], Panel]] = {
    "image": SensorImage,
    "polar": SensorPolar,
    "bar": SensorBar,
}
"""By `Sensor.pane`."""

PANE_ICONS: dict[str, Any] = {
    "image": viser.Icon.CAMERA,
    "polar": viser.Icon.RADAR_2,
    "bar": viser.Icon.RULER_MEASURE,
}


class Layout:
    """The docked panels and what is in them."""

    def __init__(self, server: viser.ViserServer, post: Post, page: Page) -> None:
        self.server, self.post, self.page = server, post, page
        self.fixed: list[Panel] = []
        self.sensors: dict[str, tuple[str, viser.GuiTabHandle, Panel]] = {}
        """By mount: the kind of its pane, its tab and its panel."""

    @property
    def panels(self) -> list[Panel]:
        return [*(panel for _, _, panel in self.sensors.values()), *self.fixed]

    def _add(self, panel: Panel) -> None:
        panel.build(self.server, self.post)
        self.fixed.append(panel)

    def build(self) -> None:
        """Everything that does not depend on the scenario."""
        gui, page = self.server.gui, self.page
        gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, brand_color=style.C["nomatch"]
        )
        gui.set_panel_label("Scene")
        self.upper = gui.add_panel()
        self.lower = gui.add_panel()
        for title, panel in (
            ("Inspector", Inspector(page)),
            ("Covariance", Covariance(page)),
            ("Plots", Plots(page)),
            ("Events", Events(page)),
        ):
            with self.lower.add_tab(title):
                self._add(panel)
        self._add(Head(page))
        tabs = gui.add_tab_group()
        with tabs.add_tab("Run"):
            self._add(Transport(page))
            self._add(Drive(page))
            self._add(WaypointList(page))
            self._add(PhaseCard(page))
            self._add(FrameCard(page))
        for title, panel in (
            ("Models", ModelsPanel(page)),
            ("Estimator", EstimatorParameters(page)),
            ("Truth", TruthParameters(page)),
            ("View", ViewPanel(page)),
        ):
            with tabs.add_tab(title):
                self._add(panel)
        self._add(MapPanel(page))

    def dock(self) -> None:
        """Put the panels in their places, once they have content."""
        gui = self.server.gui
        self.upper.dock_left()
        self.upper.set_width(LEFT_PX)
        self.lower.dock_below(self.upper)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(RIGHT_PX)

    def fit_sensors(self, p: Published) -> None:
        """One tab for every mounted sensor, kept while its measurement space stays the same."""
        wanted = {name: m.sensor.pane for name, m in p.experiment.estimator.mounts.items()}
        gone = [n for n, (pane, _, _) in self.sensors.items() if wanted.get(n) != pane]
        old = [self.sensors.pop(name)[1] for name in gone]
        for tab in old:
            viser_hooks.clear(tab)
        for name, pane in wanted.items():
            if name not in self.sensors:
                tab = self._sensor_tab(old, name, PANE_ICONS[pane])
                panel = SENSOR_PANES[pane](self.page, name)
                with tab:
                    panel.build(self.server, self.post)
                self.sensors[name] = (pane, tab, panel)
        for tab in old:
            tab.remove()

    def _sensor_tab(
        self, old: list[viser.GuiTabHandle], name: str, icon: Any
    ) -> viser.GuiTabHandle:
        """An old tab as long as there are any: a browser gives up the place, and the width, of a
        panel whose tabs are all others than before."""
        if not old:
            return self.upper.add_tab(name, icon=icon)
        tab = old.pop(0)
        viser_hooks.rename(tab, name, icon)
        return tab
