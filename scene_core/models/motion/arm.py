"""An articulated arm on a foot that does not move, with the sensor in its hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D, relative, wrap
from scene_core.models import reach
from scene_core.models.base import (
    Lifted,
    MotionModel,
    Normalised,
    PositionState,
    Redefined,
    Transition,
)
from scene_core.models.sampling import noisy_process
from scene_core.params import ParamError, param

FOOT = slice(0, 7)
DETOUR = 2.0
"""The hand goes straight where the joints turn at most so many times as far as they had to."""


@dataclass(frozen=True)
class Arm(MotionModel):
    """n revolute joints at commanded rates; the position state is a function of their angles.

    qi' = qi + ki ui dt;  foot' = foot
    xp = foot * T1 * ... * Tn,  Ti = (R(axis_i, qi) (l_i, 0, 0), q(axis_i, qi)): a turn about the
    joint's own axis, then l_i along the link's x

    xv = (foot:x, foot:y, foot:z, foot:qw, foot:qx, foot:qy, foot:qz, q1, ..., qn) [m, 1, rad];
    u = (u1, ..., un) [rad/s]; k = (gear 1, ..., gear n), true rate over commanded rate.
    U = diag(sd_rate^2 + (sd_gear ui)^2), Q = 0.
    Hooks: base is the hand, so a sensor in it needs nothing special; foot; joint i turns with
    link i.

    Source: Davison, *Models and State Representation in Scene*, section 4, which asks for robots
    of several parts; kinematics as in Siciliano et al., *Robotics*, 2.8.
    """

    name = "arm"
    space = THREE_D

    axes: tuple[Literal["x", "y", "z"], ...] = ("z", "y", "y")
    """Axis of every joint in the frame of the link before it, the foot's for the first."""
    lengths: tuple[float, ...] = param(
        (0.1, 0.4, 0.3), unit="m", lo=0.0, hi=100.0, label="Link lengths"
    )
    """How far it is from every joint to the next, and from the last to the hand."""
    gears: tuple[float, ...] = param((1.0, 1.0, 1.0), lo=0.1, hi=10.0, label="Gears")
    """True rate of every joint over its commanded rate, where it is not estimated."""
    rest_angles: tuple[float, ...] = param(
        (0.0, -0.8, 1.2), unit="rad", lo=-np.pi, hi=np.pi, effect="on reset", label="Rest angles"
    )
    """Angles of the joints when the arm takes over from a model that has none."""
    rest_sd_angle: float = param(0.05, unit="rad", lo=0.0, hi=3.2, effect="on reset")
    """Standard deviation of every angle then; the foot stands where the hand is as before."""
    sd_rate: float = param(0.01, unit="rad/s", lo=0.0, hi=10.0, soft=(0.0, 0.1), label="Rate noise")
    """Standard deviation of the rate that the encoder of a joint reports, also at rest."""
    sd_gear: float = param(0.02, lo=0.0, hi=2.0, soft=(0.0, 0.2), label="Gear noise")
    """Standard deviation of a rate, as a fraction of the rate."""
    unknown_sd_rate: float = param(0.5, unit="rad/s", lo=0.0, hi=10.0, soft=(0.0, 2.0))
    """Standard deviation of every rate while nobody sends any."""
    max_rate: float = param(0.5, unit="rad/s", lo=0.01, hi=10.0, soft=(0.05, 2.0))
    """No joint turns faster on the way to a waypoint."""
    arrive: float = param(0.02, unit="m", lo=0.0, hi=5.0, soft=(0.001, 0.2), label="Arrival")
    """A waypoint counts as reached when the hand is within this distance."""

    def __post_init__(self) -> None:
        for name in ("lengths", "gears", "rest_angles"):
            if len(getattr(self, name)) != self.joints or not self.joints:
                raise ParamError(
                    f"'{self.name}' has {self.joints} joints by its axes: give at least one, and "
                    f"as many {name.replace('_', ' ')} (there are {len(getattr(self, name))})"
                )

    @property
    def joints(self) -> int:
        return len(self.axes)

    def _numbered(self, word: str) -> tuple[str, ...]:
        return tuple(f"{word}{i}" for i in range(1, self.joints + 1))

    @property
    def state_labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The foot has labels of its own: where it is, is not where the hand is."""
        return (*(f"foot:{label}" for label in THREE_D.labels), *self._numbered("q"))

    @property
    def state_units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return (*THREE_D.units, *("rad",) * self.joints)

    @property
    def control_labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._numbered("u")

    @property
    def control_units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("rad/s",) * self.joints

    @property
    def calib_labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._numbered("gear ")

    @property
    def calib_units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("",) * self.joints

    @property
    def hooks(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("base", "foot", *self._numbered("joint "))

    @property
    def calib0(self) -> Vec:
        return np.array(self.gears)

    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        n, size = self.joints, self.state_size
        fv = xv.copy()
        fv[7:] = wrap(fv[7:] + k * u * dt)
        dfv_by_du, dfv_by_dk = np.zeros((size, n)), np.zeros((size, n))
        dfv_by_du[7:], dfv_by_dk[7:] = np.diag(k * dt), np.diag(u * dt)
        return Transition(fv, np.eye(size), dfv_by_du, dfv_by_dk)

    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        return np.zeros((self.state_size,) * 2)

    def U(self, u: Vec, dt: float) -> Mat:
        return np.diag(self.sd_rate**2 + (self.sd_gear * u) ** 2)

    def U_unknown(self, dt: float) -> Mat:
        return self.unknown_sd_rate**2 * np.eye(self.joints)

    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        last = {"base": self.joints, "foot": 0}.get(hook)
        is_at_joint = last is None
        if last is None:
            last = int(hook.removeprefix("joint "))
        x, J = xv[FOOT], np.eye(7, self.state_size)
        for i in range(last):
            length = 0.0 if is_at_joint and i == last - 1 else self.lengths[i]
            link, by_angle = _link(self.axes[i], float(xv[7 + i]), length)
            moved = THREE_D.compose(x, link)
            x, J = moved.x, moved.by_a @ J
            J[:, 7 + i] += moved.by_b @ by_angle
        return PositionState(x, J)

    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        seen = relative(THREE_D, xpdef, xv[FOOT])
        by_state = np.eye(self.state_size)
        by_state[FOOT, FOOT] = seen.by_b
        by_xpdef = np.zeros((self.state_size, 7))
        by_xpdef[FOOT] = seen.by_a
        return Redefined(np.concatenate([seen.x, xv[7:]]), by_state, by_xpdef)

    def normalise(self, xv: Vec) -> Normalised:
        out, J = xv.copy(), np.eye(self.state_size)
        out[3:7], J[3:7, 3:7] = quaternion.normalise(xv[3:7])
        out[7:] = wrap(out[7:])
        return Normalised(out, J)

    def lift(self, xp: Vec) -> Lifted:
        """The hand at xp; whatever the angles are, the foot stands so that it is."""
        rest = np.concatenate([THREE_D.identity(), self.rest_angles])
        hand = self.xp(rest)
        assert hand.dxp_by_dxv is not None
        back = THREE_D.inverse(hand.xp)
        foot = THREE_D.compose(xp, back.x)
        by_angles = np.zeros((self.state_size, self.joints))
        by_angles[FOOT] = foot.by_b @ back.jacobian @ hand.dxp_by_dxv[:, 7:]
        by_angles[7:] = np.eye(self.joints)
        dxv_by_dxp = np.zeros((self.state_size, 7))
        dxv_by_dxp[FOOT] = foot.by_a
        P_rest = self.rest_sd_angle**2 * by_angles @ by_angles.T
        return Lifted(np.concatenate([foot.x, self.rest_angles]), dxv_by_dxp, P_rest)

    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        return noisy_process(self, xv, u, dt, k, rng)

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Rates that bring the hand to `goal` (x, y, z) [m]: straight by damped least squares, or,
        where the arm would fold over itself or take a detour, by the shortest turn of its joints
        to angles that reach it. To a goal out of reach it comes as near as it can, and stays."""
        q, arm = xv[7:], (self.axes, self.lengths)
        there = THREE_D.to_local(xv[FOOT], np.append(goal, 1.0)).X[:3]
        p, J = reach.hand(*arm, q)
        if np.linalg.norm(there - p) <= self.arrive:
            return None
        close = max(self.arrive / 2.0, reach.CLOSE * sum(self.lengths))
        angles, away = reach.nearest(*arm, there, close)
        turns = wrap(angles - q)
        ways = np.abs(turns).max(axis=1)
        # The lesser of both ways falls with every step, whichever is taken: it ends.
        if away <= close and reach.straight(*arm, q, there, close) <= DETOUR * ways.min():
            turn = reach.step(J, there - p)
        else:
            turn = turns[ways.argmin()]
        fastest = np.abs(turn).max() / dt
        return turn / dt * min(1.0, self.max_rate / max(fastest, 1e-12)) / self.calib0


def _link(axis: str, angle: float, length: float) -> tuple[Vec, Mat]:
    """Pose (7,) of the end of a link in the frame before its joint, and its derivative by the
    angle [rad]."""
    i = "xyz".index(axis)
    c, s = np.cos(angle / 2), np.sin(angle / 2)
    turn, by_angle = np.zeros(4), np.zeros(4)
    turn[0], turn[1 + i] = c, s
    by_angle[0], by_angle[1 + i] = -s / 2, c / 2
    end = quaternion.rotate(turn, np.array([length, 0.0, 0.0]))
    return np.concatenate([end.v, turn]), np.concatenate([end.by_q @ by_angle, by_angle])
