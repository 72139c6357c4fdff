"""What a motion model is: how a robot moves, and where its sensors are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from inspect import unwrap
from typing import ClassVar, NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import Space
from scene_core.models.base.results import Normalised, Redefined


class Transition(NamedTuple):
    """fv and its Jacobians with respect to state (n), controls (nu) and calibration (nk)."""

    fv: Vec
    dfv_by_dxv: Mat | None = None
    dfv_by_du: Mat | None = None
    dfv_by_dk: Mat | None = None


class PositionState(NamedTuple):
    """xp (in the model's space) and dxp/dxv."""

    xp: Vec
    dxp_by_dxv: Mat | None = None


class Lifted(NamedTuple):
    """A state built from a position state; P_rest is the covariance of what xp can not say."""

    xv: Vec
    dxv_by_dxp: Mat
    P_rest: Mat


class MotionModel(ABC):
    """xv(t + dt) = f(xv, u, dt, k) + q. Scene's Motion_Model; unbatched.

    Angles in the state are radians. A quaternion in the state carries the labels qw qx qy qz, a
    planar heading the label phi; what belongs to another pose than the base's has a prefix with a
    colon (2:qw, see `labels`).
    """

    name: ClassVar[str]
    """The word the settings file and the page use."""
    space: ClassVar[Space]
    state_labels: ClassVar[tuple[str, ...]]
    state_units: ClassVar[tuple[str, ...]]
    control_labels: ClassVar[tuple[str, ...]] = ()
    control_units: ClassVar[tuple[str, ...]] = ()
    calib_labels: ClassVar[tuple[str, ...]] = ()
    calib_units: ClassVar[tuple[str, ...]] = ()
    hooks: ClassVar[tuple[str, ...]] = ("base",)
    bodies: ClassVar[tuple[str, ...]] = ("base",)
    """Hooks that are robots of their own, base first: each has a trail, an error and a NEES."""
    world_fixed: ClassVar[tuple[str, ...]] = ()
    """Directions of the world the equations rely on: gravity, north, plane."""

    @property
    def state_size(self) -> int:
        return len(self.state_labels)

    @property
    def navigates(self) -> bool:
        """Whether it steers to a goal by itself: it has controls and a `navigate` of its own."""
        own = unwrap(type(self).navigate) is not MotionModel.navigate
        return own and len(self.control_labels) > 0

    @property
    def calib0(self) -> Vec:
        """Nominal calibration, from the model's own fields; (len(calib_labels),)."""
        return np.zeros(0)

    @abstractmethod
    def f(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Transition:
        """The process equation and its Jacobians."""

    @abstractmethod
    def Q(self, xv: Vec, u: Vec, dt: float, k: Vec) -> Mat:
        """Process noise covariance over dt, without the noise of the controls."""

    def U(self, u: Vec, dt: float) -> Mat:
        """Covariance of the controls when the frame gives none."""
        return np.zeros((len(self.control_labels),) * 2)

    def U_unknown(self, dt: float) -> Mat:
        """Covariance of controls that nobody sent (the model runs with zeros for them)."""
        return self.U(np.zeros(len(self.control_labels)), dt)

    @abstractmethod
    def xp(self, xv: Vec, hook: str = "base") -> PositionState:
        """Position state of a hook, in `space`."""

    @abstractmethod
    def redefine(self, xv: Vec, xpdef: Vec) -> Redefined:
        """xv in axes whose origin is the position state xpdef."""

    def normalise(self, xv: Vec) -> Normalised:
        """xv on its constraint (unit quaternion, wrapped angle); identity unless overridden."""
        return Normalised(xv, np.eye(self.state_size))

    @abstractmethod
    def lift(self, xp: Vec) -> Lifted:
        """A state of this model for a robot known only by its position state (live swap)."""

    @abstractmethod
    def f_noisy(self, xv: Vec, u: Vec, dt: float, k: Vec, rng: np.random.Generator) -> Vec:
        """The process with its own noise: simulation only."""

    def stay(self, xv: Vec, dt: float) -> Vec:
        """Controls that bring xv to rest where it is: zero, unless there is a speed to be lost or
        a weight to be held."""
        return np.zeros(len(self.control_labels))

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Controls that bring xv nearer to the position `goal`; None once it has arrived."""
        return None
