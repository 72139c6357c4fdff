"""Parameters of frozen dataclasses: declaration, description, validated replacement by path.

A parameter is a dataclass field made by `param`. The docstring under the field is its help
text everywhere: slider, command line, settings file. A path is the dotted way to a field
through nested dataclasses and mappings, e.g. ``robots.cam.motion.sd_accel``.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from typing import Any, Literal

from scene_core.values import ParamError, check_value, rows_text, rows_typed

__all__ = [
    "Effect",
    "ParamError",
    "Spec",
    "changed",
    "check_value",
    "entries",
    "field_docs",
    "get",
    "param",
    "put",
    "replace",
    "replace_all",
    "rows_text",
    "rows_typed",
    "schema",
]

Effect = Literal["next frame", "next feature", "on reset"]


@dataclass(frozen=True)
class Spec:
    """What a form needs to know about one parameter."""

    path: str
    name: str
    value: Any
    unit: str
    """SI unit, `rad` for angles: the page turns radians into degrees, nothing else does."""
    lo: float | None
    hi: float | None
    """Validity: a value outside is refused wherever it comes from."""
    soft: tuple[float, float] | None
    """The slider's range, inside (lo, hi)."""
    choices: tuple[str, ...] | None
    effect: Effect
    help: str
    label: str
    rows: bool = False
    """A list of any number of rows of numbers, e.g. waypoints."""
    below: str = ""
    """The parameter beside it that it may not be above: they are two limits, to be edited
    together."""


def param(
    default: Any = MISSING,
    *,
    unit: str = "",
    lo: float | None = None,
    hi: float | None = None,
    soft: tuple[float, float] | None = None,
    choices: tuple[str, ...] | None = None,
    effect: Effect = "next frame",
    label: str = "",
    rows: bool = False,
    below: str = "",
) -> Any:
    """Declare a parameter field; its help text is the docstring below the field."""
    meta = dict(unit=unit, lo=lo, hi=hi, soft=soft, choices=choices, effect=effect, label=label)
    if rows:
        meta["rows"] = True
    if below:
        meta["below"] = below
    return field(default=default, metadata={"param": meta})


def entries(*, unit: str = "", lo: float | None = None, hi: float | None = None) -> Any:
    """Declare a field that maps labels to numbers of which each may be there or not: a path with
    one more part sets one, and None takes it away."""
    meta = dict(unit=unit, lo=lo, hi=hi, choices=None)
    return field(default_factory=dict, metadata={"entries": meta})


@cache
def field_docs(cls: type) -> Mapping[str, str]:
    """Docstrings written under the fields of a dataclass, by field name."""
    try:
        source = textwrap.dedent(inspect.getsource(cls))
    except (OSError, TypeError):
        return {}
    docs: dict[str, str] = {}
    for base in reversed(cls.__mro__[1:]):
        if is_dataclass(base):
            docs |= field_docs(base)
    body = next(n for n in ast.parse(source).body if isinstance(n, ast.ClassDef)).body
    for node, after in itertools.pairwise(body):
        if (
            isinstance(node, ast.AnnAssign)
            and isinstance(node.target, ast.Name)
            and isinstance(after, ast.Expr)
            and isinstance(after.value, ast.Constant)
            and isinstance(after.value.value, str)
        ):
            docs[node.target.id] = inspect.cleandoc(after.value.value)
    return docs


