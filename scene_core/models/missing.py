"""What keeps a file from being executed to its end, in words: names that are not there, above all
those that were misspelt."""

from __future__ import annotations

import ast
import builtins
import importlib
import pkgutil
import re
import sys
from collections.abc import Iterable
from difflib import get_close_matches
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from scene_core.text_file import text_of

PACKAGE = "scene_core"
USUAL = ("numpy", PACKAGE, "dataclasses", "math", "scipy", "typing", "matplotlib")
"""What is meant rather than another module of a name as close."""
ALONE = "a file of models stands alone: write what it needs into it, or import it from a package"
_NO_NAME = re.compile("cannot import name '(.+?)' from '(.+?)'")


def described(error: BaseException, path: Path, module: ModuleType) -> str:
    """What executing a file as a module raised, with what was probably meant."""
    text = f"{type(error).__name__}: {error}"
    match error:
        case ModuleNotFoundError() if error.name:
            return text + _instead_of_module(error.name, path.parent)
        case ImportError():
            if found := _NO_NAME.match(str(error)):
                return f"{type(error).__name__}: {_no_name(*found.groups())}"
            return f"{text}; {ALONE}" if "relative import" in str(error) else text
        case NameError() if error.name:
            return text + _meant(error.name, [*vars(module), *dir(builtins)])
    return text


def broken_import(path: Path) -> str:
    """The first import of a script that would fail, as a sentence, found without running it; empty
    when there is none. Only what is imported in any case counts."""
    try:
        tree = ast.parse(text_of(path, "a Python file"))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ""
    for node in tree.body:
        for wrong in _wrong(node, path.parent):
            return f"{path.name}, line {node.lineno}: {wrong}"
    return ""


def _wrong(node: ast.stmt, folder: Path) -> Iterable[str]:
    if isinstance(node, ast.Import):
        for one in node.names:
            if _missing(one.name, folder):
                yield _no_module(one.name, folder)
    elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
        if _missing(node.module, folder):
            yield _no_module(node.module, folder)
        elif node.module.split(".")[0] == PACKAGE:
            # Only what is known to do nothing else when it is imported.
            found = importlib.import_module(node.module)
            for one in node.names:
                inside = f"{node.module}.{one.name}"
                if one.name != "*" and not hasattr(found, one.name) and _missing(inside, folder):
                    yield f"ImportError: {_no_name(one.name, node.module)}"


def _no_name(name: str, module: str) -> str:
    there = dir(sys.modules[module]) if module in sys.modules else []
    return f"cannot import name '{name}' from '{module}'" + _meant(name, there)


def _missing(name: str, folder: Path) -> bool:
    """Whether there is no such module. A package that is not ours is not imported to look."""
    first = name.split(".")[0]
    if (folder / f"{first}.py").exists() or (folder / first).is_dir():
        return False  # a script finds its neighbours
    try:
        return find_spec(name if first == PACKAGE else first) is None
    except ImportError:
        return True
    except ValueError:
        return False  # a module without a file of its own, like __main__


def _no_module(name: str, folder: Path) -> str:
    """In the words of the import itself: the first part of the name that is not there."""
    parts = name.split(".")
    ahead = (".".join(parts[:k]) for k in range(1, len(parts) + 1))
    first = next(part for part in ahead if _missing(part, folder))
    return f"ModuleNotFoundError: No module named '{first}'" + _instead_of_module(first, folder)


def _instead_of_module(name: str, folder: Path) -> str:
    """What to do about a module that is not there."""
    parent, _, last = name.rpartition(".")
    if not parent and ((folder / f"{name}.py").exists() or (folder / name).is_dir()):
        return f"; {ALONE}"
    try:
        path = importlib.import_module(parent).__path__ if parent else None
    except (ImportError, AttributeError):
        return ""
    there = [found.name for found in pkgutil.iter_modules(path)]
    usual = () if parent else USUAL
    return _meant(last, usual) or _meant(last, there)


def _meant(name: str, there: Iterable[str]) -> str:
    close = closest(name, there)
    return f"; did you mean {close}?" if close else ""


def closest(name: str, there: Iterable[str]) -> str:
    """The public name that this one was probably to be, or nothing."""
    return next(iter(get_close_matches(name, [n for n in there if n[0] != "_"], 1, 0.75)), "")
