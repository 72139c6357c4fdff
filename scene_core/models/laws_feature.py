"""What a feature model must obey: any of them, and one of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import FeatureModel
from scene_core.models.judge import (
    COUNT,
    Law,
    angles_of,
    first,
    judge_jacobians,
    not_batched_alike,
    not_covariance,
    not_equal,
    not_shaped,
    projectively_equal,
    tried,
)
from scene_core.models.laws_partial import partial_laws
from scene_core.models.trial_states import sample_pose, sample_rays


@dataclass(frozen=True)
class Trial:
    """A feature model, and what it is tried at."""

    model: FeatureModel
    rng: np.random.Generator
    xws: Vec
    """The sensor's pose at the first view."""
    xpdef: Vec
    """A new origin."""
    X: Vec
    """What is seen (COUNT, d+1), or the two points of every segment, in the sensor's frame."""

    @property
    def angles(self) -> np.ndarray:
        return angles_of(self.model.state_units)

    def states(self) -> Vec:
        """y (COUNT, n) of what is seen."""
        return self.model.initialise(self.xws, self.X).y


def trial(model: FeatureModel, rng: np.random.Generator) -> Trial:
    """A model with random poses, and COUNT features seen by a sensor."""
    space = model.space
    xws, xpdef = sample_pose(space, rng), sample_pose(space, rng)
    X = [sample_rays(space, rng) for _ in range(2 if model.shape == "segment" else 1)]
    return Trial(model, rng, xws, xpdef, np.concatenate(X, axis=-1))


def feature_laws(model: FeatureModel, rng: np.random.Generator) -> list[Law]:
    """The laws of a feature model of the shape "point", ready to be tried."""
    laws = tried(trial(model, rng), _LAWS)
    return [*laws, *partial_laws(model, rng)] if model.free_labels else laws


def declared(t: Trial) -> str:
    """Of points and lines."""
    model, (mean, cov) = t.model, t.model.prior()
    is_line = model.shape == "segment"
    what, open_ = "the prior", len(model.unmeasured)
    if is_line:
        what, open_ = "the prior of both ends", 2 * open_
    return first(
        [
            not_shaped(what, mean, (open_,)),
            not_covariance(what, cov, open_),
        ]
    )


def constraint(t: Trial) -> str:
    """Of points and lines; nothing where there is none."""
    model, y = t.model, t.states()
    if model.normalise(y) is None:
        return ""

    def given(v: Vec) -> tuple[Vec, Vec | None]:
        result = model.normalise(v)
        assert result is not None
        return result.value, result.jacobian

    off = y + 0.03 * t.rng.standard_normal(y.shape)
    once = given(off)[0]
    problems = [
        not_equal("a proper state", given(y)[0], y, t.angles),
        not_equal("normalising twice", given(once)[0], once, t.angles),
    ]
    problems += [judge_jacobians(["dynorm_by_dy"], given, (yi,), t.angles) for yi in off]
    return first(problems)


def drawing(t: Trial) -> str:
    """Of points and lines."""
    y, d = t.states(), t.model.space.d
    P = np.tile(1e-4 * np.eye(t.model.state_size), (COUNT, 1, 1))
    drawn, ready = t.model.graphics(y, P), t.model.ready(y, P, t.xws)
    problems = [
        not_shaped("the means", drawn.mean, (COUNT, d)),
        not_covariance("the drawn covariance", drawn.cov, d),
    ]
    if t.model.shape == "segment":
        ends = () if drawn.ends is None else drawn.ends
        problems.append(not_shaped("the drawn ends", ends, (COUNT, 2, d)))
    if np.shape(ready) != (COUNT,) or np.asarray(ready).dtype != bool:
        problems.append("ready does not return true or false, one per feature")
    return first(problems)


def batched(t: Trial) -> str:
    """Of points and lines."""
    model, y = t.model, t.states()
    return first(
        [
            not_batched_alike("initialise", model.initialise, (t.xws, t.X), (False, True)),
            not_batched_alike("primitive", model.primitive, (y,), (True,)),
            not_batched_alike("redefine", model.redefine, (y, t.xpdef), (True, False)),
        ]
    )


def _birth(t: Trial) -> str:
    model, y = t.model, t.states()
    problems = [not_shaped("y", y, (COUNT, model.state_size))]
    back = model.primitive(y).X
    if not model.free_labels:
        seen = model.space.to_world(t.xws, t.X).X
        problems.append(projectively_equal("primitive(y)", back, seen))
    if (back[:, -1] < 0.0).any():
        problems.append("w is negative")
    names = ("dy_by_dxws", "dy_by_dX")
    problems += [judge_jacobians(names, model.initialise, (t.xws, x), t.angles) for x in t.X]
    return first(problems)


def _primitive(t: Trial) -> str:
    flat, primitive = np.zeros(t.model.space.d + 1, dtype=bool), t.model.primitive
    return first([judge_jacobians(["dX_by_dy"], primitive, (y,), flat) for y in t.states()])


def _redefinition(t: Trial) -> str:
    model, y = t.model, t.states()
    moved = model.primitive(model.redefine(y, t.xpdef).value).X
    seen = model.space.to_local(t.xpdef, model.primitive(y).X).X
    names = ("dyredef_by_dy", "dyredef_by_dxpdef")
    return first(
        [
            projectively_equal("y in new axes", moved, seen),
            *(judge_jacobians(names, model.redefine, (yi, t.xpdef), t.angles) for yi in y),
        ]
    )


def _conversion(t: Trial) -> str:
    model, after = t.model, t.model.successor()
    if after is None or model.free_labels:
        return ""
    y = t.states()
    converted = model.convert(y).y
    same = projectively_equal("the point", after.primitive(converted).X, model.primitive(y).X)
    flat = np.zeros(converted.shape[-1], dtype=bool)
    names = ["dyfi_by_dypi"]
    return first([same, *(judge_jacobians(names, model.convert, (yi,), flat) for yi in y)])


_LAWS = (
    ("the prior has the length of what is not measured", declared),
    ("initialise puts the point where it was seen, with its Jacobians", _birth),
    ("primitive has the right Jacobian", _primitive),
    ("redefine is a change of axes with its Jacobians", _redefinition),
    ("normalise is a projection with its Jacobian", constraint),
    ("convert keeps the point, with its Jacobian", _conversion),
    ("graphics and ready have the right shapes", drawing),
    ("batched is the same as one by one", batched),
)
