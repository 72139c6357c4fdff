"""What a sensor is: how points and lines given in its own frame are measured."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import Space


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
