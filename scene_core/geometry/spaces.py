"""Position states in one, two and three dimensions, and how they move homogeneous points.

1-D (z), 2-D (z, x, phi) with phi from z towards x, 3-D (x, y, z, qw, qx, qy, qz); see `space`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.geometry.space import Composed, Inverted, Moved, Space, relative, wrap

__all__ = [
    "ONE_D",
    "SPACES",
    "THREE_D",
    "TWO_D",
    "Composed",
    "Inverted",
    "Moved",
    "Space",
    "relative",
    "wrap",
]


class OneD(Space):
    """A line: xp = (z) [m], points (z, w)."""

    name = "1-D"
    d = 1
    n = 1
    tangent = 1
    labels = ("z",)
    units = ("m",)

    def identity(self) -> Vec:
        return np.zeros(1)

    def compose(self, a: Vec, b: Vec) -> Composed:
        eye = np.ones((1, 1))
        return Composed(a + b, eye, eye)

    def inverse(self, a: Vec) -> Inverted:
        return Inverted(-a, -np.ones((1, 1)))

    def to_local(self, xp: Vec, X: Vec) -> Moved:
        return self._shifted(-xp, X, -1.0)

    def to_world(self, xp: Vec, X: Vec) -> Moved:
        return self._shifted(xp, X, 1.0)

    def _shifted(self, t: Vec, X: Vec, sign: float) -> Moved:
        by_X = np.zeros((*t.shape[:-1], 2, 2))
        by_X[..., 0, 0] = by_X[..., 1, 1] = 1.0
        by_X[..., 0, 1] = t[..., 0]
        moved = np.array(np.broadcast_to(X, np.broadcast_shapes(X.shape, (*t.shape[:-1], 2))))
        moved[..., 0] += X[..., 1] * t[..., 0]
        by_xp = np.zeros((*moved.shape, 1))
        by_xp[..., 0, 0] = sign * X[..., 1]
        return Moved(moved, by_xp, by_X)

    def position(self, xp: Vec) -> Vec:
        return xp

    def difference(self, a: Vec, b: Vec) -> Vec:
        return a - b

    def tangent_map(self, xp: Vec) -> Mat:
        return np.ones((1, 1))

    def from_tangent(self, xp: Vec) -> Mat:
        return np.ones((1, 1))

    def normalise(self, xp: Vec) -> tuple[Vec, Mat]:
        return xp, np.ones((1, 1))


class TwoD(Space):
    """A plane: xp = (z, x, phi) [m, m, rad], phi from z towards x; points (z, x, w).

    Source: Davison, *Models and State Representation in Scene*, section 4.2.
    """

    name = "2-D"
    d = 2
    n = 3
    tangent = 3
    labels = ("z", "x", "phi")
    units = ("m", "m", "rad")

    def identity(self) -> Vec:
        return np.zeros(3)

    def compose(self, a: Vec, b: Vec) -> Composed:
        c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
        dz, dx = c * b[..., 0] - s * b[..., 1], s * b[..., 0] + c * b[..., 1]
        x = np.stack([a[..., 0] + dz, a[..., 1] + dx, wrap(a[..., 2] + b[..., 2])], axis=-1)
        by_a = np.zeros((*x.shape, 3))
        by_a[..., (0, 1, 2), (0, 1, 2)] = 1.0
        by_a[..., 0, 2], by_a[..., 1, 2] = -dx, dz
        by_b = np.zeros((*x.shape, 3))
        by_b[..., 0, 0] = by_b[..., 1, 1] = c
        by_b[..., 0, 1], by_b[..., 1, 0] = -s, s
        by_b[..., 2, 2] = 1.0
        return Composed(x, by_a, by_b)

    def inverse(self, a: Vec) -> Inverted:
        c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
        z, x = -c * a[..., 0] - s * a[..., 1], s * a[..., 0] - c * a[..., 1]
        J = np.zeros((*a.shape, 3))
        J[..., 0, 0] = J[..., 1, 1] = -c
        J[..., 0, 1], J[..., 1, 0] = -s, s
        J[..., 0, 2], J[..., 1, 2], J[..., 2, 2] = x, -z, -1.0
        return Inverted(np.stack([z, x, wrap(-a[..., 2])], axis=-1), J)

    def to_local(self, xp: Vec, X: Vec) -> Moved:
        c, s = np.cos(xp[..., 2]), np.sin(xp[..., 2])
        w = X[..., 2]
        dz, dx = X[..., 0] - w * xp[..., 0], X[..., 1] - w * xp[..., 1]
        moved = _stacked(c * dz + s * dx, c * dx - s * dz, w)
        by_xp = np.zeros((*moved.shape, 3))
        by_xp[..., 0, 0] = by_xp[..., 1, 1] = -c * w
        by_xp[..., 0, 1], by_xp[..., 1, 0] = -s * w, s * w
        by_xp[..., 0, 2], by_xp[..., 1, 2] = moved[..., 1], -moved[..., 0]
        by_X = np.zeros((*xp.shape[:-1], 3, 3))
        by_X[..., 0, 0] = by_X[..., 1, 1] = c
        by_X[..., 0, 1], by_X[..., 1, 0] = s, -s
        by_X[..., 0, 2] = -c * xp[..., 0] - s * xp[..., 1]
        by_X[..., 1, 2] = s * xp[..., 0] - c * xp[..., 1]
        by_X[..., 2, 2] = 1.0
        return Moved(moved, by_xp, by_X)

    def to_world(self, xp: Vec, X: Vec) -> Moved:
        c, s = np.cos(xp[..., 2]), np.sin(xp[..., 2])
        w = X[..., 2]
        dz, dx = c * X[..., 0] - s * X[..., 1], s * X[..., 0] + c * X[..., 1]
        moved = _stacked(dz + w * xp[..., 0], dx + w * xp[..., 1], w)
        by_xp = np.zeros((*moved.shape, 3))
        by_xp[..., 0, 0] = by_xp[..., 1, 1] = w
        by_xp[..., 0, 2], by_xp[..., 1, 2] = -dx, dz
        by_X = np.zeros((*xp.shape[:-1], 3, 3))
        by_X[..., 0, 0] = by_X[..., 1, 1] = c
        by_X[..., 0, 1], by_X[..., 1, 0] = -s, s
        by_X[..., :2, 2] = xp[..., :2]
        by_X[..., 2, 2] = 1.0
        return Moved(moved, by_xp, by_X)

    def position(self, xp: Vec) -> Vec:
        return xp[..., :2]

    def difference(self, a: Vec, b: Vec) -> Vec:
        out = np.asarray(a - b, dtype=np.float64)
        out[..., 2] = wrap(out[..., 2])
        return out

    def tangent_map(self, xp: Vec) -> Mat:
        return np.eye(3)

    def from_tangent(self, xp: Vec) -> Mat:
        return np.eye(3)

    def normalise(self, xp: Vec) -> tuple[Vec, Mat]:
        out = np.array(xp, dtype=np.float64)
        out[..., 2] = wrap(out[..., 2])
        return out, np.eye(3)


class ThreeD(Space):
    """Space: xp = (x, y, z, qw, qx, qy, qz) [m, 1], points (x, y, z, w).

    R(q) is the homogeneous quadratic form, so a pose moves points rigidly when |q| = 1.
    Source: Davison, *Models and State Representation in Scene*, section 4.3.
    """

    name = "3-D"
    d = 3
    n = 7
    tangent = 6
    labels = ("x", "y", "z", "qw", "qx", "qy", "qz")
    units = ("m", "m", "m", "", "", "", "")

    def identity(self) -> Vec:
        return np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])

    def compose(self, a: Vec, b: Vec) -> Composed:
        r = quaternion.rotate(a[..., 3:], b[..., :3])
        left = quaternion.left_matrix(a[..., 3:])
        q = (left @ b[..., 3:, None])[..., 0]
        x = np.concatenate([a[..., :3] + r.v, q], axis=-1)
        by_a = np.zeros((*x.shape, 7))
        by_a[..., (0, 1, 2), (0, 1, 2)] = 1.0
        by_a[..., :3, 3:] = r.by_q
        by_a[..., 3:, 3:] = quaternion.right_matrix(b[..., 3:])
        by_b = np.zeros((*x.shape, 7))
        by_b[..., :3, :3] = r.by_v
        by_b[..., 3:, 3:] = left
        return Composed(x, by_a, by_b)

    def inverse(self, a: Vec) -> Inverted:
        r = quaternion.rotate_back(a[..., 3:], a[..., :3])
        x = np.concatenate([-r.v, quaternion.conjugate(a[..., 3:])], axis=-1)
        J = np.zeros((*x.shape, 7))
        J[..., :3, :3] = -r.by_v
        J[..., :3, 3:] = -r.by_q
        J[..., 3:, 3:] = quaternion.CONJUGATE
        return Inverted(x, J)

    def to_local(self, xp: Vec, X: Vec) -> Moved:
        w = X[..., 3:]
        r = quaternion.rotate_back(xp[..., 3:], X[..., :3] - w * xp[..., :3])
        moved = np.empty((*r.v.shape[:-1], 4))
        moved[..., :3] = r.v
        moved[..., 3] = X[..., 3]
        by_xp = np.zeros((*moved.shape, 7))
        by_xp[..., :3, :3] = -w[..., None] * r.by_v
        by_xp[..., :3, 3:] = r.by_q
        return Moved(moved, by_xp, _rigid(r.by_v, -(r.by_v @ xp[..., :3, None])[..., 0]))

    def to_world(self, xp: Vec, X: Vec) -> Moved:
        w = X[..., 3:]
        r = quaternion.rotate(xp[..., 3:], X[..., :3])
        moved = np.empty((*r.v.shape[:-1], 4))
        moved[..., :3] = r.v + w * xp[..., :3]
        moved[..., 3] = X[..., 3]
        by_xp = np.zeros((*moved.shape, 7))
        by_xp[..., (0, 1, 2), (0, 1, 2)] = w
        by_xp[..., :3, 3:] = r.by_q
        return Moved(moved, by_xp, _rigid(r.by_v, xp[..., :3]))

    def position(self, xp: Vec) -> Vec:
        return xp[..., :3]

    def difference(self, a: Vec, b: Vec) -> Vec:
        turn = quaternion.product(quaternion.conjugate(b[..., 3:]), a[..., 3:])
        theta, _ = quaternion.to_rotation_vector(turn)
        return np.concatenate([a[..., :3] - b[..., :3], theta], axis=-1)

    def tangent_map(self, xp: Vec) -> Mat:
        J = np.zeros((*xp.shape[:-1], 6, 7))
        J[..., (0, 1, 2), (0, 1, 2)] = 1.0
        J[..., 3:, 3:] = 2.0 * np.swapaxes(quaternion.left_matrix(xp[..., 3:])[..., 1:], -1, -2)
        return J

    def from_tangent(self, xp: Vec) -> Mat:
        G = np.zeros((*xp.shape[:-1], 7, 6))
        G[..., (0, 1, 2), (0, 1, 2)] = 1.0
        G[..., 3:, 3:] = 0.5 * quaternion.left_matrix(xp[..., 3:])[..., 1:]
        return G

    def normalise(self, xp: Vec) -> tuple[Vec, Mat]:
        q, J_q = quaternion.normalise(xp[..., 3:])
        J = np.zeros((*xp.shape, 7))
        J[..., (0, 1, 2), (0, 1, 2)] = 1.0
        J[..., 3:, 3:] = J_q
        return np.concatenate([xp[..., :3], q], axis=-1), J


def _stacked(*columns: Vec) -> Vec:
    out = np.empty((*np.broadcast_shapes(*(np.shape(c) for c in columns)), len(columns)))
    for i, column in enumerate(columns):
        out[..., i] = column
    return out


def _rigid(R: Mat, t: Vec) -> Mat:
    """[[R, t], [0, 1]] (..., 4, 4)."""
    out = np.zeros((*R.shape[:-2], 4, 4))
    out[..., :3, :3] = R
    out[..., :3, 3] = t
    out[..., 3, 3] = 1.0
    return out


ONE_D = OneD()
TWO_D = TwoD()
THREE_D = ThreeD()
SPACES: Mapping[int, Space] = MappingProxyType({s.d: s for s in (ONE_D, TWO_D, THREE_D)})
"""By how many coordinates a point has."""
