"""A user's own models: files of a folder, and packages that announce themselves.

A file is executed under a private module name every time it is saved, so the new class stands
beside the old one and running frames keep theirs. Whatever is wrong with a file is one sentence;
the other files and its own earlier version stay.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import itertools
import linecache
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass, replace
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from threading import Thread
from types import ModuleType
from typing import Any

import numpy as np

from scene_core import params
from scene_core.models import guard
from scene_core.models.check import check, no_default
from scene_core.models.contracts import contracts_of
from scene_core.models.judge import Report, raised
from scene_core.models.missing import closest, described
from scene_core.models.registry import KINDS, built_in
from scene_core.models.rows import not_batched
from scene_core.text_file import text_of

GROUP = "scene.models"
"""Entry points of this group name a module with models, or a model class."""

PATIENCE_S = 20.0
"""A file that takes longer to load and check is left out."""

NEEDED: Mapping[str, tuple[str, ...]] = {
    "motion": ("name", "space", "state_labels", "state_units"),
    "sensors": ("name", "space", "pane", "measurement_size", "labels", "units"),
    "features": ("name", "space", "state_labels", "state_units"),
    "internal": ("name", "needs", "labels", "units"),
}
"""What a class of a kind must say of itself."""

LONGEST_NAME = 60
_LOADERS = (str(Path(importlib.__file__).parent), __file__, "<")
"""Where the files begin that load a package and are none of it."""


@dataclass(frozen=True)
class UserModel:
    """One model class of a user's file."""

    file: str
    line: int
    kind: str
    name: str
    cls: type[Any] | None
    """The guarded class; None when there is none to be had."""
    report: Report | None = None
    problem: str = ""
    """Why it can not be used, one sentence; empty when it conforms."""

    @property
    def conforms(self) -> bool:
        return not self.problem


@dataclass(frozen=True)
class UserFile:
    """A file as it was last saved."""

    name: str
    models: tuple[UserModel, ...] = ()
    problem: str = ""
    """Why nothing of it can be used, one sentence."""


_loads = itertools.count(1)


