"""What a panel is, and the state of the page that all panels share.

A panel is made with the `Page` (sensor panes also with their mount), built once inside its tab and
then rendered from whatever the session last published. The view thread alone calls `build` and
`render`; a widget's callback is `async def`, ignores events without a client (`event.client_id is
None`: those are our own assignments) and only posts a command or changes the page.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

import viser

from scene_core.session.commands import Command
from scene_core.session.published import Published

Post = Callable[[Command], None]
"""Hands a command to the session; safe from any thread."""


class Panel(Protocol):
    """One part of the page.

    A panel that moves by itself may also have an attribute `restless`: while it is true the panel
    is rendered at its rate although nothing changed. One that shows what somebody at the page has
    just done has an attribute `prompt`: it is rendered at once, before all others.
    """

    rate_hz: float
    """At most this many renderings a second: map 30, images 10 to 15, text and plots 5."""

    def build(self, server: viser.ViserServer, post: Post) -> None:
        """Add the widgets, to `server.gui`, inside the context of the panel's tab. Called once."""
        ...

    def render(self, p: Published) -> None:
        """Draw all of `p`; called when the session or the page changed, never twice at a time.

        `p.trace` is None before the first frame. When `p.run` differs from the last call another
        scenario was loaded or the run was reset: whatever was cached from before is void. An
        exception is reported on the page and does not stop the other panels.
        """
        ...


View = Literal["perspective", "top", "side", "follow", "eye", "orbit"]


@dataclass(frozen=True)
class Look:
    """How everything is drawn; the View tab edits it."""

    confidence: float = 0.95
    """Probability content of ellipsoids and ellipses of the map."""
    colour: Literal["verdict", "correlation"] = "verdict"
    """Features by their verdict, or by their correlation with the selected one."""
    truth: bool = True
    room: bool = True
    trajectories: bool = True
    rays: bool = True
    labels: bool = True
    """Labels of features near the robot; the selected one always has one."""
    follow: str = ""
    """The body of a robot that is followed; the first one unless it is there."""
    placing: str = ""
    """The robot whose waypoints a click on the ground adds; none when empty."""
    dark: bool = True
    large: bool = False
    """Large type, for projectors."""


class Views(Protocol):
    """Moves the 3-D cameras of browsers; the map provides it, the View tab asks for it."""

    def ask(self, client: viser.ClientHandle, view: View) -> None:
        """This browser wants another view; asking again for one that moves stops it."""
        ...


@dataclass
class Page:
    """Shared by all panels: one immutable `look`, replaced as a whole from any thread."""

    look: Look = field(default_factory=Look)
    views: Views | None = None
    problems: Mapping[int, str] = field(default_factory=dict)
    """Panels that could not be drawn, and why; the view loop keeps it, the head shows it."""
    between: Callable[[], None] = lambda: None
    """For panels that take long: called between the steps of a rendering, outside `atomic`, it
    lets the prompt panels answer first."""

    def change(self, **fields: object) -> None:
        """Replace fields of the look; everything is drawn again."""
        self.look = dataclasses.replace(self.look, **fields)  # type: ignore[arg-type]
