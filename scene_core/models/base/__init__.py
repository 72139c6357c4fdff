"""What a model is: the abstract base classes and result tuples every model is written against.

A model is a *value*: a frozen dataclass whose fields are Scene's constant parameters and whose
methods are pure functions. A function returns its value and its Jacobian with respect to every
argument; a Jacobian returned as ``None`` is filled in by central differences (`completed`).
Sensor and feature functions are batched: ``(..., n)`` in, ``(..., m)`` and ``(..., m, n)`` out.
Jacobians that are the same for the whole batch may omit the batch axes (they broadcast).

Concrete models are final: nothing inherits from a concrete model.

Source: Davison, *Models and State Representation in Scene*, section 5; Solà, *An EKF-SLAM toolbox
in Matlab*, section 5.
"""

from scene_core.models.base.fault import FAULT_WORDS, Fault, words
from scene_core.models.base.feature import (
    Converted,
    FeatureModel,
    FreePrimitive,
    Glyphs,
    Initialised,
    Particles,
    Primitive,
    Settled,
    Shape,
)
from scene_core.models.base.internal import InternalMeasurement, InternalMeasurementModel
from scene_core.models.base.motion import (
    Lifted,
    MotionModel,
    PositionState,
    Transition,
)
from scene_core.models.base.results import Normalised, Redefined, completed
from scene_core.models.base.sensor import (
    Backprojection,
    Innovation,
    Projection,
    Sensor,
)

__all__ = [
    "FAULT_WORDS",
    "Backprojection",
    "Converted",
    "Fault",
    "FeatureModel",
    "FreePrimitive",
    "Glyphs",
    "Initialised",
    "Innovation",
    "InternalMeasurement",
    "InternalMeasurementModel",
    "Lifted",
    "MotionModel",
    "Normalised",
    "Particles",
    "PositionState",
    "Primitive",
    "Projection",
    "Redefined",
    "Sensor",
    "Settled",
    "Shape",
    "Transition",
    "completed",
    "words",
]
