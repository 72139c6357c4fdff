"""Functions that take one row at a time, found out and fed one by one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np

from scene_core.models.base import FeatureModel, Sensor
from scene_core.models.contracts import Contract, contracts_of

COUNT = 11
"""Rows of a trial: no size of a state, a point or a measurement, so that axes can not be mixed."""


def rows_of(contract: Contract, args: tuple[Any, ...]) -> tuple[int, ...]:
    """Batch axes of a call; () for a function that is not batched, or for a single row."""
    ahead = [
        np.shape(a)[: np.ndim(a) - core]
        for a, core in zip(args, contract.rows, strict=False)
        if core is not None
    ]
    return np.broadcast_shapes(*ahead) if ahead else ()


def looped(one: Callable[..., Any], contract: Contract) -> Callable[..., Any]:
    """A batched function made of one for single rows."""

    def many(self: Any, *args: Any) -> Any:
        lead = rows_of(contract, args)
        if lead == ():
            return one(self, *args)
        count = int(np.prod(lead))
        if count == 0:
            raise ValueError("no row to compute")
        rows = [
            a
            if core is None
            else np.broadcast_to(a, (*lead, *np.shape(a)[np.ndim(a) - core :])).reshape(
                count, *np.shape(a)[np.ndim(a) - core :]
            )
            for a, core in zip(args, contract.rows, strict=True)
        ]
        results = [
            one(self, *(a if c is None else a[i] for a, c in zip(rows, contract.rows, strict=True)))
            for i in range(count)
        ]
        return _stacked(results, lead)

    return many


def _stacked(results: list[Any], lead: tuple[int, ...]) -> Any:
    first: Any = results[0]
    if first is None:
        return None
    if not isinstance(first, tuple):
        return np.stack(results).reshape(*lead, *np.shape(first))
    columns = zip(*results, strict=True)
    parts = [
        None if part is None else np.stack(column).reshape(*lead, *np.shape(part))
        for part, column in zip(cast(Any, first), columns, strict=True)
    ]
    return cast(Any, first)._make(parts)


def not_batched(model: Any, rng: np.random.Generator) -> frozenset[str]:
    """Functions that do not give for a batch what they give for its rows, one after the other.

    A function that fails either way is not among them: the conformance report shows why.
    """
    found = set()
    for name, contract in contracts_of(type(model)).items():
        if not contract.rows or _is_inherited(type(model), name):
            continue
        args = _trial(model, name, rng)
        if args is None:
            continue
        try:
            wanted = looped(lambda self, *a, n=name: getattr(self, n)(*a), contract)(model, *args)
        except Exception:  # it is the user's code: whatever it raises, the report will say
            continue
        try:
            together = getattr(model, name)(*args)
        except Exception:
            found.add(name)
            continue
        if not _same(wanted, together, is_random=name == "h_noisy"):
            found.add(name)
    return frozenset(found)


def _is_inherited(cls: type[Any], name: str) -> bool:
    """Whether a function is the default of its kind, which is batched when what it calls is."""
    base = Sensor if issubclass(cls, Sensor) else FeatureModel
    return getattr(cls, name) is getattr(base, name)


def _same(alone: Any, batch: Any, is_random: bool) -> bool:
    if alone is None or batch is None:
        return alone is batch
    rows: tuple[Any, ...] = alone if isinstance(alone, tuple) else (alone,)
    together: tuple[Any, ...] = batch if isinstance(batch, tuple) else (batch,)
    if len(rows) != len(together):
        return False
    for i, (a, b) in enumerate(zip(rows, together, strict=True)):
        if a is None or b is None:
            if a is not b:
                return False
            continue
        # A Jacobian that is the same for all rows may come without their axis.
        b = np.broadcast_to(b, np.shape(a)) if i and np.ndim(b) == np.ndim(a) - 1 else b
        if np.shape(a) != np.shape(b):
            return False
        if not (is_random or np.allclose(a, b, rtol=1e-9, equal_nan=True)):
            return False
    return True


def _trial(model: Any, name: str, rng: np.random.Generator) -> tuple[Any, ...] | None:
    """Arguments with a batch axis."""
    trials = _of_sensor(model, rng) if isinstance(model, Sensor) else _of_feature(model, rng)
    return trials.get(name)


def _of_sensor(model: Sensor, rng: np.random.Generator) -> dict[str, tuple[Any, ...]]:
    d, pose = model.space.d, model.space.identity()
    lo, hi = np.array(model.limits, dtype=np.float64).T
    z = lo + (hi - lo) * rng.uniform(0.1, 0.9, (COUNT, model.measurement_size))
    k, n = np.asarray(model.calib0), rng.uniform(0.1, 1.0, (COUNT, len(model.unmeasured)))
    X = _points(d, rng)
    S = np.tile(np.eye(model.measurement_size), (COUNT, 1, 1)) * z[:, :1, None] ** 2
    poses = np.tile(pose, (COUNT, 1))
    return {
        "project": (X, k),
        "backproject": (z, n, k),
        "R": (z,),
        "nu": (z, z[::-1]),
        "visibility": (z, X, pose, poses, X),
        "selection_score": (S,),
        "h_noisy": (X, k, rng),
    }


def _of_feature(model: FeatureModel, rng: np.random.Generator) -> dict[str, tuple[Any, ...]]:
    d, pose = model.space.d, model.space.identity()
    ends = [_points(d, rng) for _ in range(2 if model.shape == "segment" else 1)]
    X = np.concatenate(ends, axis=-1)
    y = _states(model, pose, X, rng)
    P = np.eye(model.state_size) * rng.uniform(0.5, 1.5, (COUNT, 1, 1))
    trials: dict[str, tuple[Any, ...]] = {
        "initialise": (pose, X),
        "primitive": (y,),
        "redefine": (y, pose),
        "normalise": (y,),
        "graphics": (y, P),
        "ready": (y, P, pose),
    }
    if model.successor() is not None:
        trials["convert"] = (y,)
    if model.shape == "segment":
        rays = np.stack([end[:, :d] for end in ends], axis=1)
        trials["ends"] = (y, rng.uniform(-1.0, 1.0, (COUNT, 2)))
        trials["along"] = (y, np.zeros(d), rays)
    return trials


def _states(model: FeatureModel, pose: np.ndarray, X: np.ndarray, rng: np.random.Generator) -> Any:
    """States of what is seen, one by one: of a line not every vector is one."""
    try:
        born: list[Any] = [model.initialise(pose, row) for row in X]
        y = np.array([one[0] if isinstance(one, tuple) else one for one in born])
    except Exception:  # it is the user's code: the report will say
        y = np.zeros(0)
    fits = y.shape == (COUNT, model.state_size) and np.isfinite(y).all()
    return y if fits else rng.uniform(0.1, 1.0, (COUNT, model.state_size))


def _points(d: int, rng: np.random.Generator) -> np.ndarray:
    X = rng.standard_normal((COUNT, d + 1))
    X[:, :d] /= np.linalg.norm(X[:, :d], axis=1, keepdims=True)
    X[:, d] = rng.uniform(0.2, 1.5, COUNT)
    return X
