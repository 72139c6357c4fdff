"""What the functions of a model return, as data: the shapes behind the docstrings of `base`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from scene_core.models import base
from scene_core.models.base import FeatureModel, InternalMeasurementModel, MotionModel, Sensor


@dataclass(frozen=True)
class Contract:
    """Result of one function.

    A shape is written in letters, "n u" for (n, u): n state, u controls, k calibration, p position
    state, m measurement, X homogeneous point or points, o what is left open, d spatial dimensions,
    s successor's state, e ends of a segment, q needed components. Functions with `rows` are
    batched.
    """

    parts: tuple[str, ...]
    """Shapes of the value and of its Jacobians, without batch axes."""
    result: Any = None
    """The tuple they come in; None: a bare array."""
    rows: tuple[int | None, ...] = ()
    """For every argument how many axes belong to one row; None where it is not batched."""
    dtype: type = float
    may_be_none: bool = False
    is_finite: bool = True
    """False for what need not exist, like the place where two parallels meet."""


MOTION = {
    "f": Contract(("n", "n n", "n u", "n k"), base.Transition),
    "Q": Contract(("n n",)),
    "U": Contract(("u u",)),
    "U_unknown": Contract(("u u",)),
    "xp": Contract(("p", "p n"), base.PositionState),
    "redefine": Contract(("n", "n n", "n p"), base.Redefined),
    "normalise": Contract(("n", "n n"), base.Normalised),
    "lift": Contract(("n", "n p", "n n"), base.Lifted),
    "f_noisy": Contract(("n",)),
    "stay": Contract(("u",)),
    "navigate": Contract(("u",), may_be_none=True),
}
SENSOR = {
    "project": Contract(("m", "m X", "m k"), base.Projection, (1, None)),
    "backproject": Contract(("X", "X m", "X o", "X k"), base.Backprojection, (1, 1, None)),
    "R": Contract(("m m",), rows=(1,)),
    "nu": Contract(("m", "m m", "m m"), base.Innovation, (1, 1)),
    "visibility": Contract(("",), rows=(1, 1, None, 1, 1), dtype=int),
    "selection_score": Contract(("",), rows=(2,)),
    "h_noisy": Contract(("m",), rows=(1, None, None)),
}
FEATURE = {
    "initialise": Contract(("n", "n p", "n X"), base.Initialised, (None, 1)),
    "primitive": Contract(("X", "X n"), base.Primitive, (1,)),
    "redefine": Contract(("n", "n n", "n p"), base.Redefined, (1, None)),
    "normalise": Contract(("n", "n n"), base.Normalised, (1,), may_be_none=True),
    "graphics": Contract(("d", "d d"), base.Glyphs, (1, 2)),
    "ready": Contract(("",), rows=(1, 2, None), dtype=bool),
    "convert": Contract(("s", "s n"), base.Converted, (1,)),
    "ends": Contract(("X",), rows=(1, 1)),
    "along": Contract(("e",), rows=(1, None, 2), is_finite=False),
}
INTERNAL = {
    "h": Contract(("m", "m q"), base.InternalMeasurement),
    "R": Contract(("m m",)),
    "nu": Contract(("m",)),
    "h_noisy": Contract(("m",)),
}
BY_BASE: Mapping[type, Mapping[str, Contract]] = MappingProxyType(
    {
        MotionModel: MOTION,
        Sensor: SENSOR,
        FeatureModel: FEATURE,
        InternalMeasurementModel: INTERNAL,
    }
)


def contracts_of(cls: type[Any]) -> Mapping[str, Contract]:
    """Contract by function of a model class."""
    return next(table for kind, table in BY_BASE.items() if issubclass(cls, kind))


def dimensions(model: Any, function: str, args: tuple[Any, ...]) -> Mapping[str, int]:
    """Size by letter; a letter whose size only the call itself knows is not in it."""
    match model:
        case MotionModel():
            sizes = dict(n=model.state_size, u=len(model.control_labels), k=len(model.calib_labels))
            return {**sizes, "p": model.space.n}
        case Sensor():
            X = model.space.d + 1
            sizes = dict(m=model.measurement_size, k=len(model.calib_labels))
            if function in ("project", "h_noisy") and np.shape(args[0])[-1] != X:
                return {}  # a segment
            if function == "backproject" and np.shape(args[0])[-1] != model.measurement_size:
                return {}
            return {**sizes, "X": X, "o": len(model.unmeasured)}
        case FeatureModel():
            ends = 2 if model.shape == "segment" else 1
            sizes = dict(n=model.state_size, p=model.space.n, d=model.space.d, e=2)
            sizes["X"] = ends * (model.space.d + 1)
            after = model.successor()
            return sizes if after is None else {**sizes, "s": after.state_size}
        case InternalMeasurementModel():
            return {"m": model.measurement_size, "q": len(model.needs)}
        case _:
            raise TypeError(f"{type(model).__name__} is not a model")
