"""The conformance check: does a model keep the promises its base class makes in its name?

The same function tests the built-in models and certifies a user's own file before it may be
swapped in.
"""

from __future__ import annotations

import re
from dataclasses import MISSING, fields, is_dataclass, replace
from typing import Any

import numpy as np

from scene_core.models.base import FeatureModel, InternalMeasurementModel, MotionModel, Sensor
from scene_core.models.guard import is_guarded, unbatched, watched
from scene_core.models.judge import Law, Line, Report, run
from scene_core.models.laws_feature import feature_laws
from scene_core.models.laws_internal import internal_laws
from scene_core.models.laws_lines import line_laws
from scene_core.models.laws_motion import motion_laws
from scene_core.models.laws_sensor import sensor_laws
from scene_core.models.registry import kind_of

__all__ = ["Line", "Report", "check", "no_default"]

_ONE = r"(1|mm|m|s|rad|px|kg|N|Hz|V|A|K|%)[²³⁴]?"
_UNIT = re.compile(rf"(√?{_ONE}(\s√?{_ONE})*(/√?{_ONE})*)?")
"""Products and quotients of known units, with superscripts: m/s², 1/px², rad/s/√Hz."""


def check(model: Any, seed: int = 0) -> Report:
    """Every law a model must obey, tried at random and awkward states.

    `model` is an instance, or a class whose parameters all have defaults. Raises TypeError when it
    is no model at all; whatever the model itself raises is part of the report.
    """
    if isinstance(model, type):
        if missing := no_default(model):
            raise TypeError(missing)
        model = model()
    kind = kind_of(model)
    model, numeric = watched(model)
    laws = [("units are known", lambda: _unknown_units(model))]
    report = run(model.name, kind, [*laws, *_laws(model, np.random.default_rng(seed))])
    return replace(report, remarks=_remarks(model, numeric))


def no_default(cls: type[Any]) -> str:
    """Which parameter of a class has no default value, as a sentence; empty when all have one."""
    for f in fields(cls) if is_dataclass(cls) else ():
        if f.init and f.default is MISSING and f.default_factory is MISSING:
            return (
                f"parameter '{f.name}' of {cls.__name__} has no default: give it one, e.g. "
                f"{f.name}: float = param(0.1)"
            )
    return ""


def _unknown_units(model: Any) -> str:
    """Which unit nobody knows, or nothing."""
    named = [
        (attribute, unit)
        for attribute in ("state_units", "control_units", "calib_units", "units")
        for unit in getattr(model, attribute, ())
    ]
    for f in fields(model):
        if "param" in f.metadata:
            named.append((f"parameter '{f.name}'", f.metadata["param"]["unit"]))
    for where, unit in named:
        if not isinstance(unit, str) or not _UNIT.fullmatch(unit):
            return f"{where}: no unit {unit!r}; write e.g. m, rad, px, m/s, rad/s, m/s², 1/m"
    return ""


def _remarks(model: Any, numeric: set[str]) -> tuple[str, ...]:
    """Which Jacobians are numeric; how a user's own functions take a batch."""
    out = []
    if numeric:
        names = ", ".join(sorted(numeric))
        out.append(f"numeric: {names} by central differences (none given)")
    if is_guarded(type(model)) and isinstance(model, (Sensor, FeatureModel)):
        alone = ", ".join(sorted(unbatched(type(model))))
        out.append(f"unbatched: {alone}, called once for every feature" if alone else "batched")
    return tuple(out)


def _laws(model: Any, rng: np.random.Generator) -> list[Law]:
    match model:
        case MotionModel():
            return motion_laws(model, rng)
        case Sensor():
            return sensor_laws(model, rng)
        case FeatureModel():
            segment = model.shape == "segment"
            return line_laws(model, rng) if segment else feature_laws(model, rng)
        case InternalMeasurementModel():
            return internal_laws(model, rng)
        case _:
            raise TypeError(f"{type(model).__name__} is not a model")
