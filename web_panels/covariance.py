"""The correlation of the whole state as a picture with the names of its blocks.

A small state is shown number by number, a large one block by block: the largest canonical
correlation of every pair. Below it, what the selected landmark knows of all others.
"""

from __future__ import annotations

import numpy as np
import viser

from scene_core.arrays import Mat
from scene_core.filter.groups import rows_of
from scene_core.filter.world import Gaussian, World
from scene_core.geometry.correlation import largest_canonical_correlations
from scene_core.session.published import Published
from web_panels.correlation_picture import BLANK, picture
from web_panels.correlation_table import table_of
from web_panels.panel import Page, Post
from web_panels.style import HEX, block, escape

NOTHING = block("No state yet: press <kbd>Space</kbd>.")


def others_html(world: World, selected: int | None) -> str:
    """The largest canonical correlation of the selected landmark with each other one."""
    if selected is None or selected not in world.features:
        return block(
            '<span class="d">Select a landmark to read its largest canonical correlation with '
            "every other one: click it in a sensor's picture or in the map.</span>"
        )
    layout = world.gauss.layout
    labels = [k for k in world.features if k != selected]
    P, (mine, *rows) = rows_of(world, [selected, *labels])
    rho = largest_canonical_correlations(P, mine, rows)
    order = np.argsort(-rho, kind="stable")
    cells = "".join(_cell(labels[i], float(rho[i])) for i in order)
    robots = "".join(
        f'<tr><td>{escape(r.id)}</td><td class="d" style="text-align:left">robot</td>'
        f"<td>{_with(P, mine, layout[r.block].slice):.3f}</td></tr>"
        for r in world.robots.values()
    )
    return block(
        f'<div class="row" style="margin-top:6px"><span class="h">Landmark {selected} with</span>'
        '<span class="d">largest canonical correlation</span></div>'
        f"<table>{robots}</table>"
        '<div style="display:grid;grid-template-columns:repeat(auto-fill,minmax(76px,1fr));'
        f'gap:2px 10px;margin-top:4px">{cells}</div>'
    )


def _with(P: Mat, a: slice, b: slice) -> float:
    return float(largest_canonical_correlations(P, a, [b])[0])


def _cell(label: int, rho: float) -> str:
    return (
        f'<div class="row" style="gap:4px"><span class="d">{label}</span><span>'
        f'<svg width="26" height="7"><rect width="26" height="7" fill="var(--rule)"/>'
        f'<rect width="{26 * rho:.1f}" height="7" fill="{HEX["unselected"]}"/></svg> '
        f"{rho:.2f}</span></div>"
    )


class Covariance:
    """The Covariance tab."""

    rate_hz = 2.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self._shown: tuple[Gaussian | None, int | None] = (None, None)

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.head = server.gui.add_html(NOTHING)
        self.image = server.gui.add_image(BLANK, format="jpeg", jpeg_quality=88)
        self.others = server.gui.add_html("")

    def render(self, p: Published) -> None:
        if p.trace is None:
            if self._shown[0] is not None:
                self._shown = None, None
                self.image.image = BLANK
                self.head.content, self.others.content = NOTHING, ""
            return
        world = p.trace.world
        gauss, selected = self._shown
        if world.gauss is gauss and p.selected == selected:
            return
        self._shown = (world.gauss, p.selected)
        table = table_of(world, p.selected)
        self.page.between()
        canvas = picture(table, p.selected)
        self.page.between()
        self.image.image = canvas
        self.page.between()
        self.others.content = others_html(world, p.selected)
        head = block(
            '<div class="row" style="padding-bottom:4px;white-space:nowrap"><b>Correlation of the '
            f'state</b><span class="d">{table.what}</span></div>'
        )
        if head != self.head.content:
            self.head.content = head
