"""Which classes may stand where an experiment names an abstract one, and the words for them."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from dataclasses import is_dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import scene_core.sources
from scene_core.filter.ports import Source
from scene_core.models import registry

SOURCES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "simulation": ("scene_core.sources.simulated", "Simulation"),
        "images": ("scene_core.sources.images", "ImageSequence"),
        "mrclam": ("scene_core.sources.datasets", "Mrclam"),
        "mrpt": ("scene_core.sources.mrpt", "Mrpt"),
        "planar mono": ("scene_core.sources.planar_mono", "PlanarMono"),
        "starry night": ("scene_core.sources.starry_night", "StarryNight"),
        "tag box": ("scene_core.sources.tagbox", "Tagbox"),
    }
)
"""Module and class by the word a settings file uses."""


def variants(hint: Any) -> tuple[str, Mapping[str, type[Any]]] | None:
    """The key that names the class ("model" or "kind") and the classes by name, for an abstract
    type; None for a concrete one."""
    kind = model_kind(hint)
    return _others(hint) if kind is None else ("model", registry.models(kind))


def model_kind(hint: Any) -> str | None:
    """The kind of model a base class stands for."""
    return next((kind for kind, base in registry.KINDS.items() if hint is base), None)


def why_not(hint: Any, name: object) -> str:
    """Why a model that is there can not be used, or where else there may be one; or nothing."""
    kind = model_kind(hint)
    if kind is None:
        return ""
    if isinstance(name, str) and name in registry.refused(kind):
        return f"; {registry.refused(kind)[name]}"
    return "; one of your own needs --models with its folder"


@cache
def _others(hint: Any) -> tuple[str, Mapping[str, type[Any]]] | None:
    """The same for everything that is no model: it never changes."""
    if hint is Source:
        return "kind", {k: _imported(module, name) for k, (module, name) in SOURCES.items()}
    if inspect.isclass(hint) and inspect.isabstract(hint):
        for module in pkgutil.iter_modules(scene_core.sources.__path__):
            importlib.import_module(f"scene_core.sources.{module.name}")
        return "kind", {cls.name: cls for cls in _final(hint)}
    return None


def word(hint: Any, value: Any) -> str:
    """The name of the class of `value` among the variants of `hint`."""
    if model_kind(hint) is not None:
        return value.name
    found = variants(hint)
    assert found is not None
    return next(name for name, cls in found[1].items() if cls is type(value))


def _imported(module: str, name: str) -> type[Any]:
    return getattr(importlib.import_module(module), name)


def _final(base: type[Any]) -> list[type[Any]]:
    """Concrete dataclasses below an abstract class, in the order of their definition."""
    out = []
    for cls in base.__subclasses__():
        if is_dataclass(cls) and not inspect.isabstract(cls):
            out.append(cls)
        out += _final(cls)
    return out
