"""What a motion model must obey."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import relative
from scene_core.models.base import MotionModel, Transition
from scene_core.models.judge import (
    DRAWS,
    DT,
    Law,
    angles_of,
    first,
    judge_jacobians,
    not_covariance,
    not_equal,
    not_shaped,
    not_spread_like,
    own_scale,
    tried,
)
from scene_core.models.laws_navigation import not_navigating, not_resting
from scene_core.models.trial_states import awkward_states, sample_pose, sample_state


@dataclass(frozen=True)
class _Trial:
    """A motion model, and what it is tried at."""

    model: MotionModel
    rng: np.random.Generator
    states: list[Vec]
    xpdefs: list[Vec]
    """New origins, one for every state."""
    us: list[Vec]
    """Controls, one for every state; the last two are zero."""

    @property
    def angles(self) -> np.ndarray:
        return angles_of(self.model.state_units)

    @property
    def pose_angles(self) -> np.ndarray:
        return angles_of(self.model.space.units)

    @property
    def k0(self) -> Vec:
        return np.asarray(self.model.calib0)

    def step(self, xv: Vec, u: Vec, k: Vec) -> Transition:
        return self.model.f(xv, u, DT, k)


def motion_laws(model: MotionModel, rng: np.random.Generator) -> list[Law]:
    """The laws of a motion model, ready to be tried."""
    states = awkward_states(model.state_labels, model.state_units, rng)
    xpdefs = [sample_pose(model.space, rng) for _ in states]
    us = [0.3 * rng.standard_normal(len(model.control_labels)) for _ in states[:-2]]
    us += [np.zeros(len(model.control_labels))] * 2
    return tried(_Trial(model, rng, states, xpdefs, us), _LAWS)


def _declared(t: _Trial) -> str:
    model = t.model
    length = np.array([len(model.calib_labels)])
    return first(
        [
            not_equal("calib0's length", np.array(t.k0.shape), length),
            "" if "base" in model.hooks else "there is no hook 'base'",
            _not_bodies(model),
        ]
    )


def _not_bodies(model: MotionModel) -> str:
    unknown = [body for body in model.bodies if body not in model.hooks]
    if unknown:
        return f"bodies has {unknown[0]!r}, and the hooks are {', '.join(model.hooks)}"
    return "" if model.bodies[:1] == ("base",) else "bodies does not start with 'base'"


def _process(t: _Trial) -> str:
    problems = []
    for xv, u in zip(t.states, t.us, strict=True):
        names = ("dfv_by_dxv", "dfv_by_du", "dfv_by_dk")
        scales = (np.maximum(1.0, np.abs(xv)), np.ones(len(u)), own_scale(t.k0))
        problems.append(judge_jacobians(names, t.step, (xv, u, t.k0), t.angles, scales))
        problems.append(not_shaped("fv", t.step(xv, u, t.k0).fv, (t.model.state_size,)))
    return first(problems)


def _noise(t: _Trial) -> str:
    xv, u = t.states[0], t.us[0]
    return first(
        [
            not_covariance("Q", t.model.Q(xv, u, DT, t.k0), t.model.state_size),
            not_covariance("U", t.model.U(u, DT), len(u)),
            not_covariance("U_unknown", t.model.U_unknown(DT), len(u)),
        ]
    )


def _position(t: _Trial) -> str:
    model, problems = t.model, []
    for hook in model.hooks:
        for xv in t.states:
            problems.append(not_shaped("xp", model.xp(xv, hook).xp, (model.space.n,)))
            at_hook = partial(model.xp, hook=hook)
            problems.append(judge_jacobians(["dxp_by_dxv"], at_hook, (xv,), t.pose_angles))
    return first(problems)


def _redefinition(t: _Trial) -> str:
    model, problems = t.model, []
    for xv, xpdef in zip(t.states, t.xpdefs, strict=True):
        names = ("dxvredef_by_dxv", "dxvredef_by_dxpdef")
        problems.append(judge_jacobians(names, model.redefine, (xv, xpdef), t.angles))
        for body in model.bodies:
            moved = model.xp(model.redefine(xv, xpdef).value, body).xp
            seen = relative(model.space, xpdef, model.xp(xv, body).xp).x
            problems.append(not_equal("xp in new axes", moved, seen, t.pose_angles))
    return first(problems)


def _invariance(t: _Trial) -> str:
    model, problems = t.model, []
    if model.world_fixed:
        return ""
    for xv, xpdef, u in zip(t.states, t.xpdefs, t.us, strict=True):
        after = model.redefine(t.step(xv, u, t.k0).fv, xpdef).value
        before = t.step(model.redefine(xv, xpdef).value, u, t.k0).fv
        problems.append(not_equal("moving in new axes", before, after, t.angles))
    return first(problems)


def _constraint(t: _Trial) -> str:
    normalise, angles, problems = t.model.normalise, t.angles, []
    for xv in t.states:
        off = xv * 1.01
        once = normalise(off).value
        problems += [
            judge_jacobians(["dxvnorm_by_dxv"], normalise, (off,), angles),
            not_equal("normalising twice", normalise(once).value, once, angles),
            not_equal("normalising a proper state", normalise(xv).value, xv, angles),
        ]
    return first(problems)


def _lifting(t: _Trial) -> str:
    model, problems = t.model, []

    def lifted(xp: Vec) -> tuple[Vec, Mat]:
        return model.lift(xp)[:2]

    for xp in t.xpdefs:
        up = model.lift(xp)
        problems += [
            not_equal("xp of the lifted state", model.xp(up.xv).xp, xp, t.pose_angles),
            judge_jacobians(["dxv_by_dxp"], lifted, (xp,), t.angles),
            not_covariance("P_rest", up.P_rest, model.state_size),
        ]
    return first(problems)


def _noisy(t: _Trial) -> str:
    model, k0 = t.model, t.k0
    xv, u = sample_state(model.state_labels, model.state_units, t.rng), t.us[0]
    result = t.step(xv, u, k0)
    G = result.dfv_by_du
    if G is None:
        return ""
    J = model.normalise(result.fv).jacobian
    P = G @ model.U(u, DT) @ G.T + model.Q(xv, u, DT, k0)
    P = P if J is None else J @ P @ J.T
    draws = np.array([model.f_noisy(xv, u, DT, k0, t.rng) for _ in range(DRAWS)])
    return not_spread_like(draws, result.fv, P, t.angles)


def _navigation(t: _Trial) -> str:
    return not_navigating(t.model, t.xpdefs[:3], t.rng)


def _rest(t: _Trial) -> str:
    return not_resting(t.model, t.states[:3])


_LAWS = (
    ("calib0 is as long as its labels, base and the bodies are hooks", _declared),
    ("f has the right Jacobians, finite at rest", _process),
    ("Q, U and U_unknown are covariances", _noise),
    ("xp is a position state with its Jacobian", _position),
    ("redefine is a change of axes with its Jacobians", _redefinition),
    ("moving and changing axes commute", _invariance),
    ("normalise is a projection with its Jacobian", _constraint),
    ("lift keeps the position state", _lifting),
    ("f_noisy spreads as Q and U say", _noisy),
    ("navigate comes to a goal, and says so there", _navigation),
    ("stay brings it to rest where it navigates", _rest),
)
