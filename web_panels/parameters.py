"""The Estimator and Truth tabs: every parameter of the experiment, what was changed, undo."""

from __future__ import annotations

import operator
import time
from collections import defaultdict
from typing import Any

import viser

from scene_core import params
from scene_core.params import Spec, rows_text
from scene_core.session.commands import Redo, ResetParams, SetParam, Undo
from scene_core.session.config import Experiment
from scene_core.session.estimated import Estimable, estimables
from scene_core.session.published import Published
from scene_core.session.toml_io import dumps
from web_panels import style
from web_panels.estimate_this import EstimateThis
from web_panels.limits import Limit, partners
from web_panels.panel import Page, Post
from web_panels.style import escape, number, shown
from web_panels.widgets import Drag, Field, Group, on_command, on_press

MAX_CHANGES = 12
LIVE_S = 0.2
"""Between two readings of what changes with every frame."""
UNDO_HELP = (
    "Ctrl+Z: take back what was done last. An edit or a swap ends with this frame; a feature that "
    "was deleted or started by hand, and moved axes, are as if it had never been done."
)
REDO_HELP = "Ctrl+Shift+Z: do again what was undone last."


def folder_title(path: str) -> str:
    """estimator.robots.cam.motion.sd_accel is in "Cam motion"."""
    words = [w for w in path.split(".")[:-1] if w not in ("robots", "mounts", "policies")]
    return " ".join(words[1:]).replace("_", " ").capitalize() or "General"


def owner_of(path: str) -> str:
    """estimator.robots.cam of estimator.robots.cam.motion.sd_accel."""
    return ".".join(path.split(".")[:3])


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
        self.shape: tuple[Any, ...] | None = None
        self.drawn: tuple[object, ...] = ()

    def build(self, server: viser.ViserServer, post: Post) -> None:
        gui = self.gui = server.gui
        self.post = post
        self.place = gui.add_folder(None)
        self.note = gui.add_html("")
        self.card = gui.add_html("")
        undo, redo = viser.Icon.ARROW_BACK_UP, viser.Icon.ARROW_FORWARD_UP
        self.undo = gui.add_button("Undo", icon=undo, color="gray", hint=UNDO_HELP)
        self.redo = gui.add_button("Redo", icon=redo, color="gray", hint=REDO_HELP)
        self.reset = gui.add_button("Reset to scenario", icon=viser.Icon.RESTORE, color="gray")
        save = gui.add_button("Save settings", icon=viser.Icon.DOWNLOAD, color="gray")
        on_press(self.undo, lambda _: post(Undo()))
        on_press(self.redo, lambda _: post(Redo()))
        on_press(self.reset, lambda _: post(ResetParams()))
        on_press(save, self._save)
        self._add_keys()

    def _add_keys(self) -> None:
        """Hotkeys; one tab adds them for all."""

    def _save(self, client: viser.ClientHandle) -> None:
        p = self.latest
        now = p.pending or p.experiment
        content = dumps(now, p.base).encode()
        client.send_file_download(f"{now.name}.toml", content, save_immediately=True)

    def _rebuild(self, p: Published, specs: list[Spec]) -> None:
        self.group.remove(self.box)
        self.fields = {}
        with self.place:
            self.box = self.gui.add_folder(None)
        folders, beside = by_folder(specs), partners(specs)
        last = {owner_of(members[0].path): title for title, members in folders.items()}
        for title, members in folders.items():
            with self.box, self.gui.add_folder(title):
                for spec in members:
                    send = self._sender(spec, beside.get(spec.path))
                    self.fields[spec.path] = Field(self.gui, self.group, spec, send)
            owner = owner_of(members[0].path)
            if last[owner] == title:
                with self.box:
                    self._add_more(p, owner)
        with self.box:
            self._add_more(p, "")
        text = (
            "Hover a name for its help and when it takes effect." if specs else escape(self.empty)
        )
        self.note.content = style.block(f'<span class="d">{text}</span>', "padding:6px 10px")

    def _sender(self, spec: Spec, other: Spec | None) -> Any:
        if other is None:
            drag = Drag(spec.path)
            return lambda value: self.post(SetParam(spec.path, value, drag.name()))
        limit = Limit(spec, other)

        def send(value: Any) -> None:
            now = self.latest.pending or self.latest.experiment
            self.post(limit.edit(value, params.get(now, other.path)))

        return send

    def _more(self, p: Published) -> tuple[Estimable, ...]:
        """What there is besides parameters."""
        return ()

    def _add_more(self, p: Published, owner: str) -> None:
        """Inputs besides the parameters of an owner; "": of all whose turn did not come."""

    def _show_more(self, p: Published) -> None:
        """What is in force of them."""

    def live(self, p: Published) -> None:
        """What changes with every frame."""

    def render(self, p: Published) -> None:
        self.latest = p
        self.live(p)
        now = p.pending or p.experiment
        state = (p.run, now, p.base, p.can_undo, p.can_redo)
        if len(self.drawn) == len(state) and all(map(operator.is_, state, self.drawn)):
            return
        specs = params.schema(getattr(now, self.branch), self.branch)
        more = [(e.path, e.labels) for e in self._more(p)]
        shape = (p.run, [(s.path, s.choices, type(s.value)) for s in specs], more)
        if shape != self.shape:
            self._rebuild(p, specs)
            self.shape = shape
        self.card.content = style.block(changes_card(now, p.base), "padding-bottom:8px")
        for spec in specs:
            self.fields[spec.path].show(spec.value)
        self._show_more(p)
        self.undo.disabled = not p.can_undo
        self.redo.disabled = not p.can_redo
        self.reset.disabled = not changes(now, p.base)
        self.drawn = state


class EstimatorParameters(_Parameters):
    """What the filter believes."""

    branch = "estimator"
    empty = "This estimator has no parameters."

    def __init__(self, page: Page) -> None:
        super().__init__(page)
        self.ticks: dict[str, EstimateThis] = {}
        self._lived = 0.0

    def _add_keys(self) -> None:
        add = self.gui.add_command
        undo = add("Undo", description=UNDO_HELP, hotkey="Z", modifier="cmd/ctrl")
        redo = add("Redo", description=REDO_HELP, hotkey="Z", modifier="cmd/ctrl+shift")
        on_command(undo, lambda _: self.post(Undo()))
        on_command(redo, lambda _: self.post(Redo()))

    def _more(self, p: Published) -> tuple[Estimable, ...]:
        return estimables((p.pending or p.experiment).estimator)

    def _rebuild(self, p: Published, specs: list[Spec]) -> None:
        self.ticks = {}
        super()._rebuild(p, specs)

    def _add_more(self, p: Published, owner: str) -> None:
        for e in self._more(p):
            if e.path not in self.ticks and owner in ("", owner_of(e.path)):
                self.ticks[e.path] = EstimateThis(
                    self.gui, self.group, e, p.base.estimator, self.post
                )

    def _show_more(self, p: Published) -> None:
        for e in self._more(p):
            self.ticks[e.path].show(e)

    def live(self, p: Published) -> None:
        now = time.monotonic()
        if p.trace is None or now - self._lived < LIVE_S:
            return
        self._lived = now
        for e in estimables(p.experiment.estimator):
            if e.path in self.ticks and self.shape is not None and p.run == self.shape[0]:
                self.ticks[e.path].live(p.trace.world, e)


class TruthParameters(_Parameters):
    """What the simulator does."""

    branch = "source"
    empty = "A recording: nothing to edit."
