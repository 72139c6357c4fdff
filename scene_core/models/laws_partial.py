"""What a feature model with free parameters must obey besides what every one does."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import FeatureModel, Particles
from scene_core.models.judge import (
    Law,
    angles_of,
    first,
    judge_jacobians,
    not_covariance,
    not_equal,
    not_shaped,
    paired,
    projectively_equal,
    sample_pose,
)

COUNT = 12


def partial_laws(model: FeatureModel, rng: np.random.Generator) -> list[Law]:
    """The laws of a partial feature, ready to be tried."""
    space, f = model.space, len(model.free_labels)
    d, angles, circle = space.d, angles_of(model.state_units), angles_of(model.free_units)
    xws, xpdef = sample_pose(space, rng), sample_pose(space, rng)
    X = rng.standard_normal((COUNT, d + 1))
    X[:, :d] /= np.linalg.norm(X[:, :d], axis=-1, keepdims=True)
    X[:, d] = rng.uniform(0.2, 1.5, COUNT)
    pick = rng.integers(0, len(model.particles0().w), COUNT)

    def states() -> tuple[Vec, Vec]:
        return model.initialise(xws, X).y, model.particles0().lam[pick]

    def first_cloud() -> str:
        lam, w = model.particles0()
        mean, var = model.moments(Particles(lam, w))
        return first(
            [
                paired("free", model.free_labels, model.free_units),
                not_shaped("lam", lam, (len(w), f)),
                not_equal("the sum of the weights", w.sum(keepdims=True), np.ones(1)),
                "" if (w > 0.0).all() else "a particle starts without weight",
                not_shaped("the mean of the particles", mean, (f,)),
                not_covariance("the covariance of the particles", var, f),
                "it is given up from the start" if model.spent(Particles(lam, w)) else "",
            ]
        )

    def locus() -> str:
        y, lam = states()
        seen = space.to_local(xws, model.point(y, lam).X).X
        seen = seen / np.linalg.norm(seen[:, :d], axis=-1, keepdims=True)
        return not_equal("y of any of its points", model.initialise(xws, seen).y, y, angles)

    def points() -> str:
        y, lam = states()
        names, flat = ("dX_by_dy", "dX_by_dlam"), np.zeros(d + 1, dtype=bool)
        problems = [
            judge_jacobians(names, model.point, pair, flat) for pair in zip(y, lam, strict=True)
        ]
        alone = np.array([model.point(*pair).X for pair in zip(y, lam, strict=True)])
        problems.append(not_equal("point, one by one", model.point(y, lam).X, alone))
        crossed = model.point(y[:, None], lam[None]).X
        problems.append(not_equal("point, all by all", crossed[3, 5], model.point(y[3], lam[5]).X))
        return first(problems)

    def axes() -> str:
        y, lam = states()
        moved = model.point(model.redefine(y, xpdef).value, model.redefine_free(lam, xpdef)).X
        seen = space.to_local(xpdef, model.point(y, lam).X).X
        return projectively_equal("the point in new axes", moved, seen)

    def settling() -> str:
        after = model.successor()
        if after is None:
            return "it has no successor: it would stay open for ever"
        y, lam = states()
        X_W = model.point(y, lam).X
        near = X_W[:, d] > 0.05 * np.linalg.norm(X_W, axis=-1)
        y, lam, X_W = y[near], lam[near], X_W[near]
        value = model.settle(y, lam).y
        names, flat = ("dyfi_by_dypi", "dyfi_by_dlam"), np.zeros(value.shape[-1], dtype=bool)
        problems = [projectively_equal("the point", after.primitive(value).X, X_W)]
        problems += [
            judge_jacobians(names, model.settle, pair, flat) for pair in zip(y, lam, strict=True)
        ]
        return first(problems)

    def collapsing() -> str:
        y = states()[0][0]
        cloud = model.particles0()
        if model.settled(y, cloud):
            return "it is settled before anything was seen"
        at = cloud.lam[len(cloud.w) // 3]
        n = len(cloud.w)
        lam = at + 1e-6 * np.arange(n)[:, None]
        narrow = Particles(lam, np.full(n, 1.0 / n))
        mean, _ = model.moments(narrow)
        wrong = not_equal("the mean of equal particles", mean, at, circle, tol=1e-3)
        return wrong or ("" if model.settled(y, narrow) else "equal particles do not settle it")

    return [
        ("the first particles are a distribution", first_cloud),
        ("initialise gives one y for all points that it may be", locus),
        ("point has the right Jacobians, one by one and batched", points),
        ("redefine and redefine_free move the point", axes),
        ("settle keeps the point, with its Jacobians", settling),
        ("settled by particles that agree, not by the first ones", collapsing),
    ]
