"""A point in a plane."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import TWO_D
from scene_core.models import euclidean
from scene_core.models.base import FeatureModel, Glyphs, Initialised, Primitive, Redefined


@dataclass(frozen=True)
class Point2D(FeatureModel):
    """y = (z, x) [m]; X = (y, 1). A first measurement must be complete.

    Source: Davison, *Models and State Representation in Scene*, section 4.2.
    """

    name = "2-D point"
    space = TWO_D
    state_labels = ("z", "x")
    state_units = ("m", "m")

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        return euclidean.initialise(self.space, xws, X)

    def primitive(self, y: Vec) -> Primitive:
        return euclidean.primitive(self.space, y)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        return euclidean.redefine(self.space, y, xpdef)

    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        return Glyphs(y, Pyy)
