"""The conformance check: does a model keep the promises its base class makes in its name?

The same function tests the built-in models and certifies a user's own file before it may be
swapped in.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scene_core.models.base import FeatureModel, InternalMeasurementModel, MotionModel, Sensor
from scene_core.models.judge import Law, Line, Report, run
from scene_core.models.laws_motion import internal_laws, motion_laws
from scene_core.models.laws_observation import feature_laws, sensor_laws
from scene_core.models.registry import kind_of

__all__ = ["Line", "Report", "check"]


def check(model: Any, seed: int = 0) -> Report:
    """Every law a model must obey, tried at random and awkward states.

    `model` is an instance, or a class whose parameters all have defaults. Raises TypeError when it
    is no model at all; whatever the model itself raises is part of the report.
    """
    if isinstance(model, type):
        model = model()
    kind = kind_of(model)
    return run(model.name, kind, _laws(model, np.random.default_rng(seed)))


def _laws(model: Any, rng: np.random.Generator) -> list[Law]:
    match model:
        case MotionModel():
            return motion_laws(model, rng)
        case Sensor():
            return sensor_laws(model, rng)
        case FeatureModel():
            return feature_laws(model, rng)
        case InternalMeasurementModel():
            return internal_laws(model, rng)
        case _:
            raise TypeError(f"{type(model).__name__} is not a model")
