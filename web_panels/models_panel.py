"""The Models tab: the scenario, and one dropdown for every role a model plays."""

from __future__ import annotations

import viser

from scene_core.models.plugins import UserFile
from scene_core.session.commands import LoadPreset, SwapModel
from scene_core.session.published import Published, RoleOptions
from web_panels import style
from web_panels.model_reports import reports_html
from web_panels.panel import Page, Post
from web_panels.style import escape
from web_panels.widgets import Bound, Group

LONG = 44
"""Labels longer than a line are cut; the whole path is in the hint."""


class ModelsPanel:
    """Swapping keeps the state where that is meaningful and says what it did."""

    rate_hz = 10.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self.group = Group()
        self.shape: object = None
        self.bound: dict[str, Bound] = {}

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.gui, self.post = server.gui, post
        self.about = server.gui.add_html("")
        self.place = server.gui.add_folder(None)
        self.box: viser.GuiFolderHandle | None = None
        self.files: tuple[UserFile, ...] = ()
        self.reports = server.gui.add_html("")

    def _rebuild(self, p: Published) -> None:
        self.group.remove(self.box)
        self.bound.clear()
        with self.place:
            self.box = self.gui.add_folder(None)
        with self.box:
            options = tuple(dict.fromkeys((p.experiment.name, *p.presets)))
            scenario = self.gui.add_dropdown(
                "Scenario", options, initial_value=p.experiment.name, hint="Starts another run."
            )
            self.preset = Bound(scenario, self.group, lambda v: self.post(LoadPreset(v)))
            for role in p.roles:
                self.bound[role.role] = self._dropdown(role)
            self.note = self.gui.add_html("")

    def _dropdown(self, role: RoleOptions) -> Bound:
        options = tuple(dict.fromkeys((role.current, *role.options)))
        handle = self.gui.add_dropdown(
            role.title[:LONG],
            options,
            initial_value=role.current,
            disabled=len(options) < 2,
            hint=f"{role.role}. Takes effect with the next frame.",
        )
        return Bound(handle, self.group, lambda v: self.post(SwapModel(role.role, v)))

    def render(self, p: Published) -> None:
        shape = (p.run, p.presets, tuple((r.role, r.title, r.options) for r in p.roles))
        if shape != self.shape:
            self._rebuild(p)
            self.shape = shape
        about = p.experiment.about
        # After a start the head, which is above every tab, says what the scenario is about.
        is_said = bool(about) and p.message.startswith(about)
        rest = "" if is_said else f' &nbsp;<span class="d">{escape(about)}</span>'
        self.about.content = style.block(
            f"<b>{escape(p.experiment.name)}</b>{rest}", "padding:8px 10px 2px"
        )
        if p.files is not self.files:
            self.files = p.files
            self.reports.content = reports_html(p.files)
        self.preset.show(p.experiment.name)
        for role in p.roles:
            self.bound[role.role].show(role.current)
        text = "" if is_said else escape(p.message)
        text = text or '<span class="d">A swap says here what it kept.</span>'
        self.note.content = style.block(f'<div class="card">{text}</div>', "padding:6px 4px")
