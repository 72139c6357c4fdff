"""The Estimator and Truth tabs: every parameter of the experiment, what was changed, undo."""

from __future__ import annotations

import operator
from collections import defaultdict
from typing import Any

import viser

from scene_core import params
from scene_core.params import Spec, rows_text
from scene_core.session.commands import Redo, ResetParams, SetParam, Undo
from scene_core.session.config import Experiment
from scene_core.session.published import Published
from scene_core.session.toml_io import dumps
from web_panels import style
from web_panels.panel import Page, Post
from web_panels.style import escape, number, shown
from web_panels.widgets import Field, Group, on_press

MAX_CHANGES = 12


def folder_title(path: str) -> str:
    """estimator.robots.cam.motion.sd_accel is in "Cam motion"."""
    words = [w for w in path.split(".")[:-1] if w not in ("robots", "mounts", "policies")]
    return " ".join(words[1:]).replace("_", " ").capitalize() or "General"


def by_folder(specs: list[Spec]) -> dict[str, list[Spec]]:
    """Specs under the titles of their folders, in order."""
    out: dict[str, list[Spec]] = defaultdict(list)
    for spec in specs:
        out[folder_title(spec.path)].append(spec)
    return out


def written(value: Any, spec: Spec) -> str:
    """A value as the page writes it, with its unit; – for an entry that is not there."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, (int, float)):
        v, unit = shown(float(value), spec.unit)
        text = str(value) if isinstance(value, int) else number(v, 4)
        return f"{text}{'' if unit.startswith('°') else ' '}{unit}".strip()
    if isinstance(value, tuple):
        scale, unit = shown(1.0, spec.unit)
        if spec.rows:
            return f"{rows_text(value, scale) or 'none'} {unit}".strip()
        return f"({', '.join(number(v * scale, 4) for v in value)}) {unit}".strip()
    return str(value)


def changes(now: Experiment, base: Experiment) -> list[tuple[Spec, str, str]]:
    """What differs from the scenario: the parameter, its value there, its value now."""
    return [
        (spec, "–" if old is None else written(old.value, old), written(spec.value, spec))
        for spec, old in params.changed(now, base)
    ]


def changes_card(now: Experiment, base: Experiment) -> str:
    """Changed from the scenario, as a table."""
    rows = changes(now, base)
    if not rows:
        return '<div class="card"><span class="d">As the scenario has it.</span></div>'
    lines = "".join(
        f'<tr title="{escape(spec.path)}"><td>{escape(spec.label)}</td>'
        f'<td class="d">{escape(was)}</td><td><b>{escape(is_now)}</b></td></tr>'
        for spec, was, is_now in rows[:MAX_CHANGES]
    )
    more = len(rows) - MAX_CHANGES
    rest = f'<div class="d">and {more} more</div>' if more > 0 else ""
    noun = "field" if len(rows) == 1 else "fields"
    return (
        '<div class="card"><div class="row"><span class="h">Changed from the scenario</span>'
        f'<span class="d">{len(rows)} {noun}</span></div><table>{lines}</table>{rest}</div>'
    )


class _Parameters:
    """Inputs for one branch of the experiment, rebuilt when its parameters are others."""

    rate_hz = 30.0
    prompt = True
    branch: str
    empty: str

    def __init__(self, page: Page) -> None:
        self.page = page
        self.group = Group()
        self.fields: dict[str, Field] = {}
        self.box: viser.GuiFolderHandle | None = None
        self.shape: object = None
        self.drawn: tuple[object, ...] = ()

    def build(self, server: viser.ViserServer, post: Post) -> None:
        gui = self.gui = server.gui
        self.post = post
        self.place = gui.add_folder(None)
        self.note = gui.add_html("")
        self.card = gui.add_html("")
        self.undo = gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP, color="gray")
        self.redo = gui.add_button("Redo", icon=viser.Icon.ARROW_FORWARD_UP, color="gray")
        self.reset = gui.add_button("Reset to scenario", icon=viser.Icon.RESTORE, color="gray")
        save = gui.add_button("Save settings", icon=viser.Icon.DOWNLOAD, color="gray")
        on_press(self.undo, lambda _: post(Undo()))
        on_press(self.redo, lambda _: post(Redo()))
        on_press(self.reset, lambda _: post(ResetParams()))
        on_press(save, self._save)

    def _save(self, client: viser.ClientHandle) -> None:
        p = self.latest
        now = p.pending or p.experiment
        content = dumps(now, p.base).encode()
        client.send_file_download(f"{now.name}.toml", content, save_immediately=True)

    def _rebuild(self, specs: list[Spec]) -> None:
        if self.box is not None:
            self.box.remove()
        self.group.forget()
        self.fields = {}
        with self.place:
            self.box = self.gui.add_folder(None)
        for title, members in by_folder(specs).items():
            with self.box, self.gui.add_folder(title):
                for spec in members:
                    send = self._sender(spec.path)
                    self.fields[spec.path] = Field(self.gui, self.group, spec, send)
        text = (
            "Hover a name for its help and when it takes effect." if specs else escape(self.empty)
        )
        self.note.content = style.block(f'<span class="d">{text}</span>', "padding:6px 10px")

    def _sender(self, path: str) -> Any:
        return lambda value: self.post(SetParam(path, value))

    def render(self, p: Published) -> None:
        self.latest = p
        now = p.pending or p.experiment
        state = (p.run, now, p.base, p.can_undo, p.can_redo)
        if len(self.drawn) == len(state) and all(map(operator.is_, state, self.drawn)):
            return
        specs = params.schema(getattr(now, self.branch), self.branch)
        shape = (p.run, [(s.path, s.choices, type(s.value)) for s in specs])
        if shape != self.shape:
            self._rebuild(specs)
            self.shape = shape
        self.card.content = style.block(changes_card(now, p.base), "padding-bottom:8px")
        for spec in specs:
            self.fields[spec.path].show(spec.value)
        self.undo.disabled = not p.can_undo
        self.redo.disabled = not p.can_redo
        self.reset.disabled = not changes(now, p.base)
        self.drawn = state


class EstimatorParameters(_Parameters):
    """What the filter believes."""

    branch = "estimator"
    empty = "This estimator has no parameters."


class TruthParameters(_Parameters):
    """What the simulator does."""

    branch = "source"
    empty = "A recording: nothing to edit."
