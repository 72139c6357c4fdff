"""What an internal measurement model is: what a robot measures of itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base.fault import Fault


class InternalMeasurement(NamedTuple):
    """hv and its Jacobian with respect to the needed components."""

    hv: Vec
    dhv: Mat | None = None


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
