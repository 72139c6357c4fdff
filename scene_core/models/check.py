"""The conformance check: does a model keep the promises its base class makes in its name?

The same function tests the built-in models and certifies a user's own file before it may be
swapped in.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass, replace
from typing import Any

import numpy as np

from scene_core.models.base import FeatureModel, InternalMeasurementModel, MotionModel, Sensor
from scene_core.models.guard import is_guarded, unbatched, watched
from scene_core.models.judge import Law, Line, Report, raised, run
from scene_core.models.laws_declaration import declaration_laws
from scene_core.models.laws_feature import feature_laws
from scene_core.models.laws_internal import internal_laws
from scene_core.models.laws_lines import line_laws
from scene_core.models.laws_motion import motion_laws
from scene_core.models.laws_sensor import sensor_laws
from scene_core.models.missing import closest
from scene_core.models.registry import KINDS, kind_of

__all__ = ["Line", "Report", "check", "no_default"]


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
    declared = run(model.name, kind, declaration_laws(model))
    if not declared.ok:
        return replace(declared, remarks=("the other laws were not tried",))
    try:
        laws = _laws(model, np.random.default_rng(seed))
    except Exception as error:  # a user's model may raise anything
        lines = (*declared.lines, Line("it can be tried at random states", False, raised(error)))
        return replace(declared, lines=lines, remarks=("the other laws were not tried",))
    report = run(model.name, kind, laws)
    lines = (*declared.lines, *report.lines)
    return replace(report, lines=lines, remarks=_remarks(model, numeric))


def no_default(cls: type[Any]) -> str:
    """Which parameter of a class has no default value, as a sentence; empty when all have one."""
    for f in fields(cls) if is_dataclass(cls) else ():
        if f.init and f.default is MISSING and f.default_factory is MISSING:
            return (
                f"parameter '{f.name}' of {cls.__name__} has no default: give it one, e.g. "
                f"{f.name}: float = param(0.1)"
            )
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
    out += [f"nobody reads '{name}': is {known} meant?" for name, known in _misspelt(model)]
    return tuple(out)


def _misspelt(model: Any) -> Iterator[tuple[str, str]]:
    """What a user's class says or does under a name that its kind does not have, but nearly."""
    base = KINDS[kind_of(model)]
    parameters = {f.name for f in fields(model) if "param" in f.metadata}
    own = [c for c in type(model).__mro__ if not c.__module__.startswith("scene_core.")]
    names = dict.fromkeys(name for cls in own for name in vars(cls) if name[0] != "_")
    used = {name for cls in own for name in _used(cls)}
    for name in names:
        known = closest(name, dir(base))
        if known and name not in parameters and name not in used and not hasattr(base, name):
            yield name, known


def _used(cls: type[Any]) -> Iterator[str]:
    """Names that the functions of a class use; not those a dataclass writes, which use all of its
    fields."""
    for what in vars(cls).values():
        function = what.fget if isinstance(what, property) else inspect.unwrap(what)
        code = getattr(function, "__code__", None)
        if code is not None and code.co_filename != "<string>":
            yield from code.co_names


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
