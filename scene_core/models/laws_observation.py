"""What a sensor or a feature model must obey."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry.spaces import Space
from scene_core.models.base import FeatureModel, Sensor, completed
from scene_core.models.judge import (
    Law,
    angles_of,
    first,
    judge_jacobians,
    not_covariance,
    not_equal,
    not_shaped,
    not_spread_like,
    own_scale,
    paired,
    projectively_equal,
    sample_pose,
)
from scene_core.models.laws_motion import DRAWS
from scene_core.models.laws_partial import partial_laws

COUNT = 12


def sensor_laws(model: Sensor, rng: np.random.Generator) -> list[Law]:
    """The laws of a sensor, ready to be tried."""
    m, d, angles = model.measurement_size, model.space.d, angles_of(model.units)
    k0 = np.asarray(model.calib0)
    lo, hi = np.array(model.limits).T
    # Inside the limits and off their edges; a bar's middle, or a range of zero, has no direction.
    z = lo + (hi - lo) * rng.uniform(0.08, 0.92, (COUNT, m))
    n = rng.uniform(0.0, 2.0, (COUNT, len(model.unmeasured)))
    if n.size:
        n[0] = 0.0

    if m + n.shape[-1] > d:
        # More numbers than a point can cause: only those of some point come back as they were.
        X = model.backproject(z, n, k0).X
        X[:, d] = rng.uniform(0.2, 1.5, COUNT)
        z = model.project(X, k0).h

    def points() -> Vec:
        return model.backproject(z, n, k0).X

    def declared() -> str:
        return first(
            [
                paired("measurement", model.labels, model.units),
                paired("calibration", model.calib_labels, model.calib_units),
                not_shaped("labels", model.labels, (m,)),
                not_shaped("limits", model.limits, (m, 2)),
                not_equal(
                    "calib0's length", np.array(k0.shape), np.array([len(model.calib_labels)])
                ),
                "" if model.pane in ("image", "polar", "bar") else f"no pane '{model.pane}'",
            ]
        )

    def projection() -> str:
        X = points()
        problems = [not_shaped("h", model.project(X, k0).h, z.shape)]
        for x in X:
            names = ("dh_by_dX", "dh_by_dk")
            scales = (np.maximum(1.0, np.abs(x)), own_scale(k0))
            problems.append(judge_jacobians(names, model.project, (x, k0), angles, scales))
            scaled = model.project(2.5 * x, k0).h
            problems.append(
                not_equal("h of a multiple of X", scaled, model.project(x, k0).h, angles)
            )
        return first(problems)

    def finite() -> str:
        X = np.concatenate([np.eye(d + 1), -np.eye(d + 1)[:d], rng.standard_normal((9, d + 1))])
        X[:, d] = np.abs(X[:, d])
        r = model.project(X, k0)
        bad = [p for p in r if p is not None and not np.isfinite(p).all()]
        return "project is not finite for points it can not see" if bad else ""

    def backprojection() -> str:
        r = model.backproject(z, n, k0)
        problems = [not_equal("project(backproject(z))", model.project(r.X, k0).h, z, angles)]
        if d > 1:
            length = np.linalg.norm(r.X[:, :d], axis=-1)
            problems.append(not_equal("length of the ray", length, np.ones(COUNT)))
        if (r.X[:, d] < 0.0).any():
            problems.append("w is negative")
        names, flat = ("dX_by_dz", "dX_by_dn", "dX_by_dk"), np.zeros(d + 1, dtype=bool)
        for zi, ni in zip(z, n, strict=True):
            scales = (np.maximum(1e-2, np.abs(zi)), np.ones(len(ni)), own_scale(k0))
            args = (zi, ni, k0)
            problems.append(judge_jacobians(names, model.backproject, args, flat, scales))
        return first(problems)

    def noise() -> str:
        problems = [not_covariance("R", model.R(z), m)]
        problems.append(not_shaped("R", model.R(z), (COUNT, m, m)))
        r = model.nu(z, z)
        problems.append(not_equal("nu(h, h)", r.nu, np.zeros_like(z)))
        turned = model.nu(z, z + 2.0 * np.pi * angles).nu
        problems.append(not_equal("nu after a full turn", turned, np.zeros_like(z)))
        problems.append(judge_jacobians(("dnu_by_dh", "dnu_by_dz"), model.nu, (z[0], z[1]), angles))
        return first([*problems, not_difference(model, z[0], z[1])])

    def visible() -> str:
        X, pose = points(), model.space.identity()
        fault = model.visibility(z, X, pose, np.tile(pose, (COUNT, 1)), X)
        if np.shape(fault) != (COUNT,) or np.asarray(fault).dtype.kind not in "iu":
            return "visibility does not return whole numbers, one per point"
        return not_shaped("the selection score", model.selection_score(model.R(z)), (COUNT,))

    def noisy() -> str:
        X = np.tile(points()[1], (DRAWS, 1))
        h = model.project(X[0], k0).h
        return not_spread_like(model.h_noisy(X, k0, rng), h, model.R(h), angles)

    def batched() -> str:
        X = points()
        return first(
            [
                batched_like_looped("project", model.project, (X, k0), (True, False)),
                batched_like_looped("backproject", model.backproject, (z, n, k0), (1, 1, 0)),
            ]
        )

    return [
        ("labels, units, limits and calibration have matching lengths", declared),
        ("project has the right Jacobians and is of degree zero", projection),
        ("project stays finite everywhere", finite),
        ("backproject inverts project, with unit rays and the right Jacobians", backprojection),
        ("R is a covariance, nu is z - h, angles wrap", noise),
        ("visibility returns fault flags", visible),
        ("h_noisy spreads as R says", noisy),
        ("batched is the same as one by one", batched),
    ]


def not_difference(model: Sensor, h: Vec, z: Vec) -> str:
    """Why nu does not change as z - h does, which the update and the gate take for granted."""
    by = dict(zip("hz", completed(model.nu(h, z), model.nu, h, z)[1:], strict=True))
    for name, sign in (("z", 1.0), ("h", -1.0)):
        wanted = sign * np.eye(model.measurement_size)
        if wrong := not_equal(f"dnu_by_d{name}", np.asarray(by[name]), wanted, tol=1e-6):
            return (
                f"{wrong}: it has to be {'I' if sign > 0 else '-I'}, because H and R are those of "
                "h and z; return nu = z - h, angles wrapped, and put what bends it into project"
            )
    return ""


def feature_laws(model: FeatureModel, rng: np.random.Generator) -> list[Law]:
    """The laws of a feature model, ready to be tried."""
    n, angles, space = model.state_size, angles_of(model.state_units), model.space
    xws, xpdef = sample_pose(space, rng), sample_pose(space, rng)
    X = rays(space, rng)

    def states() -> Vec:
        return model.initialise(xws, X).y

    def declared() -> str:
        mean, cov = model.prior()
        open_ = len(model.unmeasured)
        return first(
            [
                paired("state", model.state_labels, model.state_units),
                not_shaped("the prior", mean, (open_,)),
                not_covariance("the prior", cov, open_),
            ]
        )

    def birth() -> str:
        y = states()
        problems = [not_shaped("y", y, (len(X), n))]
        back = model.primitive(y).X
        if not model.free_labels:
            problems.append(projectively_equal("primitive(y)", back, space.to_world(xws, X).X))
        if (back[:, -1] < 0.0).any():
            problems.append("w is negative")
        for x in X:
            names = ("dy_by_dxws", "dy_by_dX")
            problems.append(judge_jacobians(names, model.initialise, (xws, x), angles))
        return first(problems)

    def primitive() -> str:
        flat = np.zeros(space.d + 1, dtype=bool)
        return first([judge_jacobians(["dX_by_dy"], model.primitive, (y,), flat) for y in states()])

    def redefinition() -> str:
        y = states()
        moved = model.redefine(y, xpdef).value
        seen = space.to_local(xpdef, model.primitive(y).X).X
        problems = [projectively_equal("y in new axes", model.primitive(moved).X, seen)]
        for yi in y:
            names = ("dyredef_by_dy", "dyredef_by_dxpdef")
            problems.append(judge_jacobians(names, model.redefine, (yi, xpdef), angles))
        return first(problems)

    def constraint() -> str:
        return not_normalising(model, states(), angles, rng)

    def conversion() -> str:
        after = model.successor()
        if after is None or model.free_labels:
            return ""
        y = states()
        converted = model.convert(y).y
        same = projectively_equal("the point", after.primitive(converted).X, model.primitive(y).X)
        flat = np.zeros(converted.shape[-1], dtype=bool)
        names = ["dyfi_by_dypi"]
        return first([same, *(judge_jacobians(names, model.convert, (yi,), flat) for yi in y)])

    def drawing() -> str:
        y, P = states(), np.tile(1e-4 * np.eye(n), (len(X), 1, 1))
        g = model.graphics(y, P)
        ready = model.ready(y, P, xws)
        problems = [
            not_shaped("the means", g.mean, (len(X), space.d)),
            not_covariance("the drawn covariance", g.cov, space.d),
        ]
        if np.shape(ready) != (len(X),) or np.asarray(ready).dtype != bool:
            problems.append("ready does not return true or false, one per feature")
        return first(problems)

    def batched() -> str:
        y = states()
        return first(
            [
                batched_like_looped("initialise", model.initialise, (xws, X), (False, True)),
                batched_like_looped("primitive", model.primitive, (y,), (True,)),
                batched_like_looped("redefine", model.redefine, (y, xpdef), (True, False)),
            ]
        )

    return [
        ("labels, units and prior have matching lengths", declared),
        ("initialise puts the point where it was seen, with its Jacobians", birth),
        ("primitive has the right Jacobian", primitive),
        ("redefine is a change of axes with its Jacobians", redefinition),
        ("normalise is a projection with its Jacobian", constraint),
        ("convert keeps the point, with its Jacobian", conversion),
        ("graphics and ready have the right shapes", drawing),
        ("batched is the same as one by one", batched),
        *(partial_laws(model, rng) if model.free_labels else ()),
    ]


def not_normalising(
    model: FeatureModel, y: Vec, angles: np.ndarray, rng: np.random.Generator
) -> str:
    """Why normalise is not a projection onto the proper states y (N, n) and about them, with its
    Jacobian; or nothing, as where there is no constraint."""
    if model.normalise(y) is None:
        return ""

    def given(v: Vec) -> tuple[Vec, Vec | None]:
        result = model.normalise(v)
        assert result is not None
        return result.value, result.jacobian

    off = y + 0.03 * rng.standard_normal(y.shape)
    once = given(off)[0]
    problems = [
        not_equal("a proper state", given(y)[0], y, angles),
        not_equal("normalising twice", given(once)[0], once, angles),
    ]
    problems += [judge_jacobians(["dynorm_by_dy"], given, (yi,), angles) for yi in off]
    return first(problems)


def rays(space: Space, rng: np.random.Generator) -> Vec:
    X = rng.standard_normal((COUNT, space.d + 1))
    X[:, :-1] /= np.linalg.norm(X[:, :-1], axis=-1, keepdims=True)
    X[:, -1] = rng.uniform(0.2, 1.5, COUNT)
    return X


def batched_like_looped(
    name: str, function: Callable[..., Any], args: tuple[Vec, ...], batch: tuple[bool | int, ...]
) -> str:
    """Why a batch gives something else than its rows one by one, or nothing."""
    together = function(*args)
    problems = []
    for row in range(COUNT):
        alone = function(*(a[row] if b else a for a, b in zip(args, batch, strict=True)))
        for part, (whole, single) in enumerate(zip(together, alone, strict=True)):
            if whole is None or single is None:
                continue
            at_row = np.broadcast_to(whole, (COUNT, *np.shape(single)))[row]
            problems.append(not_equal(f"{name}, result {part}", at_row, single))
    return first(problems)
