"""Worlds without an order: landmarks anywhere in a box or a disc, the same for the same number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D, TWO_D, Space
from scene_core.params import param
from scene_core.sources import noise
from scene_core.sources.worlds import SimulatedWorld, rectangle

REGIONS = ("box", "disc")
RIM = 32
"""Sides of the polygon that shows a disc."""


@dataclass(frozen=True)
class RandomWorld(SimulatedWorld):
    """Points and segments anywhere over a square or a disc around the origin, up to a height."""

    name: ClassVar[str] = "random"
    space: ClassVar[Space] = THREE_D
    turns: ClassVar[bool] = True
    count: int = param(80, lo=0, hi=20000, soft=(0, 500), effect="on reset", label="Points")
    """Points."""
    count_segments: int = param(
        0, lo=0, hi=2000, soft=(0, 100), effect="on reset", label="Segments"
    )
    """Segments of straight lines."""
    region: str = param("box", choices=REGIONS, effect="on reset", label="Region")
    """Over which they are spread."""
    extent: float = param(6.0, unit="m", lo=0.01, hi=1e4, soft=(1.0, 50.0), effect="on reset")
    """Half side of the square, radius of the disc."""
    height: float = param(2.0, unit="m", lo=0.0, hi=1e4, soft=(0.0, 10.0), effect="on reset")
    """They lie between the ground and this."""
    length: float = param(1.5, unit="m", lo=0.01, hi=1e4, soft=(0.1, 10.0), effect="on reset")
    """Of the segments, at most."""
    layout: int = param(1, lo=0, effect="on reset")
    """Another number scatters them differently."""

    def points(self) -> tuple[np.ndarray, Vec]:
        return np.arange(1, self.count + 1), self._places("points", self.count)

    def segments(self) -> Mat:
        first = self._places("first ends", self.count_segments)
        way = self._places("second ends", self.count_segments) - first
        # Towards another place of the same convex region, so that both ends lie in it.
        far = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
        return np.stack([first, first + way * np.minimum(1.0, self.length / far)], axis=1)

    def outline(self) -> Mat:
        floor, roof = (_rim(self.region, self.extent, z) for z in (0.0, self.height))
        return np.concatenate([floor, roof])

    def _places(self, what: str, count: int) -> Vec:
        rng = noise.rng(self.layout, f"world:random:{what}")
        return np.column_stack(
            [
                _spread(self.region, self.extent, count, rng),
                rng.uniform(0.0, self.height, count),
            ]
        )


@dataclass(frozen=True)
class RandomPlane(SimulatedWorld):
    """Points (z, x) anywhere in a square or a disc around the origin of a plane."""

    name: ClassVar[str] = "random plane"
    space: ClassVar[Space] = TWO_D
    count: int = param(40, lo=0, hi=20000, soft=(0, 500), effect="on reset", label="Points")
    """Points."""
    region: str = param("box", choices=REGIONS, effect="on reset", label="Region")
    """Over which they are spread."""
    extent: float = param(6.0, unit="m", lo=0.01, hi=1e4, soft=(1.0, 50.0), effect="on reset")
    """Half side of the square, radius of the disc."""
    layout: int = param(1, lo=0, effect="on reset")
    """Another number scatters them differently."""

    def points(self) -> tuple[np.ndarray, Vec]:
        rng = noise.rng(self.layout, "world:random plane")
        return np.arange(1, self.count + 1), _spread(self.region, self.extent, self.count, rng)

    def outline(self) -> Mat:
        return _rim(self.region, self.extent, 0.0)[..., :2]


def _spread(region: str, extent: float, count: int, rng: np.random.Generator) -> Vec:
    """Places (count, 2), uniform over the region."""
    a, b = rng.random((2, count))
    if region == "box":
        return extent * np.column_stack([2.0 * a - 1.0, 2.0 * b - 1.0])
    radius, angle = extent * np.sqrt(a), 2.0 * np.pi * b
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def _rim(region: str, extent: float, z: float) -> Mat:
    """The edge (M, 2, 3) of the region at a height; a disc lies inside its polygon."""
    if region == "box":
        return rectangle(-extent, extent, -extent, extent, z)
    angle = 2.0 * np.pi * np.arange(RIM) / RIM
    radius = extent / np.cos(np.pi / RIM)
    at = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(RIM, z)])
    return np.stack([at, np.roll(at, -1, axis=0)], axis=1)
