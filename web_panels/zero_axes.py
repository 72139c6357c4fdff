"""The button that puts the axes of the whole map where a robot is."""

from __future__ import annotations

import viser

from scene_core.session.commands import ZeroAxes
from scene_core.session.published import Published
from web_panels import style
from web_panels.panel import Post
from web_panels.widgets import Bound, Group, on_press

HELP = (
    "Tell everything from where this robot is at the end of the frame: it is then at zero for "
    "certain, landmarks and other robots are relative to it. What the sensors expect stays the "
    "same. Undo takes it back."
)


class ZeroAxesHere:
    """A button, the robot to put the axes at when there are several, and where they are."""

    def __init__(self, gui: viser.GuiApi, group: Group, post: Post) -> None:
        self.post = post
        self.robots: tuple[str, ...] = ("",)
        self.chosen = ""
        button = gui.add_button("Zero axes here", color="gray", hint=HELP)
        on_press(button, lambda _: self.post(ZeroAxes(self.chosen or self.robots[0])))
        which = gui.add_dropdown("Axes at", self.robots, visible=False, hint="The robot.")
        self.which = Bound(which, group, self._choose)
        self.words = gui.add_html("")
        self.shown = ""

    def _choose(self, robot: str) -> None:
        self.chosen = robot

    def render(self, p: Published) -> None:
        robots = tuple(p.experiment.estimator.robots)
        if robots != self.robots:
            self.robots, self.chosen = robots, robots[0]
            self.which.handle.options = robots
            self.which.handle.visible = len(robots) > 1
        self.which.show(self.chosen)
        text = axes_words(p)
        if text != self.shown:
            self.shown = text
            words = f'<span class="d">{style.escape(text)}</span>'
            self.words.content = style.block(words, "padding:0 10px 6px")


def axes_words(p: Published) -> str:
    """Where the axes are, or why they could not be moved just now."""
    if p.message.startswith("the axes can not"):
        return p.message
    axes = None if p.trace is None else p.trace.world.axes
    if axes is None:
        return "The axes are those the run began in."
    return f"The axes are where robot '{axes.robot}' was at the end of frame {axes.frame}."
