"""A camera in somebody's hand: the impulse model's own random pushes, and a person who steers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from scene_core.arrays import Vec
from scene_core.filter.ports import SourceError
from scene_core.geometry import quaternion
from scene_core.models.base import MotionModel
from scene_core.params import param
from scene_core.sources import noise
from scene_core.sources.drivers import Drive, Driver

PLACES = (
    (0.00, 0.55, 1.40),
    (0.35, 0.45, 1.46),
    (0.70, 0.20, 1.42),
    (0.85, -0.20, 1.50),
    (0.60, -0.60, 1.44),
    (0.15, -0.75, 1.40),
    (-0.30, -0.60, 1.48),
    (-0.65, -0.30, 1.42),
    (-0.85, 0.10, 1.36),
    (-0.70, 0.45, 1.44),
    (-0.35, 0.60, 1.46),
)
"""Once round the middle of the room."""
TARGETS = (
    (0.00, 2.50, 1.35),
    (1.40, 2.50, 1.30),
    (2.60, 1.90, 1.20),
    (3.00, 0.00, 1.25),
    (2.20, -2.20, 1.25),
    (3.00, -0.30, 1.20),
    (1.70, 2.30, 1.25),
    (-0.90, 2.50, 1.30),
    (-2.60, 1.90, 1.15),
    (-3.00, 0.40, 1.30),
    (-2.10, 2.20, 1.30),
)
"""From the poster to the right as far as the patterned wall, to the left as far as the window, and
back to the poster."""


@dataclass(frozen=True)
class HandHeld(Driver):
    """A round through a room and back, by a hand that trembles.

    In every frame the velocity and the angular velocity get an impulse (V, Omega) = (a, alpha) dt,
    with a = a_nom - 2 z f (v - v_nom) - f^2 (r - r_nom) + white noise, alpha likewise on the
    rotation vector from the nominal orientation; z = .5. The white part is chosen so that the mean
    square of each component of a and alpha is sd_accel^2 and sd_ang_accel^2, what an estimator with
    the impulse model expects; at 30 Hz it makes up more than nine tenths of it, so successive
    impulses are very nearly independent.

    The motion model must have the state components vx vy vz (world) and wx wy wz (robot).
    Source: this project; the model is Davison's (MonoSLAM, PAMI 2007, section 3.4).
    """

    name: ClassVar[str] = "hand held"
    sd_accel: float = param(
        1.0, unit="m/s²", lo=0.0, hi=50.0, soft=(0.1, 5.0), label="Acceleration"
    )
    """Root mean square of each component of the true acceleration."""
    sd_ang_accel: float = param(
        2.0, unit="rad/s²", lo=0.0, hi=100.0, soft=(0.1, 10.0), label="Angular acceleration"
    )
    """The same of the angular acceleration."""
    lap: float = param(33.0, unit="s", lo=1.0, hi=1e4, soft=(10.0, 120.0), effect="on reset")
    """Time for one round."""
    hold_place: float = param(1.0, unit="1/s", lo=0.05, hi=20.0, soft=(0.2, 4.0))
    """How firmly the hand keeps to its way: natural frequency f of the return to it."""
    hold_view: float = param(2.2, unit="1/s", lo=0.05, hi=20.0, soft=(0.2, 4.0))
    """How firmly it keeps its view."""
    places: tuple[tuple[float, float, float], ...] = PLACES
    """Where the round leads, m; reached at equal intervals."""
    targets: tuple[tuple[float, float, float], ...] = TARGETS
    """What the camera looks at from each of them, m."""

    def unfit(self, motion: MotionModel) -> str:
        missing = [s for s in (*VELOCITY, *TURN) if s not in motion.state_labels]
        if not missing:
            return ""
        return f"it pushes '{missing[0]}', and there is none in the state"

    def start(self, motion: MotionModel, dt: float) -> dict[str, float]:
        nominal = _nominal(self, dt, 0)
        values = np.concatenate([nominal.r, nominal.q, nominal.v, nominal.w])
        return dict(zip((*motion.space.labels, *VELOCITY, *TURN), values.tolist(), strict=True))

    def drive(
        self, motion: MotionModel, xv: Vec, memory: Any, index: int, dt: float, seed: int
    ) -> Drive:
        v_at, w_at = _rows(motion, VELOCITY), _rows(motion, TURN)
        pose = motion.xp(xv).xp
        was, now = _nominal(self, dt, index - 1), _nominal(self, dt, index)
        white = noise.rng(seed, "hand held", index).standard_normal((2, 3))
        white *= _white(self, dt) * dt
        f, g = self.hold_place, self.hold_view

        push = np.zeros(len(xv))
        push[v_at] = now.v - was.v - dt * (f * (xv[v_at] - was.v) + f * f * (pose[:3] - was.r))
        push[v_at] += white[0]
        off = quaternion.product(quaternion.conjugate(was.q), pose[3:])
        astray = quaternion.to_rotation_vector(off)[0]
        was_w, now_w = (quaternion.rotate_back(off, w).v for w in (was.w, now.w))
        push[w_at] = now_w - was_w - dt * (g * (xv[w_at] - was_w) + g * g * astray)
        push[w_at] += white[1]
        return Drive(np.zeros(len(motion.control_labels)), memory, push)


VELOCITY = ("vx", "vy", "vz")
TURN = ("wx", "wy", "wz")


class _Nominal(NamedTuple):
    """The steady hand's pose and its rates over the last interval."""

    r: Vec
    q: Vec
    v: Vec
    w: Vec


