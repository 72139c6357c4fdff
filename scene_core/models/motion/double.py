"""Two robots as one: their states side by side, each moving by its own model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scene_core.arrays import Mat, Vec, block_diag
from scene_core.geometry.spaces import Space
from scene_core.models.base import (
    Lifted,
    MotionModel,
    Normalised,
    PositionState,
    Redefined,
    Transition,
    completed,
)
from scene_core.models.registry import model_class
from scene_core.params import ParamError, param

SECOND = "2:"
"""Before every label of the second robot."""


def _nomad() -> MotionModel:
    """What Scene's pair of robots was made of."""
    return model_class("motion", "planar nomad")()


@dataclass(frozen=True)
class Double(MotionModel):
    """Two robots of the same space that move independently and share one map.

    f = (f1(xv1, u1, k1), f2(xv2, u2, k2));  Q, U and all Jacobians are block diagonal

    xv = (xv1, xv2), u = (u1, u2), k = (k1, k2) in the units of the two models; the first robot's
    labels are its own, the second's begin with 2: (2:x), so that whatever runs on the first model
    runs on the pair.
    Hooks: base is the first robot's, second the second's base; first:<hook> and second:<hook>.
    Both are bodies: each is drawn, and has errors and a NEES of its own.

    Source: Davison, Scene library, DOUBLE motion model, which had the first robot's hook only.
    """

    name = "double"

    first: MotionModel = field(default_factory=_nomad)
    """The robot whose position state is that of the pair."""
    second: MotionModel = field(default_factory=_nomad)
    """The other robot."""
    rest_sd_apart: float = param(
        10.0, unit="m", lo=0.0, hi=1e6, soft=(0.0, 50.0), effect="on reset", label="Start apart"
    )
    """Standard deviation of the second robot's place about the first's when the pair is taken over
    from a model of one robot, which does not know where the second is."""
    rest_sd_turned: float = param(
        1.0, unit="rad", lo=0.0, hi=3.2, effect="on reset", label="Start turned"
    )
    """The same for the second robot's orientation."""

    def __post_init__(self) -> None:
        if self.first.space is not self.second.space:
            raise ParamError(
                f"'{self.first.name}' moves in {self.first.space.name} and '{self.second.name}' in "
                f"{self.second.space.name}: two robots of one model share their space"
            )
        if len(set(self.state_labels)) < self.state_size:
            raise ParamError("for three robots give the pair as the second: second = double")

    @property
    def space(self) -> Space:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.first.space

    def _both(self, attribute: str, mark: bool = False) -> tuple[str, ...]:
        other = getattr(self.second, attribute)
        marked = tuple(SECOND + one for one in other) if mark else other
        return (*getattr(self.first, attribute), *marked)

    @property
    def state_labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._both("state_labels", mark=True)

    @property
    def state_units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._both("state_units")

    @property
    def control_labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._both("control_labels", mark=True)

    @property
    def control_units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._both("control_units")

    @property
    def calib_labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._both("calib_labels", mark=True)

    @property
    def calib_units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._both("calib_units")

    @property
    def hooks(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        own = tuple(f"first:{hook}" for hook in self.first.hooks)
        return ("base", "second", *own, *(f"second:{hook}" for hook in self.second.hooks))

    @property
    def bodies(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        more = (f"first:{hook}" for hook in self.first.bodies[1:])
        others = (f"second:{hook}" for hook in self.second.bodies[1:])
        return ("base", *more, "second", *others)

    @property
    def world_fixed(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return tuple(dict.fromkeys(self._both("world_fixed")))

    @property
    def navigates(self) -> bool:
        return self.first.navigates and self.second.navigates

    @property
    def calib0(self) -> Vec:
        return np.concatenate([self.first.calib0, self.second.calib0])

    def _states(self, xv: Vec) -> tuple[Vec, Vec]:
        return xv[: self.first.state_size], xv[self.first.state_size :]

    def _controls(self, u: Vec) -> tuple[Vec, Vec]:
        n = len(self.first.control_labels)
        return u[:n], u[n:]

    def _each(self, xv: Vec, u: Vec, k: Vec) -> list[tuple[MotionModel, Vec, Vec, Vec]]:
        n = len(self.first.calib_labels)
        parts = (self._states(xv), self._controls(u), (k[:n], k[n:]))
        return list(zip((self.first, self.second), *parts, strict=True))

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        moved = [_moved(model, x, v, dt, c) for model, x, v, c in self._each(xv, u, k)]
        value, *jacobians = zip(*moved, strict=True)
        return Transition(np.concatenate(value), *(block_diag(list(J)) for J in jacobians))

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        return block_diag([model.Q(x, v, dt, c) for model, x, v, c in self._each(xv, u, k)])

    def U(self, u: Vec, dt: float) -> Mat:
        u1, u2 = self._controls(u)
        return block_diag([self.first.U(u1, dt), self.second.U(u2, dt)])

    def U_unknown(self, dt: float) -> Mat:
        return block_diag([self.first.U_unknown(dt), self.second.U_unknown(dt)])

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        whose, _, inner = hook.partition(":")
        n = self.first.state_size
        model, at = (
            (self.second, slice(n, None)) if whose == "second" else (self.first, slice(0, n))
        )

        def at_hook(x: Vec) -> PositionState:
            return model.xp(x, inner or "base")

        seen = _whole(at_hook, xv[at])
        dxp_by_dxv = np.zeros((self.space.n, self.state_size))
        dxp_by_dxv[:, at] = seen.dxp_by_dxv
        return PositionState(seen.xp, dxp_by_dxv)

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        both = zip((self.first, self.second), self._states(xv), strict=True)
        seen = [_whole(model.redefine, x, xpdef) for model, x in both]
        value, by_state, by_xpdef = zip(*seen, strict=True)
        return Redefined(
            np.concatenate(value), block_diag(list(by_state)), np.concatenate(by_xpdef)
        )

    def normalise(self, xv: Vec) -> Normalised:
        both = zip((self.first, self.second), self._states(xv), strict=True)
        value, J = zip(*(_whole(model.normalise, x) for model, x in both), strict=True)
        return Normalised(np.concatenate(value), block_diag(list(J)))

    def lift(self, xp: Vec) -> Lifted:
        """The second robot where the first is, give or take `rest_sd_apart`."""
        space, one, two = self.space, self.first.lift(xp), self.second.lift(xp)
        sds = [self.rest_sd_apart] * space.d + [self.rest_sd_turned] * (space.tangent - space.d)
        apart = two.dxv_by_dxp @ space.from_tangent(xp) * np.array(sds)
        return Lifted(
            np.concatenate([one.xv, two.xv]),
            np.concatenate([one.dxv_by_dxp, two.dxv_by_dxp]),
            block_diag([one.P_rest, two.P_rest + apart @ apart.T]),
        )

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        each = self._each(xv, u, k)
        return np.concatenate([model.f_noisy(x, v, dt, c, rng) for model, x, v, c in each])

    def stay(self, xv: Vec, dt: float) -> Vec:
        x1, x2 = self._states(xv)
        return np.concatenate([self.first.stay(x1, dt), self.second.stay(x2, dt)])

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Both to the same goal; the one that is there waits for the other."""
        models = (self.first, self.second)
        us = [m.navigate(x, goal, dt) for m, x in zip(models, self._states(xv), strict=True)]
        if all(u is None for u in us):
            return None
        still = (m.stay(x, dt) for m, x in zip(models, self._states(xv), strict=True))
        return np.concatenate([z if u is None else u for u, z in zip(us, still, strict=True)])


def _whole(function: Callable[..., Any], *args: Vec) -> Any:
    """function(*args) with the Jacobians it leaves to numbers."""
    return completed(function(*args), function, *args)


def _moved(model: MotionModel, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
    return _whole(lambda x, v, c: model.f(x, v, dt, c), xv, u, k)
