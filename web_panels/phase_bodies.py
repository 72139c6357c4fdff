"""What is said about each phase of a frame: its equation, with its numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from scene_core.filter.ports import Image
from scene_core.filter.records import Association, PhaseRecord, Trace
from scene_core.filter.select import ranked
from scene_core.filter.world import Robot, World
from web_panels import mathml as mm
from web_panels.style import CERTAIN, HEX, STATE_OF_VERDICT, escape, gate_words, number, shown

LISTED = 12
"""Features listed by one phase; the others are counted."""
ARROW = mm.op("\N{LEFTWARDS ARROW}")
TO = "\N{RIGHTWARDS ARROW}"


def _equations(*lines: str) -> str:
    rows = "".join(f'<div style="text-align:center;padding:2px 0">{line}</div>' for line in lines)
    return f'<div style="margin:3px 0;overflow-x:auto">{rows}</div>'


def _table(rows: str, head: str = "") -> str:
    return f'<table class="pc" style="font-size:11.5px">{head}{rows}</table>' if rows else ""


def _line(text: str) -> str:
    return f'<div style="margin-top:2px">{text}</div>'


def _numbers(numbers: Mapping[str, float], leave: tuple[str, ...] = ()) -> str:
    """The filter's own numbers of this phase."""
    rows = "".join(
        f"<tr><td>{escape(k)}</td><td>{number(v, 4)}</td></tr>"
        for k, v in numbers.items()
        if k not in leave
    )
    return _table(rows)


def _robot_table(robot: Robot, before: World, after: World) -> str:
    """Mean and standard deviation of every component, before and after."""
    a, b = before.gauss.mean(robot.block), after.gauss.mean(robot.block)
    sa, sb = (np.sqrt(np.maximum(np.diag(w.gauss.cov(robot.block)), 0.0)) for w in (before, after))
    rows = ""
    for i, (name, unit) in enumerate(
        zip(robot.motion.state_labels, robot.motion.state_units, strict=True)
    ):
        factor, u = shown(1.0, unit)
        rows += (
            f"<tr><td>{escape(name)} <span class='d'>{escape(u)}</span></td>"
            f"<td>{_fixed(a[i] * factor)} {TO} {_fixed(b[i] * factor)}</td>"
            f"<td>{_sigma(sa[i] * factor)} {TO} {_sigma(sb[i] * factor)}</td></tr>"
        )
    head = f"<tr><th>{escape(robot.id)}</th><th>mean</th><th>sigma</th></tr>"
    return _table(rows, head)


def _fixed(v: float) -> str:
    return mm.signed(f"{v:.3f}")


def _sigma(sd: float) -> str:
    """A standard deviation; what is left of none by rounding is none."""
    return number(sd if sd > CERTAIN else 0.0, 2)


def _predict(record: PhaseRecord, before: World, trace: Trace) -> str:
    seconds = f"{record.numbers.get('dt', trace.frame.dt):.4g}"
    xv, u, dt = mm.symbol("x", True, "v"), mm.symbol("u", True), mm.symbol("Δt")
    F, P, G = mm.symbol("F", True), mm.symbol("P", True), mm.symbol("G", True)
    U, Q = mm.symbol("U", True), mm.symbol("Q", True)
    equations = _equations(
        mm.formula(xv, ARROW, mm.symbol("f", True), mm.op("("), xv, mm.op(","), u, mm.op(","),
                   dt, mm.op(")"), mm.op(","), dt, mm.op("="), mm.value(seconds),
                   mm.symbol(" s")),
        mm.formula(P, ARROW, F, P, mm.transposed(F), mm.op("+"), G, U, mm.transposed(G),
                   mm.op("+"), Q),
    )  # fmt: skip
    tables = "".join(_robot_table(r, before, record.world) for r in record.world.robots.values())
    return equations + tables + _numbers(record.numbers, ("dt",))


