"""What a motion model or an internal measurement model must obey."""

from __future__ import annotations

from functools import partial

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import relative
from scene_core.models.base import Fault, InternalMeasurementModel, MotionModel, Transition
from scene_core.models.judge import (
    Law,
    angles_of,
    awkward_states,
    first,
    judge_jacobians,
    not_covariance,
    not_equal,
    not_shaped,
    not_spread_like,
    own_scale,
    paired,
    sample_pose,
    sample_state,
    with_unit_quaternion,
)

DT = 0.05
DRAWS = 1500


def motion_laws(model: MotionModel, rng: np.random.Generator) -> list[Law]:
    """The laws of a motion model, ready to be tried."""
    n, angles = model.state_size, angles_of(model.state_units)
    states = awkward_states(model.state_labels, model.state_units, rng)
    xpdefs = [sample_pose(model.space, rng) for _ in states]
    us = [0.3 * rng.standard_normal(len(model.control_labels)) for _ in states[:-2]]
    us += [np.zeros(len(model.control_labels))] * 2
    k0 = np.asarray(model.calib0)
    pose_angles = angles_of(model.space.units)

    def declared() -> str:
        return first(
            [
                paired("state", model.state_labels, model.state_units),
                paired("control", model.control_labels, model.control_units),
                paired("calibration", model.calib_labels, model.calib_units),
                not_equal(
                    "calib0's length", np.array(k0.shape), np.array([len(model.calib_labels)])
                ),
                "" if "base" in model.hooks else "there is no hook 'base'",
            ]
        )

    def step(xv: Vec, u: Vec, k: Vec) -> Transition:
        return model.f(xv, u, DT, k)

    def process() -> str:
        problems = []
        for xv, u in zip(states, us, strict=True):
            names = ("dfv_by_dxv", "dfv_by_du", "dfv_by_dk")
            scales = (np.maximum(1.0, np.abs(xv)), np.ones(len(u)), own_scale(k0))
            problems.append(judge_jacobians(names, step, (xv, u, k0), angles, scales))
            problems.append(not_shaped("fv", model.f(xv, u, DT, k0).fv, (n,)))
        return first(problems)

    def noise() -> str:
        xv, u = states[0], us[0]
        return first(
            [
                not_covariance("Q", model.Q(xv, u, DT, k0), n),
                not_covariance("U", model.U(u, DT), len(u)),
                not_covariance("U_unknown", model.U_unknown(DT), len(u)),
            ]
        )

    def position() -> str:
        problems = []
        for hook in model.hooks:
            for xv in states:
                problems.append(not_shaped("xp", model.xp(xv, hook).xp, (model.space.n,)))
                at_hook = partial(model.xp, hook=hook)
                problems.append(judge_jacobians(["dxp_by_dxv"], at_hook, (xv,), pose_angles))
        return first(problems)

    def redefinition() -> str:
        problems = []
        for xv, xpdef in zip(states, xpdefs, strict=True):
            names = ("dxvredef_by_dxv", "dxvredef_by_dxpdef")
            problems.append(judge_jacobians(names, model.redefine, (xv, xpdef), angles))
            r = model.redefine(xv, xpdef)
            seen = relative(model.space, xpdef, model.xp(xv).xp).x
            problems.append(not_equal("xp in new axes", model.xp(r.value).xp, seen, pose_angles))
        return first(problems)

    def invariance() -> str:
        if model.world_fixed:
            return ""
        problems = []
        for xv, xpdef, u in zip(states, xpdefs, us, strict=True):
            after = model.redefine(model.f(xv, u, DT, k0).fv, xpdef).value
            before = model.f(model.redefine(xv, xpdef).value, u, DT, k0).fv
            problems.append(not_equal("moving in new axes", before, after, angles))
        return first(problems)

    def constraint() -> str:
        problems = []
        for xv in states:
            off = xv * 1.01
            problems.append(judge_jacobians(["dxvnorm_by_dxv"], model.normalise, (off,), angles))
            once = model.normalise(off)
            again = model.normalise(once.value).value
            problems.append(not_equal("normalising twice", again, once.value, angles))
            problems.append(
                not_equal("normalising a proper state", model.normalise(xv).value, xv, angles)
            )
        return first(problems)

    def lifted(xp: Vec) -> tuple[Vec, Mat]:
        up = model.lift(xp)
        return up.xv, up.dxv_by_dxp

    def lifting() -> str:
        problems = []
        for xp in xpdefs:
            up = model.lift(xp)
            problems.append(
                not_equal("xp of the lifted state", model.xp(up.xv).xp, xp, pose_angles)
            )
            problems.append(
                judge_jacobians(["dxv_by_dxp"], lambda xp: model.lift(xp)[:2], (xp,), angles)
            )
            problems.append(not_covariance("P_rest", up.P_rest, n))
        return first(problems)

    def noisy() -> str:
        xv, u = sample_state(model.state_labels, model.state_units, rng), us[0]
        result = model.f(xv, u, DT, k0)
        G = result.dfv_by_du
        if G is None:
            return ""
        J = model.normalise(result.fv).jacobian
        P = G @ model.U(u, DT) @ G.T + model.Q(xv, u, DT, k0)
        P = P if J is None else J @ P @ J.T
        draws = np.array([model.f_noisy(xv, u, DT, k0, rng) for _ in range(DRAWS)])
        return not_spread_like(draws, result.fv, P, angles)

    return [
        ("labels, units and calibration have matching lengths", declared),
        ("f has the right Jacobians, finite at rest", process),
        ("Q, U and U_unknown are covariances", noise),
        ("xp is a position state with its Jacobian", position),
        ("redefine is a change of axes with its Jacobians", redefinition),
        ("moving and changing axes commute", invariance),
        ("normalise is a projection with its Jacobian", constraint),
        ("lift keeps the position state", lifting),
        ("f_noisy spreads as Q and U say", noisy),
    ]


