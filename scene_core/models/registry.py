"""All models by kind and name, and which of them fit together.

The built-in ones are found by walking the packages; a user's own are added by `plugins`, as one
immutable value that is replaced as a whole, so any thread may look.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import Any

from scene_core.models.base import (
    FeatureModel,
    InternalMeasurementModel,
    MotionModel,
    Sensor,
)
from scene_core.models.segments import seen_by

KINDS: Mapping[str, type[Any]] = MappingProxyType(
    {
        "motion": MotionModel,
        "sensors": Sensor,
        "features": FeatureModel,
        "internal": InternalMeasurementModel,
    }
)
"""Base class by kind; a kind is the name of the package its models are found in."""


@dataclass(frozen=True)
class Added:
    """Models that are not built in, by kind and name."""

    offered: Mapping[str, Mapping[str, type[Any]]] = field(default_factory=dict)
    refused: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """Why a model that is there can not be used."""


_added = Added()


def add(added: Added) -> None:
    """Replace everything that was added before."""
    global _added
    _added = added


def models(kind: str) -> Mapping[str, type[Any]]:
    """Model classes of a kind by name: the built-in ones sorted by the name of their files, then
    those that were added.

    Raises KeyError for an unknown kind, ValueError when two models share a name.
    """
    return MappingProxyType({**built_in(kind), **_added.offered.get(kind, {})})


def refused(kind: str) -> Mapping[str, str]:
    """Added models of a kind that can not be used, with a sentence why."""
    return _added.refused.get(kind, {})


@cache
def built_in(kind: str) -> Mapping[str, type[Any]]:
    """The built-in model classes of a kind by name."""
    base: Any = KINDS[kind]
    package = importlib.import_module(f"scene_core.models.{kind}")
    found: dict[str, type[Any]] = {}
    for entry in sorted(pkgutil.iter_modules(package.__path__), key=lambda m: m.name):
        module = importlib.import_module(f"{package.__name__}.{entry.name}")
        members: list[tuple[str, Any]] = inspect.getmembers(module, inspect.isclass)
        for _, cls in members:
            own = cls.__module__ == module.__name__ and not inspect.isabstract(cls)
            if own and base in cls.__mro__:
                if cls.name in found:
                    raise ValueError(f"two models of kind {kind} are called '{cls.name}'")
                found[cls.name] = cls
    return MappingProxyType(found)


def model_class(kind: str, name: str) -> type[Any]:
    """The class of a model; raises KeyError with the known names when there is none."""
    known = models(kind)
    if name not in known:
        raise KeyError(f"no model '{name}' of kind {kind}: there are {', '.join(known)}")
    return known[name]


def kind_of(model: Any) -> str:
    """The kind of a model instance; raises TypeError when it is none."""
    for kind, base in KINDS.items():
        if isinstance(model, base):
            return kind
    raise TypeError(f"{type(model).__name__} is not a model: there are {', '.join(KINDS)}")


def compatible(sensor: Sensor, feature: FeatureModel) -> str | None:
    """Why `sensor` can not initialise features of this model; None when it can.

    A refused pair may still observe. Particles stand for what the first measurement left open: with
    nothing open they would repeat, as if it were news, what the sensor measured once.
    """
    reason = observable(sensor, feature)
    if reason:
        return reason
    missing = [name for name in sensor.unmeasured if name not in feature.unmeasured]
    if missing:
        return (
            f"'{sensor.name}' leaves {', '.join(missing)} open and '{feature.name}' has no prior "
            "for it: such a feature can only be known from the start or converted from another"
        )
    if feature.free_labels and not sensor.unmeasured:
        return (
            f"'{sensor.name}' leaves nothing open: there is nothing for the particles of "
            f"'{feature.name}' to find out"
        )
    return None


def observable(sensor: Sensor, feature: FeatureModel) -> str | None:
    """Why `sensor` can not measure features of this model; None when it can."""
    if sensor.space.name != feature.space.name:
        return (
            f"'{sensor.name}' measures {sensor.space.name} points, '{feature.name}' is a "
            f"{feature.space.name} point"
        )
    if feature.shape == "segment":
        return seen_by(sensor)
    return None


def carriable(motion: MotionModel, sensor: Sensor) -> str | None:
    """Why a robot can not carry `sensor`; None when it can: poses are embedded upwards only."""
    if sensor.space.d < motion.space.d:
        return (
            f"'{sensor.name}' lives in {sensor.space.name} and '{motion.name}' moves in "
            f"{motion.space.name}: a sensor can not have fewer dimensions than its robot"
        )
    return None


def runs_on(internal: InternalMeasurementModel, motion: MotionModel) -> str | None:
    """Why an internal measurement can not run on a motion model; None when it can."""
    missing = [label for label in internal.needs if label not in motion.state_labels]
    if missing:
        return f"'{internal.name}' needs {', '.join(missing)}, which '{motion.name}' does not have"
    if "gravity" in internal.world_fixed and motion.space.d < 3:
        return (
            f"'{internal.name}' measures along the vertical, and '{motion.name}' moves in "
            f"{motion.space.name}, without one"
        )
    return None
