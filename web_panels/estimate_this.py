"""Ticks that put a calibration or a sensor's pose into the state, and what came of it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import viser

from scene_core.filter.world import World
from scene_core.session.commands import SetParam
from scene_core.session.config import EstimatorSettings
from scene_core.session.estimated import Estimable, estimables, nominal
from web_panels import style
from web_panels.panel import Post
from web_panels.style import escape, number, shown
from web_panels.widgets import Bound, Group, rounded

FIRST_SD: Mapping[str, float] = {"m": 0.05, "rad": math.radians(1.0), "px": 10.0}
"""Offered for the standard deviation by unit, when the scenario does not say more; else 0.1."""


def offered(e: Estimable, label: str, base: EstimatorSettings) -> float:
    """A standard deviation to begin with: the scenario's own where it has one."""
    own = {x.block: x.sds for x in estimables(base)}.get(e.block, {})
    return own.get(label, FIRST_SD.get(e.units[e.labels.index(label)], 0.1))


def fine_step(value: float) -> float:
    """A power of ten, at most a hundredth of a value: the input shows as many digits."""
    return 10.0 ** math.floor(math.log10(value) - 2) if value > 0 else 0.001


def title_of(e: Estimable) -> str:
    """Estimate calibration of nomad; Estimate pose of camera."""
    what = "calibration" if e.space is None else "pose"
    return f"Estimate {what} of {e.owner}"


def now_html(world: World, e: Estimable) -> str:
    """Every component: its value, and its standard deviation when it is estimated."""
    x0 = nominal(world, e.block)
    here = e.block in world.gauss.layout
    x = world.gauss.mean(e.block) if here else x0
    T = e.tangent(x)
    P = T @ world.gauss.cov(e.block) @ T.T if here else np.zeros((len(e.labels),) * 2)
    # A turn has no value of its own: how far the pose was turned away from the settings' one.
    values = x if e.space is None else _pose_values(e, x, x0)
    rows = "".join(
        _row(label, unit, float(values[i]), float(np.sqrt(max(P[i, i], 0.0))))
        for i, (label, unit) in enumerate(zip(e.labels, e.units, strict=True))
    )
    return style.block(f"<table>{rows}</table>", "padding:2px 10px 6px")


def _pose_values(e: Estimable, x: np.ndarray, x0: np.ndarray) -> np.ndarray:
    assert e.space is not None
    away = e.space.difference(x, x0)
    known = dict(zip(e.space.labels, x, strict=True))
    return np.array([known.get(label, away[i]) for i, label in enumerate(e.labels)])


def _row(label: str, unit: str, value: float, sd: float) -> str:
    v, u = shown(value, unit)
    s, _ = shown(sd, unit)
    spread = f"<b>{number(v, 4)}</b> ± {number(s, 2)}" if sd > 0 else number(v, 4)
    note = escape(u) if sd > 0 else f"{escape(u)} · known"
    return f'<tr><td>{escape(label)}</td><td>{spread} <span class="d">{note}</span></td></tr>'


class EstimateThis:
    """The folder of one calibration or pose: a tick and a standard deviation a component."""

    def __init__(
        self, gui: viser.GuiApi, group: Group, e: Estimable, base: EstimatorSettings, post: Post
    ) -> None:
        self.path = e.path
        self.sd = {label: e.sds.get(label, offered(e, label, base)) for label in e.labels}
        """In force, or to begin with when it is ticked (SI)."""
        self.ticked = {label: label in e.sds for label in e.labels}
        self.inputs: dict[str, tuple[Bound, Bound, float]] = {}
        with gui.add_folder(title_of(e), expand_by_default=bool(e.sds)):
            self.html = gui.add_html("")
            for label, unit in zip(e.labels, e.units, strict=True):
                self._add(gui, group, label, unit, post)

    def _add(self, gui: viser.GuiApi, group: Group, label: str, unit: str, post: Post) -> None:
        scale, u = shown(1.0, unit)
        path = f"{self.path}.{label}"
        tick = gui.add_checkbox(
            f"Estimate {label}",
            self.ticked[label],
            hint="Put it into the state, with the standard deviation below; unticked it is as the "
            "settings say again. Takes effect: next frame.",
        )
        sd = gui.add_number(
            f"{label} ±{' ' + u if u else ''}",
            rounded(self.sd[label] * scale),
            min=0.0,
            step=fine_step(self.sd[label] * scale),
            hint="Initial standard deviation; editing it while ticked starts the component anew. "
            "Takes effect: next frame.",
        )

        def ticked(value: bool) -> None:
            post(SetParam(path, self.sd[label] if value else None))

        def edited(value: float) -> None:
            self.sd[label] = float(value) / scale
            if self.ticked[label]:
                post(SetParam(path, self.sd[label]))
            else:
                self.inputs[label][1].show(value)

        self.inputs[label] = Bound(tick, group, ticked), Bound(sd, group, edited), scale

    def show(self, e: Estimable) -> None:
        """What is in force."""
        for label, (tick, sd, scale) in self.inputs.items():
            self.ticked[label] = label in e.sds
            self.sd[label] = e.sds.get(label, self.sd[label])
            tick.show(self.ticked[label])
            sd.show(rounded(self.sd[label] * scale))

    def live(self, world: World, e: Estimable) -> None:
        """The values of the frame that is shown."""
        html = now_html(world, e)
        if html != self.html.content:
            self.html.content = html
