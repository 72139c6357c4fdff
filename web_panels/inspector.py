"""The inspector: everything the filter thought about one feature in one frame."""

from __future__ import annotations

import base64
import time
from typing import Any

import cv2
import numpy as np
import viser

from scene_core.arrays import Vec
from scene_core.filter.ports import Image, Match
from scene_core.filter.records import Association, Predictions, Trace
from scene_core.filter.world import Feature, World
from scene_core.models.base import Sensor
from scene_core.session.published import Published
from web_panels.delete_feature import DeleteSelected
from web_panels.inspector_maths import equation, jacobian, state_table
from web_panels.inspector_more import line_rows, particles_card, row
from web_panels.marks import matches, verdicts
from web_panels.panel import Page, Post
from web_panels.story import Story, interesting, place, story
from web_panels.style import HEX, block, escape, number, quantity, shown

STAY_S = 2.5
"""While playing, a feature that nobody selected is shown at least this long."""
PATCH_PX = 58
DASHED = {"rejected": "dashed"}
NOTHING = block("Nothing to inspect yet: press <kbd>Space</kbd>.")


class Inspector:
    """The Inspector tab."""

    rate_hz = 5.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self._key: tuple | None = None
        self._trace: Trace | None = None
        """The one that is shown: as long as it is kept, no other has its id."""
        self._auto: int | None = None
        self._since = 0.0
        self._run = -1

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.html = server.gui.add_html(NOTHING)
        self.delete = DeleteSelected(server.gui, post)

    def render(self, p: Published) -> None:
        self.delete.render(p)
        trace = p.trace
        if trace is None:
            self._key = self._trace = None
            if self.html.content != NOTHING:
                self.html.content = NOTHING
            return
        if p.mode == "playing" and not trace.complete:
            return
        label = self._label(p, trace)
        key = (p.run, id(trace), label, p.selected)
        if key != self._key:
            self._key, self._trace = key, trace
            self.html.content = inspector_html(trace, label, own_choice=p.selected is None)

    def _label(self, p: Published, trace: Trace) -> int | None:
        """The selected feature, else the most interesting one, which stays for a while."""
        if p.selected is not None:
            return p.selected
        now = time.monotonic()
        stale = p.mode != "playing" or now - self._since > STAY_S or p.run != self._run
        if stale or self._auto not in trace.world.features:
            self._auto, self._since, self._run = interesting(trace), now, p.run
        return self._auto


def inspector_html(trace: Trace, label: int | None, own_choice: bool) -> str:
    """All about a feature, one section for every mount that could see it."""
    if label is None:
        return block(
            '<span class="d">The map is empty. Features appear when the estimator starts them, or '
            "where you click in a sensor's picture while paused.</span>",
            "padding-top:6px",
        )
    feature = trace.world.features.get(label) or trace.start.features.get(label)
    seeing = [m for m in trace.world.mounts if _prediction(trace, m, label) is not None]
    mounts = seeing or [feature.mount if feature is not None else next(iter(trace.world.mounts))]
    note = (
        '<div class="d" style="margin:-1px 0 2px">Picked because nothing is selected: '
        "click a feature to choose it.</div>"
        if own_choice
        else ""
    )
    sections = "".join(
        _section(trace, m, label, feature, note if i == 0 else "", len(mounts) > 1)
        for i, m in enumerate(mounts)
    )
    state = "" if label not in trace.world.features else state_table(trace.world, label)
    return block(sections + state, "padding-bottom:8px")


def _prediction(trace: Trace, mount: str, label: int) -> Predictions | None:
    return next((p for p in trace.predictions(mount) if label in p.row), None)


def _section(
    trace: Trace, mount: str, label: int, feature: Feature | None, note: str, named: bool
) -> str:
    told = story(trace, mount, label)
    by = f" · {escape(mount)}" if named else ""
    head = (
        '<div class="row" style="align-items:baseline"><span>'
        f'<b style="font-size:15px">Feature {label}</b>'
        f'<span class="d">&nbsp; {_kind(feature)}{by}</span></span>{_chip(told)}</div>{note}'
        f'<div style="margin:4px 0 7px">{told.text}</div>'
    )
    p = _prediction(trace, mount, label)
    if p is None:
        return head
    sensor = trace.world.mounts[mount].sensor
    a, match = verdicts(trace, mount).get(label), matches(trace, mount).get(label)
    if p.shape == "segment":
        rows = line_rows(trace.world, p, p.row[label], a, match)
    else:
        rows = _rows(sensor, p, p.row[label], a, match)
    if feature is not None:
        rows += _depth(trace.world if label in trace.world.features else trace.start, feature)
    patches = _patches(trace, mount, feature, match, told)
    return (
        f'{head}<div style="display:flex;gap:12px;align-items:flex-start">'
        f'<table style="flex:1">{rows}</table>{patches}</div>'
        f"{equation(a, told, sensor, p)}"
        f"{'' if feature is None else particles_card(feature)}"
        f"{jacobian(trace.world, p, p.row[label], feature, sensor)}"
    )


