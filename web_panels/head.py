"""The head of the controls: scenario, frame, phase, real time, consistency, events, failures."""

from __future__ import annotations

import viser

from scene_core.session.commands import Abandon
from scene_core.session.published import Light, Published
from web_panels import style
from web_panels.map_legend import legend_of
from web_panels.panel import Page, Post
from web_panels.style import HEX, PHASES, escape
from web_panels.tags import tags_html
from web_panels.widgets import on_press

LIGHTS = {
    "consistent": ("estimate", "consistent"),
    "overconfident": ("accepted", "overconfident"),
    "cautious": ("nomatch", "cautious"),
    "unknown": ("out", "nothing measured"),
}
"""Palette key and word of every state of the consistency light."""


def light(value: Light) -> str:
    """The lamp and its word; the numbers behind it are its tooltip."""
    key, word = LIGHTS[value.state]
    c = HEX[key]
    return (
        f'<span title="{escape(value.text)}" '
        'style="display:inline-flex;align-items:center;gap:6px">'
        f'<svg width="12" height="12"><circle cx="6" cy="6" r="6" fill="{c}" opacity=".25"/>'
        f'<circle cx="6" cy="6" r="3.8" fill="{c}"/></svg><b>{word}</b></span>'
    )


def _cell(title: str, value: str) -> str:
    return (
        f'<div style="white-space:nowrap"><div class="h">{title}</div>'
        f'<div style="font-size:15px;font-weight:600">{value}</div></div>'
    )


def phase_title(p: Published) -> str:
    """What was done last: the phase when stopped inside a frame, else the mode."""
    if p.trace is not None and not p.trace.complete and p.trace.records:
        return PHASES[p.trace.records[-1].phase][0]
    return {"playing": "Playing", "paused": "Paused", "finished": "Finished"}[p.mode]


def _card(p: Published) -> str:
    frame = "–" if p.trace is None else str(p.trace.frame.index)
    of = "" if p.frame_count is None else f" of {p.frame_count}"
    small = "color:var(--dim);font-weight:400;font-size:12px"
    rate = f"{p.real_time_factor:.2f} ×" if p.mode == "playing" else "–"
    return (
        '<div class="card"><div class="row">'
        + _cell("Frame", f'{frame}<span style="{small}">{of}</span>')
        + _cell("Phase", phase_title(p))
        + _cell("Real time", rate)
        + "</div></div>"
    )


def _last_event(p: Published) -> str:
    if p.events:
        event = p.events[0]
        dot = HEX[style.EVENT_COLOUR[event.kind]]
        words = escape(event.text)
        text = f'<span style="color:{dot}">●</span> <span title="{words}">{words}</span>'
    else:
        text = '<span class="d">nothing yet</span>'
    return (
        '<div class="row" style="margin-top:8px;justify-content:flex-start;gap:8px">'
        '<span class="h" style="white-space:nowrap">Last event</span>'
        '<span style="overflow:hidden;text-overflow:ellipsis;white-space:nowrap">'
        f"{text}</span></div>"
    )


def _banners(p: Published, page: Page) -> str:
    out = ""
    if p.failure is not None:
        details = f"<pre>{escape(p.failure.details)}</pre>" if p.failure.details else ""
        out += (
            f'<div class="bad" role="alert" style="margin-top:8px"><b>The run stopped.</b> '
            f"{escape(p.failure.text)}{details}</div>"
        )
    if p.busy is not None:
        out += (
            f'<div class="bad" role="alert" style="margin-top:8px"><b>{escape(p.busy.model)}</b>.'
            f"{escape(p.busy.method)} has not returned for {p.busy.seconds} s. Wait, or abandon "
            "it: the run goes back to its last good frame and to the model before it.</div>"
        )
    for text in page.problems.values():
        out += (
            f'<div class="bad" style="margin-top:8px">{escape(text)}. '
            "The run goes on; press Reset run if it stays.</div>"
        )
    if p.pending is not None:
        out += (
            '<div class="note" style="margin-top:8px">Edited: in force <b>from the next frame</b>. '
            "<kbd>N</kbd> steps, <kbd>R</kbd> redoes this one.</div>"
        )
    return out


def head_html(p: Published, page: Page) -> str:
    """The whole head as markup."""
    message = ""
    if p.message:
        text = escape(p.message)
        about = p.experiment.about
        # What a scenario is about is said nowhere else then: it is not cut.
        lines = " about" if about and p.message.startswith(about) else " two"
        message = f'<div class="d{lines}" title="{text}" style="margin-top:2px">{text}</div>'
    return style.block(
        '<div class="row" style="margin:2px 0 8px;white-space:nowrap">'
        '<span style="font-size:14px"><span class="d">preset</span> '
        f"<b>{escape(p.experiment.name)}</b></span>{light(p.light)}</div>"
        f"{_card(p)}{_last_event(p)}{message}{_banners(p, page)}",
        "padding-bottom:8px",
    )


class Head:
    """Always on top of the controls."""

    rate_hz = 10.0
    prompt = True

    def __init__(self, page: Page) -> None:
        self.page = page

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.sheet = server.gui.add_html(style.STYLE_SHEET)
        server.gui.add_html(tags_html())
        self.html = server.gui.add_html("")
        self.abandon = server.gui.add_button(
            "Abandon", color="red", visible=False, hint="Give up the call that does not return."
        )
        on_press(self.abandon, lambda _: post(Abandon()))
        self.legend = server.gui.add_html("")

    def render(self, p: Published) -> None:
        look = self.page.look
        self.sheet.content = style.STYLE_SHEET + (style.LARGE_TYPE if look.large else "")
        self.legend.content = legend_of(p, look)
        self.html.content = head_html(p, self.page)
        if self.abandon.visible != (p.busy is not None):
            self.abandon.visible = p.busy is not None