def internal_laws(model: InternalMeasurementModel, rng: np.random.Generator) -> list[Law]:
    """The laws of an internal measurement model, ready to be tried."""
    m, angles = model.measurement_size, angles_of(model.units)
    states = [
        with_unit_quaternion(model.needs, rng.standard_normal(len(model.needs))) for _ in range(5)
    ]

    def function() -> str:
        problems = []
        for needed in states:
            problems.append(judge_jacobians(["dhv"], model.h, (needed,), angles))
            problems.append(not_shaped("hv", model.h(needed).hv, (m,)))
        rest = model.h(with_unit_quaternion(model.needs, np.zeros(len(model.needs))))
        if not all(np.isfinite(part).all() for part in rest if part is not None):
            problems.append("h is not finite at zero")
        return first(problems)

    def noise() -> str:
        hv = model.h(states[0]).hv
        turned = model.nu(hv, hv + 2.0 * np.pi * angles)
        return first(
            [
                not_equal("nu(h, h)", model.nu(hv, hv), np.zeros(m)),
                not_equal("nu after a full turn", turned, np.zeros(m)),
                not_covariance("R", model.R(hv), m),
            ]
        )

    def feasibility() -> str:
        wrong = [s for s in states if not isinstance(model.feasible(s, model.h(s).hv), Fault)]
        return "feasible does not return a Fault" if wrong else ""

    def noisy() -> str:
        hv = model.h(states[0]).hv
        draws = np.array([model.h_noisy(states[0], rng) for _ in range(DRAWS)])
        return not_spread_like(draws, hv, model.R(hv), angles)

    return [
        ("labels and units have matching lengths", lambda: paired("", model.labels, model.units)),
        ("h has the right Jacobian, finite at zero", function),
        ("R is a covariance, nu(h, h) is zero, angles wrap", noise),
        ("feasible returns a Fault", feasibility),
        ("h_noisy spreads as R says", noisy),
    ]