def load_file(path: str | Path) -> UserFile:
    """Execute a file and check the models it defines. Nothing the file does is raised."""
    path = Path(path)
    try:
        text = text_of(path, "a Python file")
        lines = _class_lines(ast.parse(text, str(path)))
        code = compile(text, str(path), "exec", dont_inherit=True)
    except SyntaxError as e:
        where = f"{path.name}, line {e.lineno}" if e.lineno else path.name
        return UserFile(path.name, problem=f"{where}: {e.msg}")
    except (RecursionError, MemoryError):
        return UserFile(path.name, problem=f"{path.name} is nested too deeply: write it plainly")
    except ValueError as e:
        return UserFile(path.name, problem=str(e))
    # Never a cached bytecode: two saves within a second must be two versions.
    module = ModuleType(f"_scene_models_{next(_loads)}_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    linecache.checkcache(str(path))
    try:
        exec(code, module.__dict__)
    except (Exception, SystemExit, KeyboardInterrupt) as e:
        del sys.modules[module.__name__]
        return UserFile(path.name, problem=f"{_place(path, e)}: {described(e, path, module)}")
    return _file_of(path.name, _classes(module), lines)


def load_entry_point(entry: EntryPoint) -> UserFile:
    """The models of an installed package."""
    name = f"{entry.name} ({entry.value})"
    try:
        found = entry.load()
    except (Exception, SystemExit, KeyboardInterrupt) as e:
        return UserFile(
            name, problem=f"{name} can not be loaded: {_line(e)}{type(e).__name__}: {e}"
        )
    classes = _classes(found) if isinstance(found, ModuleType) else [found]
    return _file_of(name, [c for c in classes if isinstance(c, type)], {})


def installed() -> tuple[UserFile, ...]:
    """The models of all installed packages that announce some."""
    return tuple(
        in_time(e.name, lambda e=e: load_entry_point(e)) for e in entry_points(group=GROUP)
    )


def in_time(name: str, load: Any) -> UserFile:
    """What `load` returns, unless it takes too long: then a sentence in which function."""
    done: list[UserFile] = []
    thread = Thread(target=lambda: done.append(_loaded(name, load)), daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    if done:
        return done[0]
    call = guard.under_way(thread.ident)
    what = f"'{call.model}'.{call.method} did not return" if call else "it was not loaded"
    if call is not None:
        call.claim()
    return UserFile(name, problem=f"{name} was left out: {what} within {PATIENCE_S:g} s")


def _loaded(name: str, load: Any) -> UserFile:
    try:
        return load()
    except guard.Abandoned:
        return UserFile(name)  # nobody waits for it any more
    except BaseException as e:  # a class may raise whatever it likes whenever it is looked at
        return UserFile(name, problem=f"{name} was left out: {raised(e)}")


def _class_lines(tree: ast.Module) -> dict[str, int]:
    return {node.name: node.lineno for node in tree.body if isinstance(node, ast.ClassDef)}


def _place(path: Path, error: BaseException) -> str:
    """File and line of what went wrong while a file was executed."""
    rows = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
    return f"{path.name}, line {rows[-1]}" if rows else path.name


def _line(error: BaseException) -> str:
    """File and line of a package in which an error arose, if it was run at all."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if not f.filename.startswith(_LOADERS)]
    return f"{Path(own[-1].filename).name}, line {own[-1].lineno}: " if own else ""


def _classes(module: ModuleType) -> list[type[Any]]:
    """Model classes a module defines itself, in the order of their definition."""
    bases = tuple(KINDS.values())
    found = [
        cls
        for name, cls in vars(module).items()
        if isinstance(cls, type)
        and issubclass(cls, bases)
        and cls.__module__ == module.__name__
        and not name.startswith("_")
    ]
    return list(dict.fromkeys(found))  # one may have two names


def _file_of(name: str, classes: list[type[Any]], lines: Mapping[str, int]) -> UserFile:
    models: list[UserModel] = []
    for cls in classes:
        model = _model(name, lines.get(cls.__name__, 0), cls)
        if model.conforms and any((m.kind, m.name) == (model.kind, model.name) for m in models):
            where = f"{name}, line {model.line}" if model.line else name
            problem = f"{where}: '{model.name}' is the name of a model before it: give it another"
            model = replace(model, problem=problem)
        models.append(model)
    return UserFile(name, tuple(models)) if models else without_model(name)


def without_model(name: str) -> UserFile:
    """A file in which there is nothing to use."""
    bases = ", ".join(base.__name__ for base in KINDS.values())
    return UserFile(
        name,
        problem=f"{name} defines no model: derive a frozen dataclass from one of {bases}, not "
        "within a function, with a name that does not begin with _",
    )


def _model(file: str, line: int, cls: type[Any]) -> UserModel:
    """A class of the user's, guarded and checked."""
    kind = next((k for k, base in KINDS.items() if issubclass(cls, base)), "")
    where = f"{file}, line {line}" if line else file
    name = getattr(cls, "name", cls.__name__)
    name = name if isinstance(name, str) else cls.__name__
    wrong = _undeclared(cls, kind)
    if wrong:
        return UserModel(file, line, kind, name, None, problem=f"{where}: {wrong}")
    try:
        plain = cls()
        unbatched = not_batched(plain, np.random.default_rng(0)) if _has_rows(kind) else frozenset()
    except Exception as e:  # it is the user's code: whatever it raises is a sentence
        problem = f"{where}: {cls.__name__} can not be made: {type(e).__name__}: {e}"
        return UserModel(file, line, kind, name, None, problem=problem)
    params.field_docs(cls)  # now, while the file is what was loaded
    guarded = guard.guarded(cls, unbatched)
    params.field_docs(guarded)
    report = check(guarded)
    failed = [line for line in report.lines if not line.ok]
    problem = ""
    if failed:
        first = f"{failed[0].law}: {failed[0].detail}"
        problem = f"{where}: '{name}' does not conform: {first}"
        problem += f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
    elif name in built_in(kind):
        problem = f"{where}: '{name}' is the name of a built-in model: give it another"
    return UserModel(file, line, kind, name, guarded, report, problem)


def _signature(cls: type[Any], base: type[Any], function: str) -> str:
    """How a function can not be called as it will be, as a sentence; or nothing."""
    method, wanted = getattr(cls, function), inspect.signature(getattr(base, function))
    names = ", ".join(
        p.name if p.default is p.empty else f"{p.name}={p.default!r}"
        for p in wanted.parameters.values()
    )
    write = f"write def {function}({names})"
    if not callable(method):
        return f"{cls.__name__}.{function} is {method!r}, no function: {write}"
    own = inspect.signature(method)
    try:
        own.bind(*wanted.parameters)
    except TypeError:
        return f"{cls.__name__}.{function} takes ({', '.join(own.parameters)}): {write}"
    return ""


def _has_rows(kind: str) -> bool:
    return kind in ("sensors", "features")


def _undeclared(cls: type[Any], kind: str) -> str:
    """What a class fails to say of itself, as a sentence; empty when it can be tried."""
    title = cls.__name__
    if not kind:
        return f"{title} is no model: derive it from one of {', '.join(KINDS)}"
    if inspect.isabstract(cls):
        missing = ", ".join(sorted(cls.__abstractmethods__))
        return f"{title} is not complete: write {missing}"
    own = vars(cls).get("__dataclass_params__")
    if not is_dataclass(cls) or own is None or not own.frozen:
        return f"{title} is not frozen: write @dataclass(frozen=True) above it"
    missing = [a for a in NEEDED[kind] if not hasattr(cls, a)]
    if missing:
        found = closest(missing[0], vars(cls))
        instead = f": write {missing[0]} for {found}" if found else ""
        return f"{title} does not say its {', '.join(missing)}{instead}"
    for function in contracts_of(cls):
        wrong = _signature(cls, KINDS[kind], function)
        if wrong:
            return wrong
    name = cls.name
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        return f"{title}.name = {name!r}: give a text"
    if len(name) > LONGEST_NAME:
        return f"{title}.name is longer than {LONGEST_NAME} characters"
    return no_default(cls)
