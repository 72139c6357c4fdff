"""The inspector's formulas: d2 against its gate, the blocks of H, the state of the feature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scene_core.filter.groups import groups, moments
from scene_core.filter.records import Association, Predictions
from scene_core.filter.world import Feature, World
from scene_core.models import segments
from scene_core.models.base import Sensor
from web_panels import mathml as mm
from web_panels.story import Story
from web_panels.style import HEX, escape, gate_words, number, shown

CARD_PX, SYMBOLS_PX, COLUMN_PX, DIGIT_PX = 405.0, 236.0, 16.0, 8.0
"""What the card has room for; what d2's equation takes without its numbers, and what each column
of S and each digit take."""
ROW_CHARACTERS = 58
"""Of the numbers of a Jacobian that fit beside each other."""


def _spec(a: np.ndarray) -> str:
    """Enough places for the larger numbers of a matrix."""
    top = float(np.abs(a).max(initial=0.0))
    return ".1f" if top >= 10 else ".2f" if top >= 1 else ".4f" if top >= 1e-2 else ".1e"


def _short_spec(a: np.ndarray) -> str:
    """Three significant digits of the largest number at most."""
    top = float(np.abs(a).max(initial=0.0))
    for least, spec in ((99.95, ".0f"), (9.995, ".1f"), (0.9995, ".2f"), (0.09995, ".3f")):
        if top >= least:
            return spec
    return ".4f" if top >= 1e-2 else ".1e"


def _zoom(nu: np.ndarray, S: np.ndarray, d2: str) -> float:
    """What makes d2 = nu' S^-1 nu as wide as its card, if it is wider."""
    columns = [nu, nu, *S.T]
    specs = [_short_spec(nu)] * 2 + [_short_spec(S)] * len(S)
    widest = (max(len(format(v, f)) for v in c) for c, f in zip(columns, specs, strict=True))
    symbols = SYMBOLS_PX + COLUMN_PX * len(S)
    return min(1.0, CARD_PX / (symbols + DIGIT_PX * (len(d2) + sum(widest))))


def equation(a: Association | None, told: Story, sensor: Sensor, p: Predictions) -> str:
    """d2 = nu' S^-1 nu with its numbers, and the bar against the gate.

    Of particles it is the d2 of the nearest one, whose numbers nobody kept.
    """
    if a is None or a.nu is None or a.d2 is None or a.gate is None:
        return ""
    if p.particles is not None:
        note = '<div class="d" style="text-align:center">d2 of the nearest particle</div>'
        return (
            f'<div class="card" style="margin-top:8px">{note}{_gate(a, a.d2, a.gate, told)}</div>'
        )
    is_line = p.shape == "segment"
    if is_line:
        a = replace(a, nu=1e3 * a.nu, S=1e6 * a.S)
        assert a.nu is not None and a.d2 is not None and a.gate is not None
    nu, S = mm.symbol("\N{GREEK SMALL LETTER NU}", bold=True), mm.symbol("S", bold=True)
    d2 = f"{a.d2:.1f}"
    equation = mm.formula(
        mm.power(mm.symbol("d"), "<mn>2</mn>"),
        mm.op("="),
        mm.transposed(nu) + mm.inverse(S) + nu,
        mm.op("="),
        mm.transposed(mm.numbers(a.nu, _short_spec(a.nu))),
        mm.inverse(mm.numbers(a.S, _short_spec(a.S))),
        mm.numbers(a.nu, _short_spec(a.nu)),
        mm.op("="),
        mm.value(d2, HEX[told.state]),
    )
    zoom = _zoom(a.nu, a.S, d2)
    note = "in mrad" if is_line else "angles in rad here" if "rad" in sensor.units else ""
    units = f'<div class="d" style="font-size:10px">{note}</div>' if note else ""
    return (
        '<div class="card" style="margin-top:8px"><div style="text-align:center;padding:2px 0 4px;'
        f'overflow-x:auto"><span style="zoom:{zoom:.2f}">{equation}</span>{units}</div>'
        f"{_gate(a, a.d2, a.gate, told)}</div>"
    )


def _gate(a: Association, d2: float, gate: float, told: Story) -> str:
    """The bar against the gate, and the words of it."""
    first, _, rest = gate_words(d2, gate, a.dof, a.confidence).partition(" (")
    return (
        f"{gate_bar(d2, gate, HEX[told.state])}"
        f'<div style="text-align:center;margin-top:3px"><b>{first}</b> '
        f'<span class="d">({rest}</span></div>'
    )