def _rows(motion: MotionModel, labels: tuple[str, ...]) -> list[int]:
    missing = [s for s in labels if s not in motion.state_labels]
    if missing:
        raise SourceError(
            f"the driver 'hand held' pushes the state component '{missing[0]}', which the true "
            f"motion model '{motion.name}' does not have: choose 'impulse' for the truth"
        )
    return [motion.state_labels.index(s) for s in labels]


@lru_cache(maxsize=8)
def _way(driver: HandHeld) -> tuple[CubicSpline, CubicSpline]:
    """Closed curves of place and target over the time of a round."""
    curves = []
    for knots in (driver.places, driver.targets):
        closed = np.array([*knots, knots[0]], dtype=float)
        t = np.linspace(0.0, driver.lap, len(closed))
        curves.append(CubicSpline(t, closed, bc_type="periodic"))
    return curves[0], curves[1]


@lru_cache(maxsize=4096)
def _pose(driver: HandHeld, dt: float, index: int) -> tuple[Vec, Vec]:
    """Nominal place (3,) and orientation q^WC (4,): the camera looks at its target, head up."""
    place, target = _way(driver)
    t = index * dt % driver.lap
    r = place(t)
    z = target(t) - r
    z /= np.linalg.norm(z)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return r, quaternion.from_matrix(np.column_stack([x, np.cross(z, x), z]))


def _nominal(driver: HandHeld, dt: float, index: int) -> _Nominal:
    (r0, q0), (r, q) = _pose(driver, dt, index - 1), _pose(driver, dt, index)
    turn = quaternion.product(quaternion.conjugate(q0), q)
    return _Nominal(r, q, (r - r0) / dt, quaternion.to_rotation_vector(turn)[0] / dt)


@lru_cache(maxsize=8)
def _white(driver: HandHeld, dt: float) -> Vec:
    """Standard deviation (2, 3) of the white part of acceleration and angular acceleration.

    A return with natural frequency f and damping z adds f (z + 1 / 4z) dt of the white part's mean
    square, the way itself its own mean square; together they make sd^2."""
    count = max(2, round(driver.lap / dt))
    way = [_nominal(driver, dt, i) for i in range(count)]
    rates = np.array([(n.v, n.w) for n in way])
    steered = (np.diff(rates, axis=0) / dt) ** 2
    sd = np.array([[driver.sd_accel], [driver.sd_ang_accel]])
    hold = np.array([[driver.hold_place], [driver.hold_view]])
    return np.sqrt(np.maximum(sd**2 - steered.mean(0), 0.0) / (1.0 + hold * dt))
