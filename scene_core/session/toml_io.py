"""One commented TOML file per experiment: what `userData.m` was.

Units are part of the keys, every parameter carries its help text and range, and what differs from
the scenario is marked. Reading gives an equal experiment, so a run is repeated bit for bit.
"""

from __future__ import annotations

import textwrap
import types
from collections.abc import Mapping
from dataclasses import Field, fields, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_type_hints

import tomlkit
from tomlkit.items import Table

from scene_core import params
from scene_core.session import polymorphic, units
from scene_core.session.config import Experiment
from scene_core.session.toml_read import read_experiment
from scene_core.text_file import text_of

__all__ = ["dumps", "load", "loads", "save"]

MISSING = object()


def load(path: str | Path) -> Experiment:
    """The experiment in a file. Raises ParamError with one sentence about what does not fit."""
    try:
        text = text_of(Path(path), "a settings file (TOML)")
    except ValueError as e:
        raise params.ParamError(f"the settings file {e}") from e
    return loads(text, str(path))


def loads(text: str, file: str = "settings") -> Experiment:
    """The experiment described by a TOML text; `file` is how errors call it."""
    return read_experiment(text, file)


def save(path: str | Path, experiment: Experiment, base: Experiment | None = None) -> None:
    """Write an experiment to a file; values that differ from `base` are marked."""
    Path(path).write_text(dumps(experiment, base), encoding="utf-8")


def dumps(experiment: Experiment, base: Experiment | None = None) -> str:
    """An experiment as TOML."""
    out = tomlkit.document()
    out.add(tomlkit.comment("Settings of one experiment. Run it with --config and this file."))
    if base is not None:
        out.add(tomlkit.comment("Values that differ from the scenario's are marked 'changed'."))
    _write_fields(out, experiment, base if base is not None else experiment, {})
    return tomlkit.dumps(out)


def _write_fields(
    table: Any, obj: Any, base: Any, labels: Mapping[str, str], is_seed_known: bool = False
) -> None:
    """All init fields of a dataclass into a table: values first, tables after them."""
    hints = get_type_hints(type(obj))
    labels = units.label_units(obj) or labels
    tables: list[tuple[Field[Any], Any]] = []
    for f in (f for f in fields(obj) if f.init):
        value = getattr(obj, f.name)
        if value is None or (f.name == "seed" and is_seed_known):
            continue
        if is_dataclass(value) or isinstance(value, Mapping) or _is_rows(value):
            tables.append((f, value))
            continue
        _write_value(table, type(obj), f, value, getattr(base, f.name, MISSING))
    for f, value in tables:
        old = getattr(base, f.name, MISSING)
        if isinstance(value, Mapping) and not value:
            continue
        if isinstance(value, tuple):
            _write_rows(table, f, value, old)
        elif isinstance(value, Mapping):
            table.add(f.name, _mapping(value, old, _value_hint(hints[f.name]), labels))
        else:
            known = f.name == "source" and getattr(value, "seed", None) == obj.seed
            table.add(f.name, _dataclass(value, old, hints[f.name], labels, known))


def _write_value(table: Any, cls: type, f: Field[Any], value: Any, old: Any) -> None:
    meta = f.metadata.get("param")
    text = params.field_docs(cls).get(f.name, "")
    if meta is not None:
        text = f"{text} {_range(meta)}".strip()
    for row in textwrap.wrap(" ".join(text.split()), 94):
        table.add(tomlkit.comment(row))
    item = tomlkit.item(plain(value))
    if old is not MISSING and plain(old) != plain(value):
        item.comment(f"changed, preset: {_shown(old)}")
    table.add(units.key(f.name, meta["unit"] if meta else ""), item)


def _range(meta: Mapping[str, Any]) -> str:
    """E.g. Range 0 to 10 m."""
    if meta["choices"]:
        return f"One of {', '.join(meta['choices'])}."
    lo, hi = meta["lo"], meta["hi"]
    if lo is None and hi is None:
        return f"In {meta['unit']}." if meta["unit"] else ""
    unit = f" {meta['unit']}" if meta["unit"] else ""
    low = "-inf" if lo is None else f"{lo:g}"
    return f"Range {low} to {'inf' if hi is None else f'{hi:g}'}{unit}."


def _dataclass(
    value: Any, old: Any, hint: Any, labels: Mapping[str, str], is_seed_known: bool = False
) -> Table:
    out = tomlkit.table()
    hint = _not_none(hint)
    found = polymorphic.variants(hint)
    if found is not None:
        item = tomlkit.item(polymorphic.word(hint, value))
        if old is not MISSING and type(old) is not type(value):
            had = None if old is None else polymorphic.word(hint, old)
            item.comment(f"changed, preset: {_shown(had)}")
        out.add(found[0], item)
    base = old if type(old) is type(value) else None
    _write_fields(out, value, base, labels, is_seed_known)
    return out


def _mapping(value: Mapping[str, Any], old: Any, hint: Any, labels: Mapping[str, str]) -> Table:
    scalars = not any(is_dataclass(v) for v in value.values())
    out = tomlkit.table(is_super_table=not scalars)
    before = old if isinstance(old, Mapping) else {}
    for name, one in value.items():
        if not scalars:
            out.add(name, _dataclass(one, before.get(name, MISSING), hint, labels))
            continue
        item = tomlkit.item(plain(one))
        if old is not MISSING and before.get(name, MISSING) != one:
            had = _shown(before[name]) if name in before else "not there"
            item.comment(f"changed, preset: {had}")
        out.add(units.key(name, labels.get(name, "")), item)
    return out


def _is_rows(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and all(is_dataclass(v) for v in value)


def _write_rows(table: Any, f: Field[Any], value: tuple[Any, ...], old: Any) -> None:
    rows = tomlkit.aot()
    for i, one in enumerate(value):
        row = tomlkit.table()
        before = old[i] if isinstance(old, tuple) and i < len(old) else None
        _write_fields(row, one, before, {})
        rows.append(row)
    table.add(f.name, rows)


def _not_none(hint: Any) -> Any:
    """X of X | None."""
    known = [one for one in get_args(hint) if one is not type(None)]
    return known[0] if isinstance(hint, types.UnionType) else hint


def _value_hint(hint: Any) -> Any:
    """X of Mapping[str, X]."""
    return get_args(hint)[1]


def plain(value: Any) -> Any:
    """Numbers, texts and lists of them, as TOML has them."""
    if isinstance(value, (tuple, list)):
        return [plain(v) for v in value]
    return value.item() if hasattr(value, "item") else value


def _shown(value: Any) -> str:
    return "not set" if value is None else tomlkit.item(plain(value)).as_string()
