"""Straight lines as landmarks: what all of them have in common.

How far the segment that was seen reaches along its line is told outside the filter, by two places
t: what t counts is the parametrisation's to say.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import THREE_D
from scene_core.models.base import Glyphs
from scene_core.models.rho_prior import RhoPrior
from scene_core.params import param


@dataclass(frozen=True)
class StraightLine(RhoPrior):
    """A line of which a first view leaves the inverse distance of both ends to the prior.

    Source: Solà, *An EKF-SLAM toolbox in Matlab*, line landmarks and its `userDataLin`.
    """

    space = THREE_D
    shape = "segment"
    shown: ClassVar[tuple[float, float]]
    """The part of the line that is drawn when nobody knows how far the segment reaches."""

    rho_mean: float = param(
        0.1, unit="1/m", lo=1e-6, hi=100.0, soft=(0.001, 2.0), effect="next feature", label="Prior"
    )
    """Inverse distance of either end of a new line."""
    far: float = param(20.0, unit="m", lo=0.1, hi=1e5, soft=(2.0, 100.0), label="Drawn to")
    """An end is drawn no farther away than this."""

    @abstractmethod
    def ends(self, y: Vec, t: Vec) -> Vec: ...

    @abstractmethod
    def along(self, y: Vec, origin: Vec, rays: Vec) -> Vec:
        """The places in the directions nearest to those of the rays."""

    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        """Both ends of `shown`, and its middle with its first-order ellipsoid."""
        ends, _ = self.drawn(y, Pyy, np.broadcast_to(self.shown, (*y.shape[:-1], 2)))
        halfway = np.full((*y.shape[:-1], 2), sum(self.shown) / 2.0)
        middle, cov = self.drawn(y, Pyy, halfway)
        return Glyphs(middle[..., 0, :], cov[..., 0, :, :], ends)

    def drawn(self, y: Vec, Pyy: Mat, t: Vec) -> tuple[Vec, Mat]:
        """The places (..., 2, 3) of both ends t (..., 2), and their covariances (..., 2, 3, 3)."""

        def places(y: Vec) -> Vec:
            X = self.ends(y, t).reshape(*y.shape[:-1], 2, 4)
            p = X[..., :3] / np.maximum(X[..., 3:], 1.0 / self.far)
            return p.reshape(*y.shape[:-1], 6)

        J = central_differences(places, (y,), 0)
        P = J @ Pyy @ np.swapaxes(J, -1, -2)
        P = np.stack([P[..., :3, :3], P[..., 3:, 3:]], axis=-3)
        return places(y).reshape(*y.shape[:-1], 2, 3), 0.5 * (P + np.swapaxes(P, -1, -2))


def evenly(X: Vec, t: Vec) -> Vec:
    """X(t) = X0 + t (X1 - X0) (..., 8) at t (..., 2), for the points X = (X0, X1) (..., 8)."""
    zero, step = X[..., :4], X[..., 4:] - X[..., :4]
    return np.concatenate([zero + t[..., :1] * step, zero + t[..., 1:] * step], axis=-1)


def cut(X: Vec, origin: Vec, rays: Vec) -> Vec:
    """t of `evenly` (..., 2), where the line through X0 and X1 is cut by the planes through the
    rays (..., 2, 3) from `origin` (3,), at right angles to the plane of origin and line."""
    zero = X[..., :3] - X[..., 3:4] * origin
    step = X[..., 4:7] - X[..., 7:8] * origin - zero
    across = np.cross(rays, np.cross(zero, step)[..., None, :])
    with np.errstate(divide="ignore", invalid="ignore"):
        return -np.vecdot(across, zero[..., None, :]) / np.vecdot(across, step[..., None, :])
