"""What happened, newest first."""

from __future__ import annotations

import viser

from scene_core.filter.records import Event
from scene_core.session.published import Published
from web_panels.panel import Page, Post
from web_panels.style import EVENT_COLOUR, HEX, block, escape

ROWS = 60
"""As many as anybody scrolls through."""


def events_html(events: tuple[Event, ...]) -> str:
    """A table with a coloured dot for the kind of each event."""
    if not events:
        return block(
            '<span class="d">Nothing yet. Features that are born, converted, deleted or rejected '
            "are listed here; press <kbd>Space</kbd> to play.</span>",
            "padding-top:6px",
        )
    rows = "".join(
        f'<tr><td class="d" style="width:56px">{e.frame}</td><td style="text-align:left">'
        f'<span style="color:{HEX[EVENT_COLOUR[e.kind]]}" title="{e.kind}">●</span>&nbsp; '
        f"{escape(e.text)}</td></tr>"
        for e in events[:ROWS]
    )
    head = '<tr><th>frame</th><th style="text-align:left">event</th></tr>'
    return block(f"<table>{head}{rows}</table>")


class Events:
    """The Events tab."""

    rate_hz = 4.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self._shown: tuple[Event, ...] | None = None

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.html = server.gui.add_html(events_html(()))

    def render(self, p: Published) -> None:
        if p.events != self._shown:
            self._shown = p.events
            self.html.content = events_html(p.events)
