"""The View tab: confidence, layers, views, type."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from scene_core.geometry.ellipses import chi2_gate
from scene_core.session.published import Published
from scene_core.session.tracks import body_name
from web_panels import map_geometry as geo
from web_panels import style
from web_panels.map_legend import confidence_words
from web_panels.panel import Look, Page, Post, View
from web_panels.widgets import Bound, Group, on_press
from web_panels.zero_axes import ZeroAxesHere

VIEWS: tuple[tuple[str, View, str], ...] = (
    ("Perspective", "perspective", "The whole scene from above one corner."),
    ("Top", "top", "From straight above."),
    ("Side", "side", "From one side, level."),
    ("Sensor's eye", "eye", "From the sensor; press again to leave."),
    ("Follow robot", "follow", "The camera goes where the robot goes; press again to stop."),
    ("Orbit", "orbit", "Turn slowly around the middle; press again to stop."),
)

LAYERS: tuple[tuple[str, str, str], ...] = (
    ("truth", "Truth", "What is really so, in yellow. The filter never sees it."),
    ("room", "Room", "The simulated place, as far as it has walls or an outline."),
    ("trajectories", "Trajectories", "Where the robot was."),
    ("rays", "Rays", "Where a feature may be whose depth is still open; lines of sight."),
    ("labels", "Labels nearby", "Numbers of the features near the robot."),
    ("large", "Large type", "For projectors."),
)

COLOURS = {"verdict of this frame": "verdict", "correlation with the selected": "correlation"}


class ViewPanel:
    """Layers and confidence are shared by all browsers, the camera is each one's own."""

    rate_hz = 10.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self.group = Group()
        self.drawn: tuple[Look, int] | None = None

    def build(self, server: viser.ViserServer, post: Post) -> None:
        gui = server.gui
        confidence = gui.add_slider(
            "Confidence, %", 50, 99, 1, 95, hint="Probability content of the ellipsoids."
        )
        self.confidence = Bound(
            confidence, self.group, lambda v: self.page.change(confidence=v / 100.0)
        )
        self.words = gui.add_html("")
        colour = gui.add_dropdown(
            "Colours",
            tuple(COLOURS),
            hint="Select a feature, then see which others are correlated with it.",
        )
        self.colour = Bound(colour, self.group, lambda v: self.page.change(colour=COLOURS[v]))
        follow = gui.add_dropdown(
            "Follow", [""], visible=False, hint="Whose eye, and whom 'Follow robot' follows."
        )
        self.follow = Bound(follow, self.group, lambda v: self.page.change(follow=v))
        for title, view, help_text in VIEWS:
            button = gui.add_button(title, color="gray", hint=help_text)
            on_press(button, lambda client, v=view: self._ask(client, v))
        self.zero_axes = ZeroAxesHere(gui, self.group, post)
        self.layers = {
            field: Bound(
                gui.add_checkbox(title, getattr(self.page.look, field), hint=help_text),
                self.group,
                self._setter(field),
            )
            for field, title, help_text in LAYERS
        }
        dark = gui.add_checkbox("Dark", True, hint="Dark or light page.")
        self.dark = Bound(dark, self.group, self._setter("dark"))
        self.gui = gui

    def _ask(self, client: viser.ClientHandle, view: View) -> None:
        if self.page.views is not None:
            self.page.views.ask(client, view)

    def _setter(self, field: str) -> Callable[[Any], None]:
        return lambda value: self.page.change(**{field: value})

    def _show_robots(self, robots: tuple[str, ...], look: Look) -> None:
        """Whom to follow, where there is a choice."""
        choice = self.follow.handle
        if tuple(choice.options) != robots:
            choice.options = list(robots)
        choice.visible = len(robots) > 1
        self.follow.show(look.follow if look.follow in robots else robots[0])

    def render(self, p: Published) -> None:
        self.zero_axes.render(p)
        look = self.page.look
        bodies = geo.bodies(p.experiment.estimator.robots)
        self._show_robots(tuple(body_name(*body) for body in bodies), look)
        d = p.experiment.estimator.policies.landmark.space.d
        if (look, d) == self.drawn:
            return
        for field, bound in self.layers.items():
            bound.show(getattr(look, field))
        self.dark.show(look.dark)
        self.confidence.show(round(100 * look.confidence))
        gate = chi2_gate(d, look.confidence)
        words = f"{confidence_words(look, d)} (d2 &lt; {gate:.2f})."
        self.words.content = style.block(f'<span class="d">{words}</span>', "padding:0 10px 6px")
        if self.drawn is None or self.drawn[0].dark != look.dark:
            self.gui.configure_theme(
                dark_mode=look.dark,
                show_logo=False,
                show_share_button=False,
                brand_color=style.C["nomatch"],
            )
        self.drawn = (look, d)