def _kind(feature: Feature | None) -> str:
    if feature is None:
        return "not in the map"
    known = "known · " if feature.known else ""
    return f"{escape(feature.model.name)} · {known}matched {feature.matches} of {feature.attempts}"


def _chip(told: Story) -> str:
    c = HEX[told.state]
    line = DASHED.get(told.state, "solid")
    return f'<span class="chip" style="color:{c};border:1px {line} {c}">{escape(told.chip)}</span>'


def _rows(
    sensor: Sensor, p: Predictions, i: int, a: Association | None, match: Match | None
) -> str:
    h, S = (p.h[i], p.E[i] + p.R[i]) if a is None else (a.h, a.S)
    out = row("h", "predicted", place(sensor, h))
    if match is not None and match.z is not None:
        out += row("z", "matched", place(sensor, match.z))
    if a is not None and a.nu is not None:
        out += row("&nu;", "innovation z &minus; h", place(sensor, a.nu, plus=True))
    if len(set(sensor.units)) == 1:
        axes = np.sqrt(np.maximum(np.linalg.eigvalsh(S)[::-1], 0.0))
        scale, unit = shown(1.0, sensor.units[0])
        text = ", ".join(number(scale * v) for v in axes) + f" {escape(unit)}"
        out += row("S", "1-sigma axes" if len(axes) > 1 else "1 sigma", text)
    else:
        sd = np.sqrt(np.diag(S))
        text = ", ".join(
            f"{escape(name)} {quantity(float(v), u)}"
            for name, v, u in zip(sensor.labels, sd, sensor.units, strict=True)
        )
        out += row("S", "1 sigma", text)
    return out


def _depth(world: World, feature: Feature) -> str:
    """Distance from the place of the first view, for a parametrisation by its inverse."""
    model = feature.model
    out = ""
    if feature.carrier or model.shape == "segment":
        return out
    for name in model.unmeasured:
        i = model.state_labels.index(name) if name in model.state_labels else -1
        if i < 0 or model.state_units[i] != "1/m":
            continue
        rho = float(world.gauss.mean(feature.block)[i])
        sd = float(np.sqrt(max(world.gauss.cov(feature.block)[i, i], 0.0)))
        if rho > 2.0 * sd:
            text = f"{1.0 / rho:.2f} ± {sd / rho**2:.2f} m"
        else:
            text = f"beyond {1.0 / (rho + 2.0 * sd):.2f} m (2 sigma)"
        out += row("&rho;", "depth, 1 sigma", text)
    return out


def _png(patch: np.ndarray) -> str:
    done, data = cv2.imencode(".png", patch)
    assert done
    return "data:image/png;base64," + base64.b64encode(data.tobytes()).decode()


def _picture(patch: np.ndarray, words: str, colour: str) -> str:
    return (
        f'<div style="text-align:center;line-height:1.25"><img alt="" src="{_png(patch)}" '
        f'width="{PATCH_PX}" height="{PATCH_PX}" style="display:block;border:1.5px solid {colour};'
        f'border-radius:3px;image-rendering:pixelated"><span class="d" '
        f'style="font-size:10px">{words}</span></div>'
    )


def _patches(
    trace: Trace, mount: str, feature: Feature | None, match: Match | None, told: Story
) -> str:
    template: Any = getattr(getattr(feature, "appearance", None), "template", None)
    raw = trace.frame.raw.get(mount)
    if not isinstance(template, np.ndarray) or not isinstance(raw, Image):
        return ""
    out = _picture(template, "template", "var(--frame)")
    if match is not None and match.z is not None:
        hit = cut(raw.pixels, match.z, len(template))
        out += _picture(hit, f"NCC {match.score:.2f}", HEX[told.state])
    return out


def cut(pixels: np.ndarray, z: Vec, side: int) -> np.ndarray:
    """The square (side, side) about z, its border repeated where it leaves the image."""
    r = side // 2
    height, width = pixels.shape
    u, v = round(float(z[0])), round(float(z[1]))
    rows = np.clip(np.arange(v - r, v + r + 1), 0, height - 1)
    columns = np.clip(np.arange(u - r, u + r + 1), 0, width - 1)
    return pixels[rows[:, None], columns]
