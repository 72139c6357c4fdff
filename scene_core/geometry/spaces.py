"""Position states in one, two and three dimensions, and how they move homogeneous points.

A position state xp is Scene's minimal description of where something is (section 4):
1-D (z), 2-D (z, x, phi) with phi from z towards x, 3-D (x, y, z, qw, qx, qy, qz).
A point is homogeneous, X = (m, w): the place m / w, at infinity for w = 0.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion


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

# fmt: off
_AXES: dict[tuple[str, str], Mat] = {
    ("1-D", "y"): np.array([[0.0], [0.0], [1.0]]),
    ("1-D", "z"): np.array([[1.0], [0.0], [0.0]]),
    ("2-D", "y"): np.array([[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]),
    ("2-D", "z"): np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]),
    ("3-D", "y"): np.eye(3),
    ("3-D", "z"): np.eye(3),
}
# fmt: on


def embed(xp: Vec, space: Space, up: str, into: Space = THREE_D) -> tuple[Vec, Mat]:
    """The position state (..., m) in `into`, which has more dimensions, of a pose in `space`, and
    its Jacobian (..., m, n). A pose on a line lies in the plane with x = phi = 0. In 3-D:

    up = "y" (Scene): the plane's z and x are the world's z and x, phi turns about y. up = "z" (the
    toolbox): the plane's z is the world's x, its x the world's y, phi turns about z. A line's z
    runs along the world's z, resp. x.
    """
    if space is into:
        return xp, np.eye(space.n)
    if into.d == 2:
        J = np.eye(into.n, space.n)
        return xp @ J.T, np.broadcast_to(J, (*xp.shape[:-1], *J.shape))
    axes = _AXES[space.name, up]
    out = np.zeros((*xp.shape[:-1], 7))
    J = np.zeros((*xp.shape[:-1], 7, space.n))
    out[..., :3] = xp[..., : space.d] @ axes.T
    out[..., 3] = 1.0
    J[..., :3, : space.d] = axes
    if space.d == 2:
        half = 0.5 * xp[..., 2]
        up_axis = 4 + "xyz".index(up)
        out[..., 3], out[..., up_axis] = np.cos(half), np.sin(half)
        J[..., 3, 2], J[..., up_axis, 2] = -0.5 * np.sin(half), 0.5 * np.cos(half)
    return out, J


def flatten(xp: Vec, space: Space, up: str) -> tuple[Vec, Mat]:
    """The position state (..., n) in `space` of a 3-D pose (..., 7) that lies in it, and its
    Jacobian (..., n, 7): the left inverse of `embed`."""
    if space.d == 3:
        return xp, np.eye(7)
    axes = _AXES[space.name, up]
    out, J = np.zeros((*xp.shape[:-1], space.n)), np.zeros((*xp.shape[:-1], space.n, 7))
    out[..., : space.d] = xp[..., :3] @ axes
    J[..., : space.d, :3] = axes.T
    if space.d == 2:
        up_axis = 4 + "xyz".index(up)
        c, s = xp[..., 3], xp[..., up_axis]
        out[..., 2] = wrap(2.0 * np.arctan2(s, c))
        length2 = c * c + s * s
        J[..., 2, 3], J[..., 2, up_axis] = -2.0 * s / length2, 2.0 * c / length2
    return out, J


def embed_points(points: Vec, space: Space, up: str) -> Vec:
    """Points (..., d) of `space` in 3-D world axes (..., 3), see `embed`."""
    return points @ _AXES[space.name, up].T


def embed_covariances(P: Mat, space: Space, up: str) -> Mat:
    """Covariances (..., d, d) of points of `space` in 3-D world axes (..., 3, 3)."""
    axes = _AXES[space.name, up]
    return axes @ P @ axes.T


def relative(space: Space, origin: Vec, xp: Vec) -> Composed:
    """The pose xp seen from `origin`, inverse(origin) * xp, with Jacobians by origin and by xp."""
    back = space.inverse(origin)
    seen = space.compose(back.x, xp)
    return Composed(seen.x, seen.by_a @ back.jacobian, seen.by_b)
