"""The Drive card: keys for a simulated robot that is driven by hand.

It is there only while a robot has such a driver. Everything goes through edits of the driver's
parameters, so that a run that was driven can be repeated.
"""

from __future__ import annotations

import numpy as np
import viser

from scene_core.session.commands import SetParam
from scene_core.session.published import Published
from scene_core.sources.manual import Manual
from web_panels import style
from web_panels.keys import Keys
from web_panels.panel import Page, Post
from web_panels.waypoints import driver_of
from web_panels.widgets import Bound, Group

DIRECTIONS: dict[str, tuple[tuple[str, str], tuple[str, str], str]] = {
    "forward": (("KeyW", "ArrowUp"), ("KeyS", "ArrowDown"), "speed"),
    "turn": (("KeyA", "ArrowLeft"), ("KeyD", "ArrowRight"), "rate"),
    "left": (("KeyQ", "KeyQ"), ("KeyE", "KeyE"), "speed"),
    "up": (("PageUp", "PageUp"), ("PageDown", "PageDown"), "speed"),
}
"""By parameter of the driver: the keys for more and for less, and how fast they go."""
HELP = (
    "<kbd>W</kbd> <kbd>S</kbd> or arrows: ahead, back · <kbd>A</kbd> <kbd>D</kbd>: turn · "
    "<kbd>Q</kbd> <kbd>E</kbd>: sideways · <kbd>PgUp</kbd> <kbd>PgDn</kbd>: up, down. It goes as "
    "set in Truth until a key is pressed; let go and it stops. The 3-D camera does not hear these "
    "keys now: use the mouse."
)


def asked(held: frozenset[str], speeds: dict[str, float]) -> dict[str, float]:
    """What held keys ask of each parameter."""
    return {
        name: speeds[how] * (bool(held & {*more}) - bool(held & {*less}))
        for name, (more, less, how) in DIRECTIONS.items()
    }


class Chooser:
    """A dropdown of the robots a card is for; it is there when there is a choice."""

    def __init__(self, gui: viser.GuiApi, group: Group) -> None:
        self.robot = ""
        self.handle = gui.add_dropdown("Robot", [""], visible=False, hint="Who is driven here.")
        self.bound = Bound(self.handle, group, self._choose)

    def _choose(self, robot: str) -> None:
        self.robot = robot

    def show(self, robots: tuple[str, ...]) -> str:
        """The chosen one of the robots that there are; nobody where there are none."""
        if not robots:
            self.robot = ""
            return ""
        if tuple(self.handle.options) != robots:
            self.handle.options = list(robots)
        self.handle.visible = len(robots) > 1
        if self.robot not in robots:
            self.robot = robots[0]
        self.bound.show(self.robot)
        return self.robot


class Drive:
    """Keyboard driving."""

    rate_hz = 20.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self.group = Group()
        self.robot = ""
        self.speeds = {"speed": 0.5, "rate": 0.6}
        self.sent: dict[str, float] = {}
        self.presses = 0

    def build(self, server: viser.ViserServer, post: Post) -> None:
        gui = server.gui
        self.post = post
        self.box = gui.add_folder("Drive", visible=False)
        with self.box:
            self.chooser = Chooser(gui, self.group)
            self.words = gui.add_html("")
            speed = gui.add_slider("Keys go, m/s", 0.05, 3.0, 0.05, 0.5, hint="Speed of the keys.")
            rate = gui.add_slider("turn, °/s", 2.0, 120.0, 1.0, 34.0, hint="Turn rate of the keys.")
        # Outside the folder: what is invisible hears nothing.
        self.keys = Keys(server, self._pressed)
        self.speed = Bound(speed, self.group, lambda v: self._go("speed", float(v)))
        self.rate = Bound(rate, self.group, lambda v: self._go("rate", float(np.radians(v))))

    def _go(self, how: str, value: float) -> None:
        self.speeds[how] = value

    def _pressed(self, held: frozenset[str]) -> None:
        """Post what changed; parameters whose keys are not touched stay where they are. Until all
        keys are let go it is one step for undo: halfway back the robot would move by itself."""
        if not self.robot:
            return
        self.presses += not any(self.sent.values())
        for name, value in asked(held, self.speeds).items():
            if value != self.sent.get(name, 0.0):
                self.sent[name] = value
                path = f"source.robots.{self.robot}.driver.{name}"
                self.post(SetParam(path, value, f"drive {self.presses}"))

    def render(self, p: Published) -> None:
        robots = p.experiment.estimator.robots
        by_hand = tuple(name for name in robots if isinstance(driver_of(p, name), Manual))
        self.box.visible = bool(by_hand)
        self.keys.listen(bool(by_hand))
        chosen = self.chooser.show(by_hand)
        if chosen != self.robot:
            if self.robot in by_hand:
                self._pressed(frozenset())
            self.robot, self.sent = chosen, {}
        self.speed.show(self.speeds["speed"])
        self.rate.show(round(float(np.degrees(self.speeds["rate"]))))
        waits = "" if p.mode == "playing" else "<br><b>Press <kbd>Space</kbd> to let it go.</b>"
        text = style.block(f'<span class="d">{HELP}</span>{waits}', "padding:0 10px 6px")
        if text != self.words.content:
            self.words.content = text
