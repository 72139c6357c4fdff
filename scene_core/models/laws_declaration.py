"""The laws of what a model says of itself, tried before all others: those rely on it."""

from __future__ import annotations

import re
from dataclasses import fields
from typing import Any

from scene_core import params
from scene_core.geometry.spaces import Space
from scene_core.models.base import InternalMeasurementModel
from scene_core.models.judge import Law, first, tried

_LABELLED = ("state_", "control_", "calib_", "free_", "")
"""What comes before `labels` and `units` in the names of the attributes."""
_ONE = r"(1|mm|m|s|rad|px|kg|N|Hz|V|A|K|%)[²³⁴]?"
_UNIT = re.compile(rf"(√?{_ONE}(\s√?{_ONE})*(/√?{_ONE})*)?")
"""Products and quotients of known units, with superscripts: m/s², 1/px², rad/s/√Hz."""


def declaration_laws(model: Any) -> list[Law]:
    """The laws of a declaration, ready to be tried."""
    return tried(model, _LAWS)


def _space(model: Any) -> str:
    if isinstance(model, InternalMeasurementModel) or isinstance(model.space, Space):
        return ""
    return f"space is {model.space!r}; write ONE_D, TWO_D or THREE_D of scene_core.geometry.spaces"


def _labels(model: Any) -> str:
    named = [*(f"{of}labels" for of in _LABELLED), "needs"]
    return first([_not_labels(name, getattr(model, name, ())) for name in named])


def _not_labels(where: str, labels: Any) -> str:
    if not isinstance(labels, tuple):
        return f'{where} is {labels!r}; write a tuple of texts, ("x",)'
    for label in labels:
        if not isinstance(label, str) or not label.strip() or not label.isprintable():
            return f"{where} has {label!r}; give a text"
        if labels.count(label) > 1:
            return f"{where} has '{label}' twice"
    return ""


def _pairs(model: Any) -> str:
    counts = {
        of: (len(getattr(model, f"{of}labels", ())), len(getattr(model, f"{of}units", ())))
        for of in _LABELLED
    }
    return first(
        [f"{n} {of}labels, {m} {of}units" if n != m else "" for of, (n, m) in counts.items()]
    )


def _units(model: Any) -> str:
    named = [(f"{of}units", unit) for of in _LABELLED for unit in getattr(model, f"{of}units", ())]
    for f in fields(model):
        if "param" in f.metadata:
            named.append((f"parameter '{f.name}'", f.metadata["param"]["unit"]))
    for where, unit in named:
        if not isinstance(unit, str) or not _UNIT.fullmatch(unit):
            return f"{where}: no unit {unit!r}; write e.g. m, rad, px, m/s, rad/s, m/s², 1/m"
    return ""


def _defaults(model: Any) -> str:
    """Which parameter's value could not be given to it, or nothing."""
    for spec in params.schema(model):
        try:
            params.replace(model, spec.path, spec.value)
        except params.ParamError as e:
            return f"parameter {e}"
    return ""


_LAWS = (
    ("the space is 1-D, 2-D or 3-D", _space),
    ("labels are different texts", _labels),
    ("every label has a unit", _pairs),
    ("units are known", _units),
    ("parameters start in their ranges", _defaults),
)
