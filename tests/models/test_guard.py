"""A user's class on guard: functions of single rows are fed one by one, calls are claimed."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from scene_core.models import guard, registry
from scene_core.models.base import Projection
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.rows import not_batched
from scene_core.models.sensors.range_bearing import RangeBearing

FED = ("sensors", "features")


class Alone(RangeBearing):
    """Written for single points."""

    def project(self, X, k):  # type: ignore[no-untyped-def]
        assert X.ndim == 1
        return Projection(super().project(X, k).h)

    def visibility(self, h, X, xws, pose0, y_X):  # type: ignore[no-untyped-def]
        return int(h[0] > self.reach_max)


def test_a_function_for_single_rows_is_found_out_and_fed_row_by_row() -> None:
    alone, rng = not_batched(Alone(), np.random.default_rng(0)), np.random.default_rng(1)
    assert alone == {"project", "visibility"}
    model, plain = guard.guarded(Alone, alone)(), RangeBearing()
    X = np.abs(rng.standard_normal((2, 3, 3))) + 0.1
    k = np.zeros(0)
    assert np.array_equal(model.project(X, k).h, plain.project(X, k).h)
    assert np.array_equal(model.project(X[0, 0], k=k).h, plain.project(X[0, 0], k).h)
    h, pose = plain.project(X[0], k).h, np.zeros(3)
    fault = model.visibility(h, X[0], pose, np.zeros((3, 3)), X[0])
    assert np.array_equal(fault, (h[:, 0] > plain.reach_max).astype(int))
    assert model.h_noisy(X[0], k, rng).shape == (3, 2)


@pytest.mark.parametrize("cls", [c for k in FED for c in registry.built_in(k).values()])
def test_the_built_in_models_are_all_batched(cls: type) -> None:
    assert not_batched(cls(), np.random.default_rng(0)) == frozenset()


def test_a_guarded_class_stays_what_it_was() -> None:
    cls = guard.guarded(PlanarUnicycle)
    assert guard.is_guarded(cls) and not guard.is_guarded(PlanarUnicycle)
    assert cls.__name__ == "PlanarUnicycle" and not inspect.isabstract(cls)
    assert cls(sd_v=0.3) == cls(sd_v=0.3) and hash(cls()) == hash(cls())
    xv, u = np.array([1.0, 2.0, 0.3]), np.array([0.2, 0.1])
    ours, theirs = cls().f(xv, u, 0.1, np.zeros(0)), PlanarUnicycle().f(xv, u, 0.1, np.zeros(0))
    for mine, other in zip(ours, theirs, strict=True):
        assert mine is not None and other is not None and np.array_equal(mine, other)


def test_whoever_claims_a_call_first_has_it() -> None:
    call = guard.Call(PlanarUnicycle(), "f")
    assert call.claim() and not call.claim()
    assert guard.under_way(None) is None
