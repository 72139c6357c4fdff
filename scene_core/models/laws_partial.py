"""What a feature model with free parameters must obey besides what every one does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import FeatureModel, Particles
from scene_core.models.judge import (
    COUNT,
    Law,
    angles_of,
    first,
    judge_jacobians,
    not_covariance,
    not_equal,
    not_shaped,
    projectively_equal,
    tried,
)
from scene_core.models.trial_states import sample_pose, sample_rays


@dataclass(frozen=True)
class _Trial:
    """A partial feature model, and what it is tried at."""

    model: FeatureModel
    xws: Vec
    """The sensor's pose at the first view."""
    xpdef: Vec
    """A new origin."""
    X: Vec
    """What is seen (COUNT, d+1), in the sensor's frame."""
    pick: np.ndarray
    """One of the first particles for every feature (COUNT,)."""

    def states(self) -> tuple[Vec, Vec]:
        """y (COUNT, n) and lam (COUNT, f)."""
        y = self.model.initialise(self.xws, self.X).y
        return y, self.model.particles0().lam[self.pick]


def partial_laws(model: FeatureModel, rng: np.random.Generator) -> list[Law]:
    """The laws of a partial feature, ready to be tried."""
    space = model.space
    xws, xpdef = sample_pose(space, rng), sample_pose(space, rng)
    X = sample_rays(space, rng)
    pick = rng.integers(0, len(model.particles0().w), COUNT)
    return tried(_Trial(model, xws, xpdef, X, pick), _LAWS)


def _first_cloud(t: _Trial) -> str:
    model, f = t.model, len(t.model.free_labels)
    cloud = model.particles0()
    mean, var = model.moments(cloud)
    return first(
        [
            not_shaped("lam", cloud.lam, (len(cloud.w), f)),
            not_equal("the sum of the weights", cloud.w.sum(keepdims=True), np.ones(1)),
            "" if (cloud.w > 0.0).all() else "a particle starts without weight",
            not_shaped("the mean of the particles", mean, (f,)),
            not_covariance("the covariance of the particles", var, f),
            "it is given up from the start" if model.spent(cloud) else "",
        ]
    )


def _locus(t: _Trial) -> str:
    (y, lam), space = t.states(), t.model.space
    seen = space.to_local(t.xws, t.model.point(y, lam).X).X
    seen = seen / np.linalg.norm(seen[:, : space.d], axis=-1, keepdims=True)
    again = t.model.initialise(t.xws, seen).y
    return not_equal("y of any of its points", again, y, angles_of(t.model.state_units))


def _points(t: _Trial) -> str:
    (y, lam), point = t.states(), t.model.point
    names, flat = ("dX_by_dy", "dX_by_dlam"), np.zeros(t.model.space.d + 1, dtype=bool)
    pairs = list(zip(y, lam, strict=True))
    problems = [judge_jacobians(names, point, pair, flat) for pair in pairs]
    alone = np.array([point(*pair).X for pair in pairs])
    crossed = point(y[:, None], lam[None]).X
    problems += [
        not_equal("point, one by one", point(y, lam).X, alone),
        not_equal("point, all by all", crossed[3, 5], point(y[3], lam[5]).X),
    ]
    return first(problems)


def _axes(t: _Trial) -> str:
    model, (y, lam) = t.model, t.states()
    moved = model.point(model.redefine(y, t.xpdef).value, model.redefine_free(lam, t.xpdef)).X
    seen = model.space.to_local(t.xpdef, model.point(y, lam).X).X
    return projectively_equal("the point in new axes", moved, seen)


def _settling(t: _Trial) -> str:
    model, after = t.model, t.model.successor()
    if after is None:
        return "it has no successor: it would stay open for ever"
    y, lam = t.states()
    X_W = model.point(y, lam).X
    near = X_W[:, -1] > 0.05 * np.linalg.norm(X_W, axis=-1)
    y, lam, X_W = y[near], lam[near], X_W[near]
    value = model.settle(y, lam).y
    names, flat = ("dyfi_by_dypi", "dyfi_by_dlam"), np.zeros(value.shape[-1], dtype=bool)
    pairs = zip(y, lam, strict=True)
    return first(
        [
            projectively_equal("the point", after.primitive(value).X, X_W),
            *(judge_jacobians(names, model.settle, pair, flat) for pair in pairs),
        ]
    )


def _collapsing(t: _Trial) -> str:
    model, y = t.model, t.states()[0][0]
    cloud = model.particles0()
    if model.settled(y, cloud):
        return "it is settled before anything was seen"
    n = len(cloud.w)
    at = cloud.lam[n // 3]
    narrow = Particles(at + 1e-6 * np.arange(n)[:, None], np.full(n, 1.0 / n))
    mean, _ = model.moments(narrow)
    circle = angles_of(model.free_units)
    wrong = not_equal("the mean of equal particles", mean, at, circle, tol=1e-3)
    return wrong or ("" if model.settled(y, narrow) else "equal particles do not settle it")


_LAWS = (
    ("the first particles are a distribution", _first_cloud),
    ("initialise gives one y for all points that it may be", _locus),
    ("point has the right Jacobians, one by one and batched", _points),
    ("redefine and redefine_free move the point", _axes),
    ("settle keeps the point, with its Jacobians", _settling),
    ("settled by particles that agree, not by the first ones", _collapsing),
)
