"""What a feature model is: how a landmark is kept in the state."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import Space
from scene_core.models.base.results import Normalised, Redefined


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
