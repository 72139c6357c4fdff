"""What a landmark that is a straight line must obey."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models import plucker, segments
from scene_core.models.base import FeatureModel, completed
from scene_core.models.judge import (
    Law,
    angles_of,
    first,
    judge_jacobians,
    not_covariance,
    not_equal,
    not_shaped,
    paired,
    sample_pose,
)
from scene_core.models.laws_observation import COUNT, batched_like_looped, rays


def line_laws(model: FeatureModel, rng: np.random.Generator) -> list[Law]:
    """The laws of a feature model of the shape "segment", ready to be tried."""
    n, angles, space = model.state_size, angles_of(model.state_units), model.space
    xws, xpdef = sample_pose(space, rng), sample_pose(space, rng)
    X = np.concatenate([rays(space, rng), rays(space, rng)], axis=-1)

    def states() -> Vec:
        return model.initialise(xws, X).y

    def declared() -> str:
        mean, cov = model.prior()
        open_ = 2 * len(model.unmeasured)
        return first(
            [
                paired("state", model.state_labels, model.state_units),
                not_shaped("the prior of both ends", mean, (open_,)),
                not_covariance("the prior of both ends", cov, open_),
            ]
        )

    def birth() -> str:
        y = states()
        seen = segments.to_world(space, xws, X)[0]
        problems = [
            not_shaped("y", y, (COUNT, n)),
            not_same_line("primitive(y)", model.primitive(y).X, seen),
        ]
        # Not to be known where it ends must not make a line singular.
        far = model.initialise(xws, X * np.tile([1.0, 1.0, 1.0, 0.0], 2))
        if not all(np.isfinite(part).all() for part in far if part is not None):
            problems.append("initialise is not finite for a line at infinity")
        for x in X:
            names = ("dy_by_dxws", "dy_by_dX")
            problems.append(judge_jacobians(names, model.initialise, (xws, x), angles))
        return first(problems)

    def primitive() -> str:
        # Which two points of the line are given is the model's to choose, anew for every line;
        # what may not jump is the plane in which a sensor sees them.
        def seen(y: Vec) -> tuple[Vec, Mat]:
            X, by_y = completed(model.primitive(y), model.primitive, y)
            X, _, by_X = segments.to_local(space, xpdef, X)
            normal, normal_by_X = segments.normal(X)
            assert by_y is not None
            by_y = normal_by_X @ by_X @ by_y
            both = normal[:, None, None] * by_y[None] + normal[None, :, None] * by_y[:, None]
            return np.outer(normal, normal).ravel(), both.reshape(9, -1)

        problems = [not_shaped("X", model.primitive(states()).X, (COUNT, 8))]
        for y in states():
            problems.append(judge_jacobians(["dX_by_dy"], seen, (y,), np.zeros(9, dtype=bool)))
        return first(problems)

    def redefinition() -> str:
        y = states()
        moved = model.redefine(y, xpdef).value
        seen = segments.to_local(space, xpdef, model.primitive(y).X)[0]
        problems = [not_same_line("y in new axes", model.primitive(moved).X, seen)]
        for yi in y:
            names = ("dyredef_by_dy", "dyredef_by_dxpdef")
            problems.append(judge_jacobians(names, model.redefine, (yi, xpdef), angles))
        return first(problems)

    def constraint() -> str:
        y = states()
        if (proper := model.normalise(y)) is None:
            return ""
        off = y + 0.03 * rng.standard_normal(y.shape)
        once = model.normalise(off)
        assert once is not None
        again = model.normalise(once.value)
        assert again is not None
        problems = [
            not_equal("a proper state", proper.value, y, angles),
            not_equal("normalising twice", again.value, once.value, angles),
        ]
        for yi in off:
            names = ["dynorm_by_dy"]
            problems.append(judge_jacobians(names, lambda v: _given(model, v), (yi,), angles))
        return first(problems)

    def ruler() -> str:
        y, eye = states(), space.position(xws)
        t = rng.uniform(-1.0, 1.0, (COUNT, 2))
        places = model.ends(y, t)
        problems = [
            not_shaped("the ends", places, (COUNT, 8)),
            not_same_line("the line through two of its places", places, model.primitive(y).X),
        ]
        points = places.reshape(COUNT, 2, 4)
        towards = points[..., :3] - points[..., 3:] * eye
        towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
        found = np.array([model.along(y[i], eye, towards[i]) for i in range(COUNT)])
        problems.append(not_equal("along, towards what ends gave", found, t, tol=1e-6))
        at_ends = np.array([model.along(y[i], eye, seen_rays(i)) for i in range(COUNT)])
        back = model.ends(y, at_ends)
        seen = segments.to_world(space, xws, X)[0]
        for name, at in (("the first end", slice(0, 4)), ("the second end", slice(4, 8))):
            problems.append(not_same_place(name, back[:, at], seen[:, at]))
        return first(problems)

    def seen_rays(i: int) -> Vec:
        """Unit rays (2, 3) in the world through the ends that were seen."""
        turned = segments.to_world(space, np.r_[np.zeros(3), xws[3:]], X[i])[0]
        return turned.reshape(2, 4)[:, :3]

    def drawing() -> str:
        y, P = states(), np.tile(1e-4 * np.eye(n), (COUNT, 1, 1))
        g, ready = model.graphics(y, P), model.ready(y, P, xws)
        problems = [
            not_shaped("the means", g.mean, (COUNT, space.d)),
            not_covariance("the drawn covariance", g.cov, space.d),
            not_shaped("the drawn ends", () if g.ends is None else g.ends, (COUNT, 2, space.d)),
        ]
        if np.shape(ready) != (COUNT,) or np.asarray(ready).dtype != bool:
            problems.append("ready does not return true or false, one per feature")
        return first(problems)

    def conversion() -> str:
        if (after := model.successor()) is None:
            return ""
        y = states()
        became = after.primitive(model.convert(y).y).X
        same = not_same_line("the line", became, model.primitive(y).X)
        names, out = ["dyfi_by_dypi"], angles_of(after.state_units)
        return first([same, *(judge_jacobians(names, model.convert, (yi,), out) for yi in y)])

    def batched() -> str:
        y = states()
        t = rng.uniform(-1.0, 1.0, (COUNT, 2))
        alike = batched_like_looped
        return first(
            [
                alike("initialise", model.initialise, (xws, X), (False, True)),
                alike("primitive", model.primitive, (y,), (True,)),
                alike("redefine", model.redefine, (y, xpdef), (True, False)),
                alike("ends", lambda *a: (model.ends(*a),), (y, t), (True, True)),
            ]
        )

    return [
        ("labels, units and prior have matching lengths", declared),
        ("initialise puts the line where it was seen, with its Jacobians", birth),
        ("primitive has the right Jacobian", primitive),
        ("redefine is a change of axes with its Jacobians", redefinition),
        ("normalise is a projection with its Jacobian", constraint),
        ("ends and along tell the same places", ruler),
        ("convert keeps the line, with its Jacobian", conversion),
        ("graphics and ready have the right shapes", drawing),
        ("batched is the same as one by one", batched),
    ]


def not_same_line(name: str, A: Vec, B: Vec) -> str:
    """Why pairs of points A and B (..., 8) do not span the same lines, or nothing."""
    a, b = (plucker.join(X).L for X in (A, B))
    a, b = (L / np.linalg.norm(L, axis=-1, keepdims=True) for L in (a, b))
    sign = np.where(np.vecdot(a, b) < 0.0, -1.0, 1.0)
    return not_equal(name, sign[..., None] * a, b, tol=1e-9)


def not_same_place(name: str, A: Vec, B: Vec) -> str:
    """Why homogeneous points A and B (..., 4) are different places, or nothing."""
    a, b = (X / np.linalg.norm(X, axis=-1, keepdims=True) for X in (A, B))
    sign = np.where(np.vecdot(a, b) < 0.0, -1.0, 1.0)
    return not_equal(name, sign[..., None] * a, b, tol=1e-6)


def _given(model: FeatureModel, y: Vec) -> tuple[Vec, Vec | None]:
    result = model.normalise(y)
    assert result is not None
    return result.value, result.jacobian
