"""A point in the plane kept as direction and distance from the origin of the map."""

from dataclasses import dataclass

import numpy as np

from scene_core.geometry.spaces import TWO_D
from scene_core.models.base import FeatureModel, Glyphs, Initialised, Primitive, Redefined


@dataclass(frozen=True)
class PolarPoint(FeatureModel):
    name, space = "polar point", TWO_D
    state_labels, state_units = ("b", "r"), ("rad", "m")

    def initialise(self, xws, X):
        return Initialised(polar(TWO_D.to_world(xws, X).X))

    def primitive(self, y):
        c, s, r = np.cos(y[..., 0]), np.sin(y[..., 0]), y[..., 1]
        zero, one = np.zeros_like(r), np.ones_like(r)
        dX_by_dy = np.array([[-r * s, c], [r * c, s], [zero, zero]])
        return Primitive(
            np.stack([r * c, r * s, one], axis=-1), np.moveaxis(dX_by_dy, (0, 1), (-2, -1))
        )

    def redefine(self, y, xpdef):
        return Redefined(polar(TWO_D.to_local(xpdef, self.primitive(y).X).X))

    def graphics(self, y, Pyy):
        X, J = self.primitive(y)
        return Glyphs(X[..., :2], J[..., :2, :] @ Pyy @ np.swapaxes(J[..., :2, :], -1, -2))


def polar(X):
    """Direction and distance of homogeneous points (..., 3)."""
    return np.stack(
        [np.arctan2(X[..., 1], X[..., 0]), np.hypot(X[..., 0], X[..., 1]) / X[..., 2]], -1
    )
