"""What became of the user's own files: a card each, with the conformance report of every model."""

from __future__ import annotations

from collections.abc import Sequence

from scene_core.models.judge import Line
from scene_core.models.plugins import UserFile, UserModel
from web_panels.style import HEX, block, escape

KIND_WORDS = {
    "motion": "motion model",
    "sensors": "sensor",
    "features": "landmark",
    "internal": "internal measurement",
}


def reports_html(files: Sequence[UserFile]) -> str:
    """All cards; nothing without files of the user's own."""
    if not files:
        return ""
    cards = "".join(_file(f) for f in files)
    return block(
        f'<div class="h" style="margin:4px 0">Your own models</div>{cards}', "padding:6px 4px"
    )


def _file(file: UserFile) -> str:
    problem = f'<div class="bad">{escape(file.problem)}</div>' if file.problem else ""
    models = "".join(_model(m) for m in file.models)
    return (
        f'<div class="card" style="margin-bottom:6px"><div class="d m">{escape(file.name)}</div>'
        f"{problem}{models}</div>"
    )


def _model(model: UserModel) -> str:
    """Name, verdict, and the laws behind it; the laws are open where one is broken."""
    verdict, colour = ("conforms", "estimate") if model.conforms else ("not offered", "accepted")
    chip = (
        f'<span class="chip" style="color:{HEX[colour]};border:1px solid {HEX[colour]}">'
        f"{verdict}</span>"
    )
    kind = KIND_WORDS.get(model.kind, "")
    head = (
        f'<div class="row" style="margin-top:4px"><span><b>{escape(model.name)}</b> '
        f'<span class="d">{kind}</span></span>{chip}</div>'
    )
    # What the report does not say: a name that is taken, a class that could not be made.
    said = model.report is not None and not model.report.ok
    why = "" if model.conforms or said else f'<div class="bad">{escape(model.problem)}</div>'
    return head + why + _report(model)


def _report(model: UserModel) -> str:
    report = model.report
    if report is None:
        return ""
    broken = sum(not line.ok for line in report.lines)
    count = (
        f"{broken} of {len(report.lines)} laws broken"
        if broken
        else f"{len(report.lines)} laws kept"
    )
    rows = "".join(_line(line) for line in sorted(report.lines, key=lambda line: line.ok))
    remarks = "".join(f'<div class="d">{escape(text)}</div>' for text in report.remarks)
    state = " open" if broken else ""
    return f'{remarks}<details{state}><summary class="d">{count}</summary>{rows}</details>'


def _line(line: Line) -> str:
    mark, colour = ("✓", "estimate") if line.ok else ("✗", "accepted")
    detail = f'<div class="m" style="overflow-wrap:anywhere">{escape(line.detail)}</div>'
    return (
        f'<div><span style="color:{HEX[colour]}">{mark}</span> {escape(line.law)}'
        f"{detail if line.detail else ''}</div>"
    )
