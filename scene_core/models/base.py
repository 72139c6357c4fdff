"""What a model is: the abstract base classes and result tuples every model is written against.

A model is a *value*: a frozen dataclass whose fields are Scene's constant parameters and whose
methods are pure functions. A function returns its value and its Jacobian with respect to every
argument; a Jacobian returned as ``None`` is filled in by central differences (`completed`).
Sensor and feature functions are batched: ``(..., n)`` in, ``(..., m)`` and ``(..., m, n)`` out.
Jacobians that are the same for the whole batch may omit the batch axes (they broadcast).

Concrete models are final: nothing inherits from a concrete model.

Source: Davison, *Models and State Representation in Scene*, section 5; Solà, *An EKF-SLAM toolbox
in Matlab*, section 5.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from enum import IntFlag
from functools import cache
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import Space


class Fault(IntFlag):
    """Why a feature can not be measured; zero means measurable (Scene's visibility test)."""

    NONE = 0
    BEHIND = 1
    """Behind the sensor, or on the wrong side of a projection."""
    OUTSIDE = 2
    """Outside the image, the field of view or the reach of the sensor."""
    SCALE = 4
    """Seen from much nearer or farther than when it was initialised."""
    ANGLE = 8
    """Seen from a much different direction than when it was initialised."""
    UNCERTAIN = 16
    """The search region is too large to be searched."""
    INFEASIBLE = 32
    """An internal measurement that has no meaning in this state."""


FAULT_WORDS: Mapping[Fault, str] = {
    Fault.BEHIND: "behind the sensor",
    Fault.OUTSIDE: "outside the field of view",
    Fault.SCALE: "seen from too different a distance",
    Fault.ANGLE: "seen from too different a direction",
    Fault.UNCERTAIN: "search region too large",
    Fault.INFEASIBLE: "not feasible in this state",
}


@cache
def words(fault: int) -> str:
    """The reasons in `fault` as a phrase, empty when measurable."""
    return ", ".join(text for bit, text in FAULT_WORDS.items() if fault & bit)


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


class Redefined(NamedTuple):
    """A state in new axes, with Jacobians by the old state and by the pose of the new origin."""

    value: Vec
    by_state: Mat | None = None
    by_xpdef: Mat | None = None


class Normalised(NamedTuple):
    """A state on its constraint, with the exact Jacobian of the normalisation."""

    value: Vec
    jacobian: Mat | None = None


class Lifted(NamedTuple):
    """A state built from a position state; P_rest is the covariance of what xp can not say."""

    xv: Vec
    dxv_by_dxp: Mat
    P_rest: Mat


class Projection(NamedTuple):
    """h (..., m) with dh/dX (..., m, d+1) and dh/dk (..., m, nk)."""

    h: Vec
    dh_by_dX: Mat | None = None
    dh_by_dk: Mat | None = None


class Backprojection(NamedTuple):
    """X (..., d+1) in the sensor frame (unit direction, w = inverse distance) and Jacobians."""

    X: Vec
    dX_by_dz: Mat | None = None
    dX_by_dn: Mat | None = None
    dX_by_dk: Mat | None = None


class Innovation(NamedTuple):
    """nu = z - h with angles wrapped, and its Jacobians by h and by z."""

    nu: Vec
    dnu_by_dh: Mat | None = None
    dnu_by_dz: Mat | None = None


class Initialised(NamedTuple):
    """A feature state y with Jacobians by the sensor pose in the world and by X (sensor frame)."""

    y: Vec
    dy_by_dxws: Mat | None = None
    dy_by_dX: Mat | None = None


class Primitive(NamedTuple):
    """Homogeneous point X (..., d+1), or the two points of a line (..., 2 (d+1)), of a feature
    state, in the frame the state is in."""

    X: Vec
    dX_by_dy: Mat | None = None


class FreePrimitive(NamedTuple):
    """A homogeneous point X (..., d+1) of a state y and free parameters lam."""

    X: Vec
    dX_by_dy: Mat | None = None
    dX_by_dlam: Mat | None = None


class Converted(NamedTuple):
    """A state in the successor's parametrisation and its Jacobian."""

    y: Vec
    dy_by_dy: Mat | None = None


class Settled(NamedTuple):
    """The same for a state whose free parameters have become certain enough."""

    y: Vec
    dy_by_dy: Mat | None = None
    dy_by_dlam: Mat | None = None


class Particles(NamedTuple):
    """A distribution over free parameters: lam (K, f) with weights w (K,) that sum to one."""

    lam: Vec
    w: Vec


class Glyphs(NamedTuple):
    """Scene's graphics state: mean (N, d), covariance (N, d, d), ends of rays (N, 2, d)."""

    mean: Vec
    cov: Mat
    ends: Vec | None = None
    """Near and far end of a depth that is still uncertain; None for a plain point."""


class InternalMeasurement(NamedTuple):
    """hv and its Jacobian with respect to the needed components."""

    hv: Vec
    dhv: Mat | None = None


_Result = TypeVar("_Result", bound=tuple)


def completed(result: _Result, function: Any, *args: Vec) -> _Result:
    """`result` with every Jacobian that is None replaced by central differences of `function`.

    The Jacobian fields of a result follow its value in the order of `args`.
    """
    if all(part is not None for part in result):
        return result
    filled = list(result)
    for i in range(1, len(filled)):
        if filled[i] is None:
            filled[i] = central_differences(lambda *a: function(*a)[0], args, i - 1)
    return type(result)(*filled)


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
    world_fixed: ClassVar[tuple[str, ...]] = ()
    """Directions of the world the equations rely on: gravity, north, plane."""

    @property
    def state_size(self) -> int:
        return len(self.state_labels)

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

    def navigate(self, xv: Vec, goal: Vec, dt: float) -> Vec | None:
        """Controls that bring xv nearer to the position `goal`; None once it has arrived."""
        return None


class Sensor(ABC):
    """h = project(X_S, k): measures primitives given in its own frame. Batched."""

    name: ClassVar[str]
    space: ClassVar[Space]
    pane: ClassVar[str]
    """How its measurement space is drawn: image, polar or bar."""
    measurement_size: ClassVar[int]
    labels: ClassVar[tuple[str, ...]]
    units: ClassVar[tuple[str, ...]]
    calib_labels: ClassVar[tuple[str, ...]] = ()
    calib_units: ClassVar[tuple[str, ...]] = ()
    unmeasured: ClassVar[tuple[str, ...]] = ()
    """What one measurement of a point leaves open, e.g. ("rho",); its prior is the feature's."""

    @property
    def calib0(self) -> Vec:
        """Nominal calibration, from the sensor's own fields; (len(calib_labels),)."""
        return np.zeros(0)

    @property
    @abstractmethod
    def limits(self) -> tuple[tuple[float, float], ...]:
        """Range of every measured coordinate."""

    @abstractmethod
    def project(self, X: Vec, k: Vec) -> Projection:
        """Measurement of homogeneous points X (..., d+1). Of degree zero in X; never divides by w
        unless it measures range."""

    @abstractmethod
    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """The point seen at z (..., m) with the unmeasured part n (..., mn): unit ray and w."""

    @abstractmethod
    def R(self, h: Vec) -> Mat:
        """Measurement noise covariance (..., m, m) at predicted measurements h."""

    def nu(self, h: Vec, z: Vec) -> Innovation:
        """z - h and nothing else, dnu/dz = I; a sensor with angles wraps them to (-pi, pi]."""
        eye = np.eye(self.measurement_size)
        return Innovation(z - h, -eye, eye)

    @abstractmethod
    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """Fault flags (...,) for features predicted at h, at X in the sensor frame, seen from the
        sensor pose xws (n,), first seen from pose0 (..., n), at y_X (..., d+1) in the world."""

    def selection_score(self, E: Mat) -> Vec:
        """Value of measuring now, from the innovation covariance without R: its trace."""
        return np.trace(E, axis1=-2, axis2=-1)

    def h_noisy(self, X: Vec, k: Vec, rng: np.random.Generator) -> Vec:
        """Simulated measurements (N, m) of points X (N, d+1): Gaussian noise of covariance R."""
        h = self.project(X, k).h
        L = np.linalg.cholesky(self.R(h))
        return h + (L @ rng.standard_normal(h.shape)[..., None])[..., 0]


Shape = Literal["point", "segment"]


class FeatureModel(ABC):
    """A landmark parametrisation: y -> homogeneous point, or two of them for a line. Batched.

    The two points of a segment travel as one vector X (..., 2 (d+1)). A model with free parameters
    (`free_labels`) is *partial*: particles carry them, its block of the state is left alone by
    updates, and `point` takes the place of `primitive` until it has `settled`.
    """

    name: ClassVar[str]
    space: ClassVar[Space]
    shape: ClassVar[Shape] = "point"
    state_labels: ClassVar[tuple[str, ...]]
    state_units: ClassVar[tuple[str, ...]]
    free_labels: ClassVar[tuple[str, ...]] = ()
    """Parameters that particles carry; none for a complete parametrisation."""
    free_units: ClassVar[tuple[str, ...]] = ()
    prune: ClassVar[float] = 0.05
    """A particle is dropped when its weight falls below this part of the average weight."""
    unmeasured: ClassVar[tuple[str, ...]] = ()
    """What may be missing from a first measurement because `prior` or the particles supply it; for
    a segment what is missing from either end, e.g. ("rho",)."""

    @property
    def state_size(self) -> int:
        return len(self.state_labels)

    def successor(self) -> FeatureModel | None:
        """The parametrisation it is converted to once `ready`; None for a final one."""
        return None

    def prior(self) -> tuple[Vec, Mat]:
        """Mean n and covariance N of `unmeasured`; of both ends of a segment one after the other.

        A partial model leaves to the particles what has the covariance zero here.
        """
        return np.zeros(0), np.zeros((0, 0))

    @abstractmethod
    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        """y from the sensor pose in the world xws (n,) and X (..., d+1) in the sensor frame (unit
        direction, w = inverse distance)."""

    @abstractmethod
    def primitive(self, y: Vec) -> Primitive:
        """Homogeneous point of y, in the frame y is expressed in; w >= 0. For a segment two points
        that span its line."""

    @abstractmethod
    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        """y in axes whose origin is the position state xpdef."""

    def normalise(self, y: Vec) -> Normalised | None:
        """y on its constraint, or None when it has none."""
        return None

    @abstractmethod
    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        """What to draw: means and covariances in `space`."""

    def ready(self, y: Vec, Pyy: Mat, xws: Vec) -> np.ndarray:
        """Which of y (N, n) may be converted now, seen from the sensor pose xws."""
        return np.zeros(len(y), dtype=bool)

    def convert(self, y: Vec) -> Converted:
        """y in the successor's parametrisation."""
        raise NotImplementedError(f"{self.name} has no successor")

    # Segments only.

    def ends(self, y: Vec, t: Vec) -> Vec:
        """Homogeneous points X (..., 2 (d+1)) at the places t (..., 2) along the line."""
        raise NotImplementedError(f"{self.name} is no line")

    def along(self, y: Vec, origin: Vec, rays: Vec) -> Vec:
        """Places t (..., 2) on the line nearest to two rays (..., 2, d) from `origin` (d,)."""
        raise NotImplementedError(f"{self.name} is no line")

    # Partial features only.

    def particles0(self) -> Particles:
        """The free parameters after the first view."""
        raise NotImplementedError(f"{self.name} has no free parameters")

    def point(self, y: Vec, lam: Vec) -> FreePrimitive:
        """Homogeneous point of y (..., n) and lam (..., f)."""
        raise NotImplementedError(f"{self.name} has no free parameters")

    def redefine_free(self, lam: Vec, xpdef: Vec) -> Vec:
        """lam (K, f) in axes whose origin is the position state xpdef; unchanged unless it is told
        in the axes of the world."""
        return lam

    def moments(self, particles: Particles) -> tuple[Vec, Mat]:
        """Mean (f,) and covariance (f, f) of the free parameters."""
        lam, w = particles
        mean = w @ lam
        e = lam - mean
        return mean, (w[:, None] * e).T @ e

    def spent(self, particles: Particles) -> bool:
        """Whether so few particles are left that they say nothing: the feature is given up."""
        return False

    def settled(self, y: Vec, particles: Particles) -> bool:
        """Whether the particles have collapsed far enough for `settle` to be linear."""
        return False

    def settle(self, y: Vec, lam: Vec) -> Settled:
        """y and lam in the successor's parametrisation."""
        raise NotImplementedError(f"{self.name} has no free parameters")


class InternalMeasurementModel(ABC):
    """hv = h(xv): what a robot measures of itself. Unbatched.

    `needs` names state components of the motion model by label; the model runs on any motion
    model that has them.
    """

    name: ClassVar[str]
    needs: ClassVar[tuple[str, ...]]
    labels: ClassVar[tuple[str, ...]]
    units: ClassVar[tuple[str, ...]]
    world_fixed: ClassVar[tuple[str, ...]] = ()
    """Directions of the world the measurement relies on: gravity, north, plane."""

    @property
    def measurement_size(self) -> int:
        return len(self.labels)

    @abstractmethod
    def h(self, needed: Vec) -> InternalMeasurement:
        """The measurement function and its Jacobian by `needed`."""

    @abstractmethod
    def R(self, hv: Vec) -> Mat:
        """Measurement noise covariance."""

    def nu(self, hv: Vec, zv: Vec) -> Vec:
        """Innovation; wrap angles here."""
        return zv - hv

    def feasible(self, needed: Vec, hv: Vec) -> Fault:
        """Zero when the measurement makes sense in this state."""
        return Fault.NONE

    def h_noisy(self, needed: Vec, rng: np.random.Generator) -> Vec:
        """A simulated measurement."""
        hv = self.h(needed).hv
        return hv + np.linalg.cholesky(self.R(hv)) @ rng.standard_normal(len(hv))
