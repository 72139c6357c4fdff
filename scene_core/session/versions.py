"""Models whose file was saved again: which of them are outdated, and their new versions."""

from __future__ import annotations

from typing import Any

from scene_core.models import guard, registry
from scene_core.models.library import carried


def is_outdated(model: Any) -> bool:
    """Whether the file of a user's model was saved again, in a version that can be used."""
    if model is None:
        return False
    cls = type(model)
    if not guard.is_guarded(cls):
        return False
    now = registry.models(registry.kind_of(model)).get(model.name)
    return now is not None and now is not cls


def latest(model: Any) -> Any:
    """The model, in the version its file holds now."""
    return made(registry.kind_of(model), model.name, model) if is_outdated(model) else model


def made(kind: str, name: str, old: Any) -> Any:
    """A model with its defaults; the new version of `old`, or a sensor that can not be fitted to
    it, with the parameters of the same name that are not at their defaults."""
    cls = registry.model_class(kind, name)
    if old is None:
        return cls()
    keeps = old.name == name or (kind == "sensors" and not hasattr(cls, "with_calib"))
    return carried(old, cls) if keeps else cls()
