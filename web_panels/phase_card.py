"""One phase of a frame: the one that was just stepped to, or one that somebody looks at again."""

from __future__ import annotations

import viser

from scene_core.filter.records import PhaseRecord, Trace
from scene_core.session.published import Published
from web_panels.panel import Page, Post
from web_panels.phase_bodies import BODIES
from web_panels.style import PHASES, block, escape

LAST: str = "–"
"""What the choice of a phase says while none is chosen."""


class PhaseCard:
    """Below the transport; empty unless somebody steps by phase."""

    rate_hz = 10.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self._stepped: tuple[int, int] | None = None
        self._chosen: tuple[tuple[int, int], str] | None = None
        """A phase of a finished frame that somebody wants to see again: run and frame, its name."""

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.choice = server.gui.add_dropdown(
            "Look at",
            [LAST],
            visible=False,
            hint="A phase of this frame, with its numbers. Only looks: the run stays where it is.",
        )
        self.html = server.gui.add_html("")

        async def chosen(event: viser.GuiEvent) -> None:
            if event.client_id is not None and self._here is not None:
                self._chosen = (self._here, event.target.value)
                self.page.change()

        self._here: tuple[int, int] | None = None
        self.choice.on_update(chosen)

    def _offer(self, p: Published) -> None:
        """The phases of a finished frame; nothing while frames go by or are stepped through."""
        trace = p.trace
        done = trace is not None and trace.complete and p.mode != "playing"
        if trace is not None and done:
            self._here = (p.run, trace.frame.index)
            names = (LAST, *phase_names(trace))
            if self.choice.options != names:
                self.choice.options = names
            wanted = LAST
            if self._chosen is not None and self._chosen[0] == self._here:
                wanted = self._chosen[1] if self._chosen[1] in names else LAST
            if self.choice.value != wanted:
                self.choice.value = wanted
        if self.choice.visible != done:
            self.choice.visible = done

    def render(self, p: Published) -> None:
        self._offer(p)
        content = self._content(p)
        if content != self.html.content:
            self.html.content = content

    def _content(self, p: Published) -> str:
        trace = p.trace
        if trace is None or p.mode == "playing" or not trace.records:
            return ""
        here = (p.run, trace.frame.index)
        if not trace.complete:
            self._stepped = here
        if trace.complete and self._chosen is not None and self._chosen[0] == here:
            names = phase_names(trace)
            if self._chosen[1] in names:
                return card_html(trace, names.index(self._chosen[1]))
        if self._stepped != here:
            return ""
        return card_html(trace)


def phase_names(trace: Trace) -> list[str]:
    """Every phase of a frame, numbered, with the sensor it was for."""
    return [
        f"{i} {PHASES[r.phase][0]}{f' · {r.mount}' if r.mount else ''}"
        for i, r in enumerate(trace.records, 1)
    ]


def card_html(trace: Trace, index: int = -1) -> str:
    """A phase of a frame; the last one that was done, unless another is asked for."""
    at = range(len(trace.records))[index]
    record = trace.records[at]
    before = trace.records[at - 1].world if at else trace.start
    title, colour = PHASES[record.phase]
    by = f" · {escape(record.mount)}" if record.mount else ""
    body = BODIES[record.phase](record, before, trace)
    return block(
        "<style>.e .pc td+td,.e .pc th+th{padding-left:9px}</style>"
        f'<div class="card" style="border-left:3px solid {colour};margin-top:8px">'
        f"{_steps(record)}"
        f'<div class="row"><b>{title}{by}</b><span class="d">{record.ms:.2f} ms</span></div>'
        f"{body}</div>"
    )


def _steps(record: PhaseRecord) -> str:
    """All phases as a row of bars, those of this round up to this one in colour."""
    now = list(PHASES).index(record.phase)
    bars = "".join(
        f'<span title="{escape(title)}" style="flex:1;height:4px;border-radius:2px;'
        f'background:{colour};opacity:{1 if k == now else 0.45 if k < now else 0.12}"></span>'
        for k, (title, colour) in enumerate(PHASES.values())
    )
    return f'<div style="display:flex;gap:3px;margin-bottom:5px">{bars}</div>'
