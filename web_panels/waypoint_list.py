"""The Waypoints card: the list of a simulated robot that follows one, to be edited."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from scene_core.session.published import Published
from web_panels import style
from web_panels.drive import Chooser
from web_panels.panel import Page, Post
from web_panels.waypoints import Points, moved, space_of, waypoints_of, with_points, without
from web_panels.widgets import Bound, Group, on_press

MOST = 40
"""Waypoints that are listed; more are edited in the Truth tab."""
ROW = ("↑", "↓", "✕")


class WaypointList:
    """One row of inputs for every waypoint; it is there only for a robot that follows some."""

    rate_hz = 20.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self.group = Group()
        self.robot = ""
        self.rows: list[Bound] = []
        self.listed: tuple[Any, ...] | None = None
        self.latest: Published | None = None
        self.rows_box: viser.GuiFolderHandle | None = None

    def build(self, server: viser.ViserServer, post: Post) -> None:
        gui = self.gui = server.gui
        self.post = post
        self.box = gui.add_folder("Waypoints", visible=False, expand_by_default=False)
        with self.box:
            self.chooser = Chooser(gui, self.group)
            self.list = gui.add_folder(None)
            placing = gui.add_checkbox(
                "Click to add", False, hint="A click on the ground of the map adds a waypoint."
            )
            add = gui.add_button("Add here", color="gray", hint="Where the robot truly is now.")
        self.placing = Bound(placing, self.group, self._place)
        on_press(add, lambda _: self._add_here())

    def _place(self, on: bool) -> None:
        self.page.change(placing=self.robot if on else "")

    def render(self, p: Published) -> None:
        self.latest = p
        robots = p.experiment.estimator.robots
        with_list = tuple(name for name in robots if waypoints_of(p, name) is not None)
        self.box.visible = bool(with_list)
        self.robot = self.chooser.show(with_list)
        placing = self.page.look.placing
        if placing and placing != self.robot:
            self.page.change(placing="")
        points = waypoints_of(p, self.robot)
        if points is None:
            return
        shape = (p.run, self.robot, len(points), space_of(p, self.robot).d)
        if shape != self.listed:
            self._rebuild(p, points)
            self.listed = shape
        for bound, point in zip(self.rows, points, strict=False):
            bound.show(point if len(point) != 1 else next(iter(point)))
        self.placing.show(bool(self.page.look.placing))

    def _rebuild(self, p: Published, points: Points) -> None:
        gui, space = self.gui, space_of(p, self.robot)
        self.group.remove(self.rows_box, self.chooser.bound, self.placing)
        self.rows = []
        names = ", ".join(space.labels[: space.d])
        with self.list:
            self.rows_box = gui.add_folder(None)
        with self.rows_box:
            gui.add_html(style.block(f'<span class="d">Waypoints ({names}) in m</span>'))
            for i, point in enumerate(points[:MOST]):
                self._add_row(i, point, space.d)

    def _add_row(self, i: int, point: tuple[float, ...], d: int) -> None:
        gui, name = self.gui, str(i + 1)
        at = (*point, 0.0, 0.0, 0.0)
        if d == 1:
            handle: Any = gui.add_number(name, at[0], step=0.01)
        elif d == 2:
            handle = gui.add_vector2(name, (at[0], at[1]), step=0.01)
        else:
            handle = gui.add_vector3(name, (at[0], at[1], at[2]), step=0.01)
        self.rows.append(Bound(handle, self.group, lambda v: self._replace(i, v)))
        buttons = gui.add_button_group("", ROW, hint="Earlier, later, delete.")

        async def pressed(event: viser.GuiEvent) -> None:
            if event.client is not None:
                self._act(i, event.target.value)

        buttons.on_click(pressed)

    def _now(self) -> Points:
        """The list as last edited."""
        found = None if self.latest is None else waypoints_of(self.latest, self.robot)
        return found or ()

    def _replace(self, i: int, value: Any) -> None:
        points = self._now()
        if i < len(points):
            point = tuple(float(v) for v in value) if isinstance(value, tuple) else (float(value),)
            self.post(with_points(self.robot, (*points[:i], point, *points[i + 1 :])))

    def _act(self, i: int, what: str) -> None:
        points = self._now()
        if i < len(points):
            changed = without(points, i) if what == ROW[2] else None
            if changed is None:
                changed = moved(points, i, -1 if what == ROW[0] else 1)
            self.post(with_points(self.robot, changed))

    def _add_here(self) -> None:
        p = self.latest
        truth = None if p is None or p.trace is None else p.trace.frame.truth
        if p is None or truth is None or self.robot not in truth.xp:
            return
        at = space_of(p, self.robot).position(np.asarray(truth.xp[self.robot]))
        point = tuple(round(float(v), 2) for v in at)
        self.post(with_points(self.robot, (*self._now(), point)))