def gate_bar(d2: float, gate: float, colour: str) -> str:
    """d2 on a scale from 0 past the gate."""
    end = max(1.7 * gate, min(1.15 * d2, 4.0 * gate))
    x, g = 420.0 * min(d2, end) / end, 420.0 * gate / end
    anchor = "start" if x < 40 else "end" if x > 380 else "middle"
    apart = abs(x - g) > 95
    d2_text = (
        f'<text x="{x:.0f}" y="30" text-anchor="{anchor}" fill="{colour}" font-weight="600">'
        f"d2 = {d2:.1f}</text>"
        if apart
        else ""
    )
    zero = '<text x="0" y="30">0</text>' if x > 75 or not apart else ""
    last = f'<text x="420" y="30" text-anchor="end">{end:.0f}</text>' if x < 340 else ""
    return (
        '<svg viewBox="0 0 420 34" width="100%" style="display:block;margin-top:4px">'
        '<rect x="0" y="5" width="420" height="9" rx="2" fill="var(--rule)"/>'
        f'<rect x="0" y="5" width="{g:.0f}" height="9" rx="2" fill="#40ce70" opacity=".3"/>'
        f'<rect x="0" y="7.5" width="{max(x, 2):.0f}" height="4" fill="{colour}"/>'
        f'<path d="M{g:.0f} 1V18" stroke="var(--ink)" stroke-width="1.5"/>'
        f'<g font-size="10.5" fill="var(--dim)">{zero}{last}'
        f'<text x="{g:.0f}" y="30" text-anchor="middle">gate {gate:.2f}</text>{d2_text}</g></svg>'
    )


def _columns(world: World, role: str, feature: Feature | None, sensor: Sensor) -> tuple[str, ...]:
    """Names of the columns of one block of H."""
    if role == "feature" and feature is not None and feature.carrier:
        role = feature.block
    if role == "feature":
        return feature.model.state_labels if feature is not None else ()
    for robot in world.robots.values():
        if role == robot.block:
            return robot.motion.state_labels
        if role == robot.calib_block:
            return robot.motion.calib_labels
    for mount in world.mounts.values():
        if role == mount.calib_block:
            return mount.sensor.calib_labels
        if role == mount.pose_block:
            return mount.sensor.space.labels
    return ()


def jacobian(world: World, p: Predictions, i: int, feature: Feature | None, sensor: Sensor) -> str:
    """The blocks of H, without the columns that are zero."""
    out = ""
    for role, blocks in p.H.items():
        H = np.atleast_2d(np.broadcast_to(blocks, (len(p.labels), *blocks.shape[-2:]))[i])
        names = _columns(world, role, feature, sensor)
        if len(names) != H.shape[1]:
            names = tuple(str(k + 1) for k in range(H.shape[1]))
        used = np.flatnonzero(np.abs(H).max(0) > 0.0)
        title = feature.block if role == "feature" and feature else role
        zero = [names[k] for k in range(H.shape[1]) if k not in used]
        measured = segments.LABELS if p.shape == "segment" else sensor.labels
        out += _block_table(title, measured, H[:, used], [names[k] for k in used], zero)
    return (
        '<div class="row" style="margin-top:10px"><span class="h">Blocks of H</span>'
        f'<span class="d">dh by dx, SI units</span></div>{out}'
    )


def _block_table(
    title: str, measured: tuple[str, ...], H: np.ndarray, names: list[str], zero: list[str]
) -> str:
    spec = _spec(H)
    cells = [[mm.signed(format(v, spec)) for v in row] for row in H]
    out = ""
    for columns in rows_of_columns([max(map(len, c)) for c in zip(names, *cells, strict=True)]):
        head = "".join(f"<th>{escape(n)}</th>" for n in names[columns])
        rows = "".join(
            f'<tr><td class="d">{escape(label)}</td>'
            + "".join(f"<td>{cell}</td>" for cell in row[columns])
            + "</tr>"
            for label, row in zip(measured, cells, strict=True)
        )
        out += f'<table class="m"><tr><th></th>{head}</tr>{rows}</table>'
    rest = f'<span class="d">zero: {escape(" ".join(zero))}</span>' if zero else ""
    return (
        f'<div class="row" style="margin-top:3px"><span class="m">{escape(title)}</span>{rest}'
        f'</div><div style="overflow-x:auto">{out}</div>'
    )


def rows_of_columns(widths: list[int]) -> list[slice]:
    """Runs of columns, so many characters wide, that fit beside each other, equally many in each
    as far as that goes."""
    fit = max(1, ROW_CHARACTERS // (max(widths, default=0) + 2))
    runs = -(-len(widths) // fit)
    each = -(-len(widths) // max(runs, 1))
    return [slice(i, i + each) for i in range(0, len(widths), max(each, 1))]


def state_table(world: World, label: int) -> str:
    """The feature's own state with its standard deviations."""
    f = world.features[label]
    means, covariances = moments(groups(world, [label])[0], world.gauss.x, world.gauss.P)
    y, sd = means[0], np.sqrt(np.maximum(np.diag(covariances[0]), 0.0))
    cells = ""
    for name, v, s, unit in zip(f.model.state_labels, y, sd, f.model.state_units, strict=True):
        value, u = shown(float(v), unit)
        spread, _ = shown(float(s), unit)
        cells += (
            f"<tr><td><b>{escape(name)}</b></td><td>{number(value, 4)}</td>"
            f'<td class="d">± {number(spread, 2)}</td><td class="d">{escape(u)}</td></tr>'
        )
    return (
        '<div class="row" style="margin-top:10px"><span class="h">State y</span>'
        f'<span class="d">mean ± 1 sigma</span></div><table>{cells}</table>'
    )
