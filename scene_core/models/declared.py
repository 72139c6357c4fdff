"""Whether a file declares models, told from its text: a folder may hold ordinary scripts as well,
and a script must not be run to find out that it is one.

A model file imports from `scene_core.models`, or `scene_core` as a whole, and derives a class from
what it imports there, from another such class of its own, or from a name of which nothing is known.
"""

from __future__ import annotations

import ast
import builtins
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from scene_core.text_file import text_of

PACKAGE = "scene_core.models"


def declares_models(path: Path) -> bool:
    """Whether a file is to be loaded. One that can not be parsed is, if its text names the package
    of the models: what is wrong with it is then said like that of any other model file."""
    try:
        text = text_of(path, "a Python file")
    except ValueError:
        return True  # whoever loads it says why it can not be read
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return PACKAGE in text
    names = dict(_imported(tree))
    if not any(_inside(name) or _inside(PACKAGE, name) for name in names.values()):
        return False
    found = False
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            is_model = any(_is_model(base, names) for base in node.bases)
            names[node.name] = f"{PACKAGE}.{node.name}" if is_model else node.name
            found |= is_model
    return found


def without_base(path: Path, bases: Collection[str]) -> str:
    """The class of a file that was to be a model and derives from nothing, as a sentence; empty
    when there is none. It is a dataclass beside an import of one of these bases that no class uses.
    """
    try:
        tree = ast.parse(text_of(path, "a Python file"))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ""
    names = dict(_imported(tree))
    wanted = [n for n, whole in names.items() if _inside(whole) and whole.split(".")[-1] in bases]
    for node in tree.body if wanted else ():
        if isinstance(node, ast.ClassDef) and not node.bases and _is_dataclass(node):
            return (
                f"{path.name}, line {node.lineno}: {node.name} is no model: write class "
                f"{node.name}({wanted[0]})"
            )
    return ""


def _is_dataclass(node: ast.ClassDef) -> bool:
    return any("dataclass" in ast.unparse(mark) for mark in node.decorator_list)


def _imported(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Names that imports bind anywhere in a file, with what they stand for."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for one in node.names:
                yield one.asname or one.name, f"{node.module}.{one.name}"
        elif isinstance(node, ast.Import):
            for one in node.names:
                yield one.asname or one.name, one.name


def _is_model(base: ast.expr, names: Mapping[str, str]) -> bool:
    """Whether a base class comes from the models, or may come from them: a misspelt one has to be
    complained about, not passed over."""
    while isinstance(base, ast.Subscript | ast.Call):
        base = base.value if isinstance(base, ast.Subscript) else base.func
    whole = ast.unparse(base).split(".")
    for k in range(len(whole), 0, -1):
        known = names.get(".".join(whole[:k]))
        if known is not None:
            return _inside(".".join([known, *whole[k:]]))
    return not hasattr(builtins, whole[0])


def _inside(name: str, package: str = PACKAGE) -> bool:
    return f"{name}.".startswith(f"{package}.")
