"""Reading an experiment from TOML: every key is known, of the right type and in its range."""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass, replace
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from scene_core.params import ParamError, check_value
from scene_core.session import polymorphic, units
from scene_core.session.config import Experiment
from scene_core.session.edits import with_seed
from scene_core.sources.toml_text import parsed


@dataclass(frozen=True)
class Place:
    """Where in the file we are, and the units of the labels that may be met there."""

    file: str
    table: str = ""
    labels: Mapping[str, str] | None = None

    def below(self, name: str) -> Place:
        return replace(self, table=f"{self.table}.{name}" if self.table else name)

    def error(self, text: str) -> ParamError:
        where = f", [{self.table}]" if self.table else ""
        return ParamError(f"{self.file}{where}: {text}")


def read_experiment(text: str, file: str) -> Experiment:
    """The experiment in a TOML text. Raises ParamError naming file, table, key and remedy."""
    try:
        content = parsed(text)
    except ValueError as e:
        raise ParamError(f"{file} is not valid TOML: {e}") from e
    own_seed = "seed" in content.get("source", {}) if isinstance(content, dict) else False
    experiment = _object(Experiment, content, Place(file))
    assert isinstance(experiment, Experiment)
    return experiment if own_seed else with_seed(experiment, experiment.seed)


def _value(hint: Any, value: Any, at: Place, name: str, meta: Mapping[str, Any] | None) -> Any:
    """A value of the type `hint` from what TOML has under a key."""
    origin = get_origin(hint)
    if origin in (Union, types.UnionType):
        hint = next(h for h in get_args(hint) if h is not type(None))
        origin = get_origin(hint)
    if origin is not None and issubclass(_class(origin), Mapping):
        return _mapping(get_args(hint)[1], value, at.below(name), meta)
    if is_dataclass(hint) or polymorphic.variants(_hashable(hint)) is not None:
        return _object(hint, value, at.below(name))
    if origin is tuple:
        return _sequence(hint, value, at, name, meta)
    return _scalar(hint, value, at, name, meta)


def _class(origin: Any) -> type:
    return origin if isinstance(origin, type) else object


def _hashable(hint: Any) -> Any:
    return hint if isinstance(hint, type) else None


def _object(hint: Any, value: Any, at: Place) -> Any:
    """A dataclass, or the variant of an abstract type that the table names."""
    if not isinstance(value, Mapping):
        raise at.error(f"write this as a table, not as {value!r}")
    value = dict(value)
    found = polymorphic.variants(_hashable(hint))
    if found is not None:
        key, classes = found
        name = value.pop(key, None)
        if not isinstance(name, str) or name not in classes:
            why = polymorphic.why_not(_hashable(hint), name)
            raise at.error(f"{key} = {name!r}: choose one of {', '.join(classes)}{why}")
        hint = classes[name]
    hints = get_type_hints(hint)
    declared = [f for f in fields(hint) if f.init]
    by_key = {_key(f): f for f in declared}
    for key in value:
        if key not in by_key:
            raise at.error(f"no key '{key}' here: it may have {', '.join(by_key)}")
    out: dict[str, Any] = {}
    for key, f in by_key.items():
        if key in value:
            meta = f.metadata.get("param", f.metadata.get("entries"))
            out[f.name] = _value(hints[f.name], value[key], at, key, meta)
            if f.name in ("motion", "sensor"):
                known = units.label_units(types.SimpleNamespace(**{f.name: out[f.name]}))
                at = replace(at, labels=known)
        elif not (f.default is not MISSING or f.default_factory is not MISSING):
            raise at.error(f"'{key}' is missing")
    try:
        return hint(**out)
    except ParamError as e:
        raise at.error(str(e)) from e


def _key(f: Field[Any]) -> str:
    meta = f.metadata.get("param")
    return units.key(f.name, meta["unit"] if meta else "")


def _mapping(hint: Any, value: Any, at: Place, meta: Mapping[str, Any] | None) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise at.error(f"write this as a table, not as {value!r}")
    if hint is not float:
        return {name: _value(hint, one, at, name, None) for name, one in value.items()}
    if at.labels is None:
        return {key: _scalar(float, one, at, key, meta) for key, one in value.items()}
    by_key = {units.key(label, unit): label for label, unit in at.labels.items()}
    out = {}
    for key, one in value.items():
        if key not in by_key:
            raise at.error(f"no key '{key}' here: it may have {', '.join(by_key)}")
        out[by_key[key]] = _scalar(float, one, at, key, meta)
    return out


def _sequence(
    hint: Any, value: Any, at: Place, name: str, meta: Mapping[str, Any] | None
) -> tuple[Any, ...]:
    args = get_args(hint)
    if not isinstance(value, list):
        raise at.error(f"{name} = {value!r}: give a list")
    if args[-1] is not Ellipsis and len(value) != len(args):
        raise at.error(f"{name} = {value!r}: give a list of {len(args)}")
    kinds = args[:1] * len(value) if args[-1] is Ellipsis else args
    return tuple(
        _value(kind, one, at, f"{name}[{i}]" if _is_nested(kind) else name, meta)
        for i, (kind, one) in enumerate(zip(kinds, value, strict=True))
    )


def _is_nested(kind: Any) -> bool:
    return is_dataclass(kind) or get_origin(kind) is tuple


_SAMPLES: Mapping[Any, Any] = {int: 0, float: 0.0, bool: False, str: ""}
_FREE = {"unit": "", "lo": None, "hi": None, "choices": None}


def _scalar(hint: Any, value: Any, at: Place, name: str, meta: Mapping[str, Any] | None) -> Any:
    if hint is Any:
        if isinstance(value, (int, str)) and not isinstance(value, bool):
            return value
        raise at.error(f"{name} = {value!r}: give a whole number or a text")
    if meta is None:
        meta = {**_FREE, "choices": get_args(hint) if get_origin(hint) is Literal else None}
    if isinstance(value, float) and not math.isfinite(value):
        raise at.error(f"{name} = {value}: give a finite number")
    try:
        return check_value(name, value, _SAMPLES.get(hint, ""), meta)
    except ParamError as e:
        raise at.error(str(e)) from e
