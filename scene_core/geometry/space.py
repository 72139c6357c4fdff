"""What poses and points of any dimension can do: the contract of the spaces.

A position state xp is Scene's minimal description of where something is (section 4). A point is
homogeneous, X = (m, w): the place m / w, at infinity for w = 0.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec


class Composed(NamedTuple):
    """x_AC = x_AB * x_BC with Jacobians by both."""

    x: Vec
    by_a: Mat
    by_b: Mat


class Inverted(NamedTuple):
    x: Vec
    jacobian: Mat


class Moved(NamedTuple):
    """Points X (..., d+1) seen from another frame, with Jacobians by the frame's pose xp
    (..., d+1, n) and by X (..., d+1, d+1), the latter possibly without batch axes."""

    X: Vec
    by_xp: Mat
    by_X: Mat


class Space(ABC):
    """Poses and homogeneous points of one dimension. `d` spatial dimensions, poses of size n."""

    name: str
    d: int
    n: int
    """Size of a position state: 1, 3, 7."""
    tangent: int
    """Degrees of freedom of a position state: 1, 3, 6."""
    labels: tuple[str, ...]
    units: tuple[str, ...]

    @abstractmethod
    def identity(self) -> Vec: ...

    @abstractmethod
    def compose(self, a: Vec, b: Vec) -> Composed:
        """x_AC from x_AB and x_BC."""

    @abstractmethod
    def inverse(self, a: Vec) -> Inverted:
        """x_BA from x_AB."""

    @abstractmethod
    def to_local(self, xp: Vec, X: Vec) -> Moved:
        """Points of the frame in which xp is given, seen from xp. Batched over X, one xp or a
        batch of them: m_L = R' (m - w t)."""

    @abstractmethod
    def to_world(self, xp: Vec, X: Vec) -> Moved:
        """Points seen from xp, in the frame in which xp is given: m = R m_L + w t."""

    @abstractmethod
    def position(self, xp: Vec) -> Vec:
        """Spatial part (..., d) of poses (..., n)."""

    @abstractmethod
    def difference(self, a: Vec, b: Vec) -> Vec:
        """Tangent vector (position, rotation vector; angles wrapped) from b to a: positions in the
        outer frame, rotation in the frame of b."""

    @abstractmethod
    def tangent_map(self, xp: Vec) -> Mat:
        """J (tangent, n): a small change of xp as a tangent vector, so P_tangent = J P J'."""

    @abstractmethod
    def from_tangent(self, xp: Vec) -> Mat:
        """(n, tangent): the change of xp for a small tangent vector (right inverse of
        `tangent_map`), so P = G P_tangent G'."""

    @abstractmethod
    def normalise(self, xp: Vec) -> tuple[Vec, Mat]:
        """xp on its constraint (unit quaternion, phi in (-pi, pi]) and the exact Jacobian."""


def wrap(angle: Vec) -> Vec:
    """Angles in (-pi, pi]."""
    return np.pi - np.mod(np.pi - np.asarray(angle), 2.0 * np.pi)


def relative(space: Space, origin: Vec, xp: Vec) -> Composed:
    """The pose xp seen from `origin`, inverse(origin) * xp, with Jacobians by origin and by xp."""
    back = space.inverse(origin)
    seen = space.compose(back.x, xp)
    return Composed(seen.x, seen.by_a @ back.jacobian, seen.by_b)
