"""Lines kept as two points of them, each in the coordinates of a point landmark.

y = (what both points share, the rest of the first, the rest of the second). Everything a line needs
is asked of the point's parametrisation, once for either end.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import (
    FeatureModel,
    Initialised,
    Normalised,
    Primitive,
    Redefined,
    completed,
)
from scene_core.models.straight_line import StraightLine, cut, evenly


@dataclass(frozen=True)
class PointPair(StraightLine):
    """X = (X1, X2), the primitives of two points with `shared` leading components in common."""

    shown = (0.0, 1.0)
    shared: ClassVar[int]
    """3 for a common anchor."""

    @property
    @abstractmethod
    def support(self) -> FeatureModel:
        """How either point is kept."""

    @property
    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Which components of y belong to the first and to the second point."""
        common, size = np.arange(self.shared), self.support.state_size
        rest = np.arange(self.shared, size)
        return np.r_[common, rest], np.r_[common, rest + size - self.shared]

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        point = self.support
        y = np.empty((*X.shape[:-1], self.state_size))
        by_xws, by_X = np.zeros((*y.shape, len(xws))), np.zeros((*y.shape, 8))
        for rows, at in zip(self.rows, (slice(0, 4), slice(4, 8)), strict=True):
            one = completed(point.initialise(xws, X[..., at]), point.initialise, xws, X[..., at])
            assert one.dy_by_dxws is not None and one.dy_by_dX is not None
            y[..., rows], by_xws[..., rows, :], by_X[..., rows, at] = one
        return Initialised(y, by_xws, by_X)

    def primitive(self, y: Vec) -> Primitive:
        point = self.support
        X, by_y = np.empty((*y.shape[:-1], 8)), np.zeros((*y.shape[:-1], 8, y.shape[-1]))
        for rows, at in zip(self.rows, (slice(0, 4), slice(4, 8)), strict=True):
            one = completed(point.primitive(y[..., rows]), point.primitive, y[..., rows])
            X[..., at], by_y[..., at, rows] = one
        return Primitive(X, by_y)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        point = self.support
        value, by_y = np.empty(y.shape), np.zeros((*y.shape, y.shape[-1]))
        by_xpdef = np.zeros((*y.shape, len(xpdef)))
        for rows in self.rows:
            one = completed(
                point.redefine(y[..., rows], xpdef), point.redefine, y[..., rows], xpdef
            )
            value[..., rows], by_xpdef[..., rows, :] = one.value, one.by_xpdef
            by_y[..., rows[:, None], rows] = one.by_state
        return Redefined(value, by_y, by_xpdef)

    def normalise(self, y: Vec) -> Normalised | None:
        point = self.support
        value, J = np.empty(y.shape), np.zeros((*y.shape, y.shape[-1]))
        for rows in self.rows:
            one = point.normalise(y[..., rows])
            if one is None:
                return None
            value[..., rows] = one.value
            J[..., rows[:, None], rows] = (
                np.eye(len(rows)) if one.jacobian is None else one.jacobian
            )
        return Normalised(value, J)

    def ends(self, y: Vec, t: Vec) -> Vec:
        """X(t) = X1 + t (X2 - X1)."""
        return evenly(self.primitive(y).X, t)

    def along(self, y: Vec, origin: Vec, rays: Vec) -> Vec:
        return cut(self.primitive(y).X, origin, rays)
