"""What a landmark that is a straight line must obey."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models import laws_feature, plucker, segments
from scene_core.models.base import FeatureModel, completed
from scene_core.models.judge import (
    COUNT,
    Law,
    angles_of,
    first,
    judge_jacobians,
    not_batched_alike,
    not_equal,
    not_shaped,
    tried,
)
from scene_core.models.laws_feature import Trial, constraint, declared, drawing


def line_laws(model: FeatureModel, rng: np.random.Generator) -> list[Law]:
    """The laws of a feature model of the shape "segment", ready to be tried."""
    return tried(laws_feature.trial(model, rng), _LAWS)


def _birth(t: Trial) -> str:
    model, y = t.model, t.states()
    problems = [
        not_shaped("y", y, (COUNT, model.state_size)),
        _not_same_line("primitive(y)", model.primitive(y).X, _seen(t)),
    ]
    # Not to be known where it ends must not make a line singular.
    far = model.initialise(t.xws, t.X * np.tile([1.0, 1.0, 1.0, 0.0], 2))
    if not all(np.isfinite(part).all() for part in far if part is not None):
        problems.append("initialise is not finite for a line at infinity")
    names = ("dy_by_dxws", "dy_by_dX")
    problems += [judge_jacobians(names, model.initialise, (t.xws, x), t.angles) for x in t.X]
    return first(problems)


def _primitive(t: Trial) -> str:
    # Which two points of the line are given is the model's to choose, anew for every line; what
    # may not jump is the plane in which a sensor sees them.
    def seen(y: Vec) -> tuple[Vec, Mat]:
        X, by_y = completed(t.model.primitive(y), t.model.primitive, y)
        X, _, by_X = segments.to_local(t.model.space, t.xpdef, X)
        normal, normal_by_X = segments.normal(X)
        assert by_y is not None
        by_y = normal_by_X @ by_X @ by_y
        both = normal[:, None, None] * by_y[None] + normal[None, :, None] * by_y[:, None]
        return np.outer(normal, normal).ravel(), both.reshape(9, -1)

    y, flat = t.states(), np.zeros(9, dtype=bool)
    problems = [not_shaped("X", t.model.primitive(y).X, (COUNT, 8))]
    problems += [judge_jacobians(["dX_by_dy"], seen, (yi,), flat) for yi in y]
    return first(problems)


def _redefinition(t: Trial) -> str:
    model, y = t.model, t.states()
    moved = model.primitive(model.redefine(y, t.xpdef).value).X
    seen = segments.to_local(model.space, t.xpdef, model.primitive(y).X)[0]
    names = ("dyredef_by_dy", "dyredef_by_dxpdef")
    return first(
        [
            _not_same_line("y in new axes", moved, seen),
            *(judge_jacobians(names, model.redefine, (yi, t.xpdef), t.angles) for yi in y),
        ]
    )


def _ruler(t: Trial) -> str:
    model, y, eye = t.model, t.states(), t.model.space.position(t.xws)
    at = t.rng.uniform(-1.0, 1.0, (COUNT, 2))
    places = model.ends(y, at)
    problems = [
        not_shaped("the ends", places, (COUNT, 8)),
        _not_same_line("the line through two of its places", places, model.primitive(y).X),
    ]
    found = _along(model, y, eye, _towards(places, eye))
    problems.append(not_equal("along, towards what ends gave", found, at, tol=1e-6))
    seen = _seen(t)
    back = model.ends(y, _along(model, y, eye, _towards(seen, eye)))
    for name, end in (("the first end", slice(0, 4)), ("the second end", slice(4, 8))):
        problems.append(_not_same_place(name, back[:, end], seen[:, end]))
    return first(problems)


def _conversion(t: Trial) -> str:
    if (after := t.model.successor()) is None:
        return ""
    model, y = t.model, t.states()
    became = after.primitive(model.convert(y).y).X
    same = _not_same_line("the line", became, model.primitive(y).X)
    names, out = ["dyfi_by_dypi"], angles_of(after.state_units)
    return first([same, *(judge_jacobians(names, model.convert, (yi,), out) for yi in y)])


def _batched(t: Trial) -> str:
    model, y, eye = t.model, t.states(), t.model.space.position(t.xws)
    at, rays = t.rng.uniform(-1.0, 1.0, (COUNT, 2)), _towards(_seen(t), eye)
    return first(
        [
            laws_feature.batched(t),
            not_batched_alike("ends", lambda *a: (model.ends(*a),), (y, at), (True, True)),
            not_batched_alike(
                "along", lambda *a: (model.along(*a),), (y, eye, rays), (True, False, True)
            ),
        ]
    )


_LAWS = (
    ("the prior has the length of what is not measured", declared),
    ("initialise puts the line where it was seen, with its Jacobians", _birth),
    ("primitive has the right Jacobian", _primitive),
    ("redefine is a change of axes with its Jacobians", _redefinition),
    ("normalise is a projection with its Jacobian", constraint),
    ("ends and along tell the same places", _ruler),
    ("convert keeps the line, with its Jacobian", _conversion),
    ("graphics and ready have the right shapes", drawing),
    ("batched is the same as one by one", _batched),
)


def _seen(t: Trial) -> Vec:
    """The ends (COUNT, 8) that were seen, in the world."""
    return segments.to_world(t.model.space, t.xws, t.X)[0]


def _towards(X: Vec, eye: Vec) -> Vec:
    """Unit rays (COUNT, 2, 3) from `eye` (3,) to both points of X (COUNT, 8), w > 0 or not."""
    points = X.reshape(COUNT, 2, 4)
    rays = points[..., :3] - points[..., 3:] * eye
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def _along(model: FeatureModel, y: Vec, eye: Vec, rays: Vec) -> Vec:
    """Places (COUNT, 2) on lines, asked for one by one."""
    return np.array([model.along(yi, eye, two) for yi, two in zip(y, rays, strict=True)])


def _not_same_line(name: str, A: Vec, B: Vec) -> str:
    """Why pairs of points A and B (..., 8) do not span the same lines, or nothing."""
    return _not_same_but_sign(name, plucker.join(A).L, plucker.join(B).L, 1e-9)


def _not_same_place(name: str, A: Vec, B: Vec) -> str:
    """Why homogeneous points A and B (..., 4) are different places, or nothing."""
    return _not_same_but_sign(name, A, B, 1e-6)


def _not_same_but_sign(name: str, A: Vec, B: Vec, tol: float) -> str:
    """Why A and B (..., n) are not multiples of each other, or nothing."""
    a, b = (V / np.linalg.norm(V, axis=-1, keepdims=True) for V in (A, B))
    sign = np.where(np.vecdot(a, b) < 0.0, -1.0, 1.0)
    return not_equal(name, sign[..., None] * a, b, tol=tol)
