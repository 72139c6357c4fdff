"""Shapes of the map by their numbers: copies of a mesh, segments, swarms of particles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.world import Label
from web_panels.instances import Key


@dataclass(frozen=True)
class Bodies:
    """Copies of a mesh."""

    labels: tuple[Key, ...]
    positions: Vec
    """(N, 3)"""
    scales: Vec
    """(N, 3) half-axes, m."""
    wxyz: Vec
    """(N, 4)"""
    rows: np.ndarray
    """(N,) of the features they belong to."""


@dataclass(frozen=True)
class Lines:
    """The segments of a cloud."""

    rows: np.ndarray
    """(M,) in the cloud."""
    ends: Vec
    """(M, 2, 3)"""
    balls: Bodies
    """The ellipsoids at the ends, labelled (label, 0 or 1)."""

    def rods(self, labels: tuple[Label, ...], radius: float) -> Bodies:
        """The segments as rods of unit height, labelled as their features."""
        way = self.ends[:, 1] - self.ends[:, 0]
        length = np.linalg.norm(way, axis=1)
        thick = np.full(len(way), radius)
        return Bodies(
            tuple(labels[i] for i in self.rows),
            self.ends.mean(axis=1),
            np.stack([thick, thick, length], axis=1),
            turned_to(way),
            self.rows,
        )


@dataclass(frozen=True)
class Swarm:
    """The particles of a cloud's partial features, labelled (label, number)."""

    labels: tuple[Key, ...]
    rows: np.ndarray
    """(S,) of the features they belong to."""
    positions: Vec
    """(S, 3)"""
    weights: Vec
    """(S,) as a part of the heaviest one's of the same feature."""

    def grains(self, radius: float) -> Bodies:
        """Balls with a volume that grows with the weight."""
        size = radius * np.cbrt(np.maximum(self.weights, 0.02))
        upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(size), 1))
        scales = np.repeat(size[:, None], 3, axis=1)
        return Bodies(self.labels, self.positions, scales, upright, self.rows)


NO_BODIES = Bodies((), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 4)), np.zeros(0, int))
NO_LINES = Lines(np.zeros(0, int), np.zeros((0, 2, 3)), NO_BODIES)
NO_SWARM = Swarm((), np.zeros(0, int), np.zeros((0, 3)), np.zeros(0))


def turned_to(way: Vec) -> Vec:
    """Quaternions (N, 4) of the smallest turns from z to the directions way (N, 3)."""
    u = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    q = np.stack([1.0 + u[:, 2], -u[:, 1], u[:, 0], np.zeros(len(u))], axis=1)
    flipped = q[:, 0] < 1e-9
    q[flipped] = (0.0, 1.0, 0.0, 0.0)
    return q / np.linalg.norm(q, axis=1, keepdims=True)