def _children(obj: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(obj, Mapping):
        yield from ((str(k), v) for k, v in obj.items())
    elif is_dataclass(obj):
        yield from ((f.name, getattr(obj, f.name)) for f in fields(obj) if f.init)


def schema(obj: Any, prefix: str = "") -> list[Spec]:
    """All parameters below `obj`, depth first in the order of their declaration."""
    out: list[Spec] = []
    own = {s.name: s for s in _own(obj, prefix)}
    for name, value in _children(obj):
        if name in own:
            out.append(own[name])
        elif is_dataclass(value) or isinstance(value, Mapping):
            out.extend(schema(value, f"{prefix}.{name}" if prefix else name))
    return out


def _own(obj: Any, prefix: str) -> Iterator[Spec]:
    """The parameters that `obj` itself declares."""
    if not is_dataclass(obj):
        return
    for f in fields(obj):
        meta = f.metadata.get("param")
        if meta is not None and f.init:
            rest = {k: v for k, v in meta.items() if k != "label"}
            yield Spec(
                path=f"{prefix}.{f.name}" if prefix else f.name,
                name=f.name,
                value=getattr(obj, f.name),
                help=field_docs(type(obj)).get(f.name, ""),
                label=meta["label"] or f.name.replace("_", " "),
                **rest,
            )


def changed(now: Any, before: Any, prefix: str = "") -> list[tuple[Spec, Spec | None]]:
    """Parameters of `now` whose value is another one in `before`, each with its spec there; None
    where there was no such parameter. Branches that both share are not looked into."""
    if now is before:
        return []
    old = dict(_children(before))
    was = {s.name: s for s in _own(before, prefix)}
    out: list[tuple[Spec, Spec | None]] = []
    mine = {s.name: s for s in _own(now, prefix)}
    for name, value in _children(now):
        path = f"{prefix}.{name}" if prefix else name
        if name in mine:
            there = was.get(name)
            if there is None or there.value != value:
                out.append((mine[name], there))
        elif _entries_of(now, name) is not None:
            out.extend(_changed_entries(value, old.get(name) or {}, path))
        elif is_dataclass(value) or isinstance(value, Mapping):
            out.extend(changed(value, old.get(name), path))
    return out


def _entries_of(obj: Any, name: str) -> Mapping[str, Any] | None:
    """How the field `name` of `obj` was declared by `entries`; None where it was not."""
    declared = fields(obj) if is_dataclass(obj) else ()
    return next((f.metadata.get("entries") for f in declared if f.name == name), None)


def _changed_entries(
    now: Mapping[str, float], before: Mapping[str, float], path: str
) -> Iterator[tuple[Spec, Spec | None]]:
    what = path.rpartition(".")[2].replace("_", " ")
    for name in {**before, **now}:
        if before.get(name) != now.get(name):
            mine, old = (
                Spec(f"{path}.{name}", name, values.get(name), "", None, None, None, None,
                     "next frame", "", f"{name}: {what}")
                for values in (now, before)
            )  # fmt: skip
            yield mine, old


def get(obj: Any, path: str) -> Any:
    """The value at `path`, None for an entry that is not there; raises ParamError naming the part
    that does not exist."""
    at, optional = obj, False
    for i, part in enumerate(path.split(".")):
        options = dict(_children(at))
        if part not in options:
            if optional:
                return None
            where = ".".join(path.split(".")[:i]) or "the settings"
            known = ", ".join(options) or "nothing"
            raise ParamError(f"no parameter '{part}' in {where}: it has {known}")
        at, optional = options[part], _entries_of(at, part) is not None
    return at


def put(obj: Any, path: str, value: Any) -> Any:
    """A copy of `obj` with the value at `path` replaced, unchecked (for whole models)."""
    head, _, tail = path.partition(".")
    old = get(obj, head)
    new = put(old, tail, value) if tail else value
    if isinstance(obj, Mapping):
        return {**obj, head: new}
    return dataclasses.replace(obj, **{head: new})


def replace(obj: Any, path: str, value: Any) -> Any:
    """A copy of `obj` with the parameter at `path` set to the validated `value`."""
    return replace_all(obj, {path: value})


def replace_all(obj: Any, values: Mapping[str, Any]) -> Any:
    """A copy of `obj` with several parameters set to their validated values. Those of one owner are
    set together: two limits may both move beyond where the other one was."""
    together: dict[str, dict[str, Any]] = {}
    for path, value in values.items():
        parent, _, name = path.rpartition(".")
        owner = get(obj, parent) if parent else obj
        above, _, field_name = parent.rpartition(".")
        optional = _entries_of(get(obj, above) if above else obj, field_name)
        if optional is None:
            together.setdefault(parent, {})[name] = _checked(owner, path, name, value)
            continue
        rest = {k: v for k, v in owner.items() if k != name}
        if value is not None:
            rest[name] = check_value(path, value, 0.0, optional)
        obj = put(obj, parent, rest)
    for parent, new in together.items():
        owner = dataclasses.replace(get(obj, parent) if parent else obj, **new)
        obj = put(obj, parent, owner) if parent else owner
    return obj


def _checked(owner: Any, path: str, name: str, value: Any) -> Any:
    """`value` for the parameter `name` of `owner`; raises ParamError when it has none or the value
    does not fit."""
    get(owner, name)
    meta = next(
        (f.metadata.get("param") for f in fields(owner) if f.name == name)
        if is_dataclass(owner)
        else iter(()),
        None,
    )
    if meta is None:
        raise ParamError(f"'{path}' is not a parameter that can be edited")
    return check_value(path, value, getattr(owner, name), meta)
