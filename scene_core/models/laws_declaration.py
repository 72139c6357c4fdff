"""The laws of what a model says of itself, tried before all others: those rely on it."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from typing import Any, get_args

from scene_core import params
from scene_core.geometry.spaces import Space
from scene_core.models.base import FeatureModel, InternalMeasurementModel, Shape
from scene_core.models.judge import Law, first, tried

_LABELLED = ("state_", "control_", "calib_", "free_", "")
"""What comes before `labels` and `units` in the names of the attributes."""
_DIRECTIONS = ("gravity", "north", "plane")
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
    named = [*(f"{of}labels" for of in _LABELLED), "needs", "hooks", "world_fixed", "unmeasured"]
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


def _shape(model: Any) -> str:
    shapes = get_args(Shape)
    if not isinstance(model, FeatureModel) or model.shape in shapes:
        return ""
    return f"shape is {model.shape!r}; write one of {', '.join(map(repr, shapes))}"


def _successor(model: Any) -> str:
    after = model.successor() if isinstance(model, FeatureModel) else None
    if after is None or isinstance(after, FeatureModel):
        return ""
    if isinstance(after, type):
        return f"successor() is a class; return one of it, {after.__name__}()"
    return f"successor() is {after!r}; return a landmark, e.g. Point3D()"


def _fixed(model: Any) -> str:
    unknown = [name for name in getattr(model, "world_fixed", ()) if name not in _DIRECTIONS]
    return f"world_fixed has {unknown[0]!r}; write {', '.join(_DIRECTIONS)}" if unknown else ""


def _equal(model: Any) -> str:
    same = model == replace(model)
    return "" if same is True else f"== is {same!r} for two with the same parameters"


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
    ("directions of the world are known", _fixed),
    ("the shape of a landmark is known", _shape),
    ("the successor of a landmark is a landmark", _successor),
    ("parameters start in their ranges", _defaults),
    ("equal parameters make equal models", _equal),
)