def _internal(record: PhaseRecord, before: World, trace: Trace) -> str:
    if not record.internals:
        return _line("No internal measurement in this frame.")
    rows = ""
    for m in record.internals:
        colour = HEX["accepted" if m.accepted else "rejected"]
        rows += (
            f'<tr><td>{escape(m.instrument)}</td><td style="color:{colour}">'
            f"d2 = {m.d2:.1f} {'&lt;' if m.accepted else '&gt;'} {m.gate:.2f}</td>"
            f"<td>{'in the update' if m.accepted else escape(m.why)}</td></tr>"
        )
    h, z, nu = mm.symbol("h", True, "v"), mm.symbol("z", True, "v"), mm.symbol("ν", True)
    return _equations(mm.formula(nu, mm.op("="), z, mm.op("−"), h)) + _table(rows)


def _select(record: PhaseRecord, before: World, trace: Trace) -> str:
    E, H, P = mm.symbol("E", True), mm.symbol("H", True), mm.symbol("P", True)
    order = ranked(record.predictions)
    chosen = {k for p in record.predictions for k, s in zip(p.labels, p.selected, strict=True) if s}
    rows = "".join(
        f'<tr><td>{label}</td><td>{number(score, 3)}</td><td class="d">'
        f"{'selected' if label in chosen else 'left out'}</td></tr>"
        for score, label in order[:LISTED]
    )
    how = record.world.policies.selection.score
    faulty = sum(len(p.labels) for p in record.predictions) - len(order)
    return (
        _equations(mm.formula(E, mm.op("="), H, P, mm.transposed(H)))
        + _line(
            f"{len(order)} features can be measured, {faulty} can not; {len(chosen)} are selected, "
            f"largest {how} of E first."
        )
        + _table(rows, f"<tr><th>feature</th><th>{how} of E</th><th></th></tr>")
        + _more(len(order))
    )


def _more(count: int) -> str:
    rest = count - LISTED
    return f'<div class="d">and {rest} more</div>' if rest > 0 else ""


def _search(record: PhaseRecord, before: World, trace: Trace) -> str:
    z, h, S = mm.symbol("z", True), mm.symbol("h", True), mm.symbol("S", True)
    nu = "<mrow>" + mm.op("(") + z + mm.op("−") + h + mm.op(")") + "</mrow>"
    sigma = record.world.policies.association.search_sigma
    if not record.matches:
        return _line("Nothing was selected, so nothing is searched.")
    images = isinstance(trace.frame.raw.get(record.mount or ""), Image)
    searched = record.world.policies.association.kind == "search"
    rows = ""
    for m in record.matches[:LISTED]:
        found = m.z is not None
        colour = HEX["ink" if found else "nomatch"]
        low = images and m.score < m.threshold and m.positions > 0
        outcome = "found" if found else f"below {m.threshold:.2f}" if low else escape(m.why)
        positions = f"<td>{m.positions or '–'}</td>" if images else ""
        what = "–" if not found else "place in the gate" if searched else "identity"
        if images and m.positions:
            what = f"{m.score:.2f}"
        rows += (
            f"<tr><td>{m.label}</td>{positions}"
            f'<td style="color:{colour}">{what}</td><td>{outcome}</td></tr>'
        )
    found = sum(m.z is not None for m in record.matches)
    head = "<th>positions</th><th>NCC</th>" if images else "<th>told by</th>"
    equation = (
        _equations(mm.formula(mm.transposed(nu), mm.inverse(S), nu, mm.op("<"),
                              mm.power(mm.value(f"{sigma:g}"), "<mn>2</mn>")))
        if images or searched
        else ""
    )  # fmt: skip
    return (
        equation
        + _line(f"{found} of {len(record.matches)} found.")
        + _table(rows, f"<tr><th>feature</th>{head}<th></th></tr>")
        + _more(len(record.matches))
    )


def _gated(associations: tuple[Association, ...]) -> str:
    judged = [a for a in associations if a.d2 is not None and a.gate is not None]
    rows = ""
    for a in sorted(judged, key=lambda a: -(a.d2 or 0.0))[:LISTED]:
        assert a.d2 is not None and a.gate is not None
        colour = HEX[STATE_OF_VERDICT[a.verdict]]
        words = gate_words(a.d2, a.gate, a.dof, a.confidence).partition(" (")[0]
        verdict = f'<td style="color:{colour}">{a.verdict}</td>'
        rows += f"<tr><td>{a.label}</td>{verdict}<td>{words}</td></tr>"
    return _table(rows) + _more(len(judged))


