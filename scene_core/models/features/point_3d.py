"""A point in space, kept as its coordinates."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D
from scene_core.models import euclidean
from scene_core.models.base import FeatureModel, Glyphs, Initialised, Primitive, Redefined


@dataclass(frozen=True)
class EuclideanPoint(FeatureModel):
    """y = (x, y, z) [m]; X = (y, 1). A first measurement must be complete.

    Source: Davison, Reid, Molton, Stasse, *MonoSLAM*, PAMI 2007, section 3.1; Solà, *An EKF-SLAM
    toolbox in Matlab*, landmark "eucPnt".
    """

    name = "Euclidean point"
    space = THREE_D
    state_labels = ("x", "y", "z")
    state_units = ("m", "m", "m")

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        return euclidean.initialise(self.space, xws, X)

    def primitive(self, y: Vec) -> Primitive:
        return euclidean.primitive(self.space, y)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        return euclidean.redefine(self.space, y, xpdef)

    def graphics(self, y: Vec, Pyy: Mat) -> Glyphs:
        return Glyphs(y, Pyy)
