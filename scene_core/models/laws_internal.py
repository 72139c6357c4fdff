"""What an internal measurement model must obey."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import Fault, InternalMeasurementModel
from scene_core.models.judge import (
    DRAWS,
    Law,
    angles_of,
    first,
    judge_jacobians,
    not_covariance,
    not_equal,
    not_shaped,
    not_spread_like,
    tried,
)
from scene_core.models.trial_states import with_unit_quaternion


@dataclass(frozen=True)
class _Trial:
    """An internal measurement model, and what it is tried at."""

    model: InternalMeasurementModel
    rng: np.random.Generator
    states: list[Vec]
    """Values of the needed components."""

    @property
    def angles(self) -> np.ndarray:
        return angles_of(self.model.units)


def internal_laws(model: InternalMeasurementModel, rng: np.random.Generator) -> list[Law]:
    """The laws of an internal measurement model, ready to be tried."""
    states = [
        with_unit_quaternion(model.needs, rng.standard_normal(len(model.needs))) for _ in range(5)
    ]
    return tried(_Trial(model, rng, states), _LAWS)


def _function(t: _Trial) -> str:
    model, problems = t.model, []
    for needed in t.states:
        problems.append(judge_jacobians(["dhv"], model.h, (needed,), t.angles))
        problems.append(not_shaped("hv", model.h(needed).hv, (model.measurement_size,)))
    rest = model.h(with_unit_quaternion(model.needs, np.zeros(len(model.needs))))
    if not all(np.isfinite(part).all() for part in rest if part is not None):
        problems.append("h is not finite at zero")
    return first(problems)


def _noise(t: _Trial) -> str:
    model, m = t.model, t.model.measurement_size
    hv = model.h(t.states[0]).hv
    turned = model.nu(hv, hv + 2.0 * np.pi * t.angles)
    return first(
        [
            not_equal("nu(h, h)", model.nu(hv, hv), np.zeros(m)),
            not_equal("nu after a full turn", turned, np.zeros(m)),
            not_covariance("R", model.R(hv), m),
        ]
    )


def _feasibility(t: _Trial) -> str:
    said = (t.model.feasible(needed, t.model.h(needed).hv) for needed in t.states)
    if all(isinstance(fault, Fault) for fault in said):
        return ""
    return "feasible does not return a Fault"


def _noisy(t: _Trial) -> str:
    model, needed = t.model, t.states[0]
    hv = model.h(needed).hv
    draws = np.array([model.h_noisy(needed, t.rng) for _ in range(DRAWS)])
    return not_spread_like(draws, hv, model.R(hv), t.angles)


_LAWS = (
    ("h has the right Jacobian, finite at zero", _function),
    ("R is a covariance, nu(h, h) is zero, angles wrap", _noise),
    ("feasible returns a Fault", _feasibility),
    ("h_noisy spreads as R says", _noisy),
)