def _odd_ones(associations: tuple[Association, ...]) -> str:
    """Those that passed their own gate and were left out because of the others."""
    return "".join(
        f'<tr><td>{a.label}</td><td style="color:{HEX["rejected"]}">{escape(a.why)}</td></tr>'
        for a in associations
        if a.verdict == "rejected" and a.d2 is not None and a.gate is not None and a.d2 < a.gate
    )


def _associate(record: PhaseRecord, before: World, trace: Trace) -> str:
    nu, S = mm.symbol("ν", True), mm.symbol("S", True)
    E, R = mm.symbol("E", True), mm.symbol("R", True)
    judged = [a for a in record.associations if a.gate is not None]
    gate = ""
    if judged:
        a = judged[0]
        gate = _line(f"Gate: d2 &lt; {a.gate:.2f} ({a.dof} DoF, {100 * a.confidence:.4g} %).")
    return (
        _equations(mm.formula(mm.power(mm.symbol("d"), "<mn>2</mn>"), mm.op("="),
                              mm.transposed(nu), mm.inverse(S), nu, mm.op(","), S, mm.op("="), E,
                              mm.op("+"), R))
        + (gate or _line("No match to judge."))
        + _gated(record.associations)
    )  # fmt: skip


def _update(record: PhaseRecord, before: World, trace: Trace) -> str:
    x, P, K = mm.symbol("x", True), mm.symbol("P", True), mm.symbol("K", True)
    H, S, nu = mm.symbol("H", True), mm.symbol("S", True), mm.symbol("ν", True)
    used = [a for a in record.associations if a.verdict == "accepted" and a.nu is not None]
    if not used:
        return _line("No accepted match: the state stays as it was predicted.")
    size = float(np.linalg.norm(np.concatenate([a.nu for a in used if a.nu is not None])))
    kind = record.world.policies.update.kind
    units = set(record.world.mounts[used[0].mount].sensor.units)
    unit = f" {escape(units.pop())}" if len(units) == 1 else ""
    equations = _equations(
        mm.formula(K, mm.op("="), P, mm.transposed(H), mm.inverse(S)),
        mm.formula(x, ARROW, x, mm.op("+"), K, nu),
        mm.formula(P, ARROW, P, mm.op("−"), K, S, mm.transposed(K)),
    )
    tables = "".join(_robot_table(r, before, record.world) for r in record.world.robots.values())
    return (
        equations
        + _line(f"{len(used)} matches, {kind}, ‖ν‖ = {number(size)}{unit}.")
        + _table(_odd_ones(record.associations))
        + tables
        + _numbers(record.numbers, ("accepted",))
    )


def _manage(record: PhaseRecord, before: World, trace: Trace) -> str:
    if not record.events:
        return _line("No feature was born, converted or deleted.") + _numbers(record.numbers)
    rows = "".join(
        f'<tr><td>{e.kind}</td><td style="text-align:left">{escape(e.text)}</td></tr>'
        for e in record.events[:LISTED]
    )
    y, g, J = mm.symbol("y", True), mm.symbol("g", True), mm.symbol("J", True)
    xp, z, P = mm.symbol("x", True, "p"), mm.symbol("z", True), mm.symbol("P", True)
    born = any(e.kind == "born" for e in record.events)
    equations = (
        _equations(
            mm.formula(y, mm.op("="), g, mm.op("("), xp, mm.op(","), z, mm.op(")")),
            mm.formula(P, ARROW, J, P, mm.transposed(J), mm.op("+"), mm.symbol("R", True, "yz")),
        )
        if born
        else ""
    )
    return equations + _table(rows) + _more(len(record.events)) + _numbers(record.numbers)


BODIES: Mapping[str, Callable[[PhaseRecord, World, Trace], str]] = {
    "predict": _predict,
    "internal": _internal,
    "select": _select,
    "search": _search,
    "associate": _associate,
    "update": _update,
    "manage": _manage,
}
"""What is said about each phase."""
