"""A point on a line."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import ONE_D
from scene_core.models import euclidean
from scene_core.models.base import FeatureModel, Glyphs, Initialised, Primitive, Redefined


@dataclass(frozen=True)
class Point1D(FeatureModel):
    """y = (z) [m]; X = (y, 1). A first measurement must be complete.

    Source: Davison, Scene library, one-dimensional point feature.
    """

    name = "1-D point"
    space = ONE_D
    state_labels = ("z",)
    state_units = ("m",)

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        return euclidean.initialise(self.space, xws, X)

    def primitive(self, y: Vec) -> Primitive:
        return euclidean.primitive(self.space, y)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        return euclidean.redefine(self.space, y, xpdef)

    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        return Glyphs(y, Pyy)
