"""Plücker coordinates (n, v) of straight lines, linear in the homogeneous points they come from.

The line through X1 = (m1, w1) and X2 = (m2, w2) is

    n = m1 x m2,   v = w1 m2 - w2 m1,

the normal of the plane through the line and the origin, and the direction of the line; n . v = 0,
and |n| / |v| is the distance from the origin. v = 0 is a line at infinity. For measured rays
m1, m2 both are *linear* in the unknown inverse distances w1, w2.

Source: Solà, Vidal-Calleja, Civera, Montiel, *Impact of landmark parametrization on monocular
EKF-SLAM with points and lines*, IJCV 2012, section 4; Hartley, Zisserman, *Multiple View Geometry*,
section 3.2.2.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion


class Join(NamedTuple):
    """L = (n, v) (..., 6) of two points X (..., 8), and dL/dX (..., 6, 8)."""

    L: Vec
    by_X: Mat


class Pair(NamedTuple):
    """Two points X (..., 8) that span a line L (..., 6), and dX/dL (..., 8, 6)."""

    X: Vec
    by_L: Mat


class Moved(NamedTuple):
    """Lines L (..., 6) in another frame, with Jacobians by its pose (..., 6, 7) and by L."""

    L: Vec
    by_xp: Mat
    by_L: Mat


class Scaled(NamedTuple):
    """A line in other numbers, and their Jacobian (..., 6, 6) by the old ones."""

    L: Vec
    jacobian: Mat


def join(X: Vec) -> Join:
    """The line through both points of X."""
    m1, w1, m2, w2 = X[..., :3], X[..., 3:4], X[..., 4:7], X[..., 7:8]
    L = np.concatenate([np.cross(m1, m2), w1 * m2 - w2 * m1], axis=-1)
    by_X, eye = np.zeros((*L.shape, 8)), np.eye(3)
    by_X[..., :3, :3], by_X[..., :3, 4:7] = -cross_matrix(m2), cross_matrix(m1)
    by_X[..., 3:, :3], by_X[..., 3:, 4:7] = -w2[..., None] * eye, w1[..., None] * eye
    by_X[..., 3:, 3], by_X[..., 3:, 7] = m2, -m1
    return Join(L, by_X)


def pair(L: Vec) -> Pair:
    """Two points of the line: where it meets two of the planes x = 0, y = 0, z = 0 and infinity.

    It meets the plane (c, w) in (c x n - w v, c . v), linear in L. Of the six pairs of planes the
    one is taken whose points are farthest from being the same, so no line is singular: not one at
    infinity (v = 0), nor one through the origin (n = 0).
    """
    # X1 ^ X2 = (L's component named by both planes) L.
    chosen = np.abs(L @ _COMPONENTS.T).argmax(axis=-1)
    by_L = _PAIRS[chosen]
    return Pair((by_L @ L[..., None])[..., 0], by_L)


def to_world(xp: Vec, L: Vec) -> Moved:
    """(R n + t x R v, R v): lines seen from the pose xp = (t, q), in the frame it is given in."""
    t, n, v = xp[:3], quaternion.rotate(xp[3:], L[..., :3]), quaternion.rotate(xp[3:], L[..., 3:])
    out = np.concatenate([n.v + np.cross(t, v.v), v.v], axis=-1)
    by_xp, by_L = np.zeros((*L.shape, 7)), np.zeros((*L.shape, 6))
    by_xp[..., :3, :3] = -cross_matrix(v.v)
    by_xp[..., :3, 3:] = n.by_q + cross_matrix(t) @ v.by_q
    by_xp[..., 3:, 3:] = v.by_q
    by_L[..., :3, :3], by_L[..., 3:, 3:] = n.by_v, v.by_v
    by_L[..., :3, 3:] = cross_matrix(t) @ v.by_v
    return Moved(out, by_xp, by_L)


def to_local(xp: Vec, L: Vec) -> Moved:
    """(R' (n - t x v), R' v): lines of the frame in which xp = (t, q) is given, seen from xp."""
    t, v = xp[:3], L[..., 3:]
    n_local = quaternion.rotate_back(xp[3:], L[..., :3] - np.cross(t, v))
    v_local = quaternion.rotate_back(xp[3:], v)
    by_xp, by_L = np.zeros((*L.shape, 7)), np.zeros((*L.shape, 6))
    by_xp[..., :3, :3] = n_local.by_v @ cross_matrix(v)
    by_xp[..., :3, 3:], by_xp[..., 3:, 3:] = n_local.by_q, v_local.by_q
    by_L[..., :3, :3], by_L[..., 3:, 3:] = n_local.by_v, v_local.by_v
    by_L[..., :3, 3:] = -n_local.by_v @ cross_matrix(t)
    return Moved(np.concatenate([n_local.v, v_local.v], axis=-1), by_xp, by_L)


def unit_normal(L: Vec) -> Scaled:
    """(n, v - (u . v) u) / |n| with u = n / |n|: a unit normal, at right angles to the direction.

    |v| becomes the inverse distance from the origin, which the line must not go through.
    """
    n, v = L[..., :3], L[..., 3:]
    length = np.linalg.norm(n, axis=-1)[..., None]
    u, scaled = n / length, v / length
    off = np.vecdot(u, scaled)[..., None]
    across = np.eye(3) - u[..., :, None] * u[..., None, :]
    J = np.zeros((*L.shape, 6))
    each = length[..., None]
    J[..., :3, :3] = across / each
    # d(v - (u.v) u) = across dv - (u.v) du - (v.du) u, all over |n|; then |n| itself.
    flat = scaled - off * u
    turn = (
        -off[..., None] * across - u[..., :, None] * (across @ scaled[..., None])[..., None, :, 0]
    )
    J[..., 3:, :3] = (turn - flat[..., :, None] * u[..., None, :]) / each
    J[..., 3:, 3:] = across / each
    return Scaled(np.concatenate([u, flat], axis=-1), J)


def orthogonal(L: Vec) -> Scaled:
    """The nearest (n, v) with n . v = 0.

    n . v = (|s|^2 - |d|^2) / 4 for s = n + v, d = n - v: both get the length (|s| + |d|) / 2.
    """
    s, d = L[..., :3] + L[..., 3:], L[..., :3] - L[..., 3:]
    a = np.linalg.norm(s, axis=-1)[..., None]
    b = np.linalg.norm(d, axis=-1)[..., None]
    us, ud, length = s / a, d / b, 0.5 * (a + b)
    eye = np.eye(3)

    def outer(p: Vec, q: Vec) -> Mat:
        return p[..., :, None] * q[..., None, :]

    s_by_s = (length / a)[..., None] * (eye - outer(us, us)) + 0.5 * outer(us, us)
    d_by_d = (length / b)[..., None] * (eye - outer(ud, ud)) + 0.5 * outer(ud, ud)
    s_by_d, d_by_s = 0.5 * outer(us, ud), 0.5 * outer(ud, us)
    n_by_s, n_by_d = 0.5 * (s_by_s + d_by_s), 0.5 * (s_by_d + d_by_d)
    v_by_s, v_by_d = 0.5 * (s_by_s - d_by_s), 0.5 * (s_by_d - d_by_d)
    J = np.empty((*L.shape, 6))
    J[..., :3, :3], J[..., :3, 3:] = n_by_s + n_by_d, n_by_s - n_by_d
    J[..., 3:, :3], J[..., 3:, 3:] = v_by_s + v_by_d, v_by_s - v_by_d
    value = 0.5 * length * np.concatenate([us + ud, us - ud], axis=-1)
    return Scaled(value, J)


def ends(L: Vec, t: Vec) -> Vec:
    """The points (..., 8) in the directions t (..., 2) [rad] from the origin:

    X(t) = (cos t u x n + sin t |n| u, cos t |v|),  u = v / |v|,

    t = 0 the one nearest to the origin, t = +-pi/2 at infinity. A line at infinity has no nearest
    one.
    """
    nearest, aside = _directions(L)
    out = np.empty((*L.shape[:-1], 8))
    for i in range(2):
        c, s = np.cos(t[..., i, None]), np.sin(t[..., i, None])
        out[..., 4 * i : 4 * i + 3] = c * nearest + s * aside
        out[..., 4 * i + 3] = c[..., 0] * np.linalg.norm(L[..., 3:], axis=-1)
    return out


def metres(L: Vec) -> Vec:
    """The points (..., 8) 0 m and 1 m from the one nearest to the origin, (u x n, |v|) and
    (u x n + v, |v|) with u = v / |v|; a line at infinity has neither."""
    nearest, _ = _directions(L)
    w = np.linalg.norm(L[..., 3:], axis=-1, keepdims=True)
    return np.concatenate([nearest, w, nearest + L[..., 3:], w], axis=-1)


def angles(L: Vec, origin: Vec, rays: Vec) -> Vec:
    """The directions t (...,) of `ends` in which the line is nearest in direction to rays
    (..., 3) from `origin` (3,)."""
    nearest, aside = _directions(L)
    near = nearest - np.linalg.norm(L[..., 3:], axis=-1)[..., None] * origin
    normal = L[..., :3] - np.cross(origin, L[..., 3:])
    across = np.cross(rays, normal)
    c, s = np.vecdot(across, aside), -np.vecdot(across, near)
    ahead = np.vecdot(c[..., None] * near + s[..., None] * aside, rays)
    sign = np.where(ahead < 0.0, -1.0, 1.0)
    return np.arctan2(sign * s, sign * c)


def _directions(L: Vec) -> tuple[Vec, Vec]:
    """u x n and |n| u (..., 3)."""
    n, v = L[..., :3], L[..., 3:]
    u = v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300)
    nearest = np.asarray(np.cross(u, n), dtype=np.float64)
    return nearest, np.linalg.norm(n, axis=-1, keepdims=True) * u


def cross_matrix(v: Vec) -> Mat:
    """[v]x (..., 3, 3), so that [v]x a = v x a."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def _meets(plane: int) -> Mat:
    """(4, 6): where a line meets the plane (c, w), the `plane`-th unit vector."""
    c, w = np.eye(4)[plane, :3], float(plane == 3)
    out = np.zeros((4, 6))
    out[:3, :3], out[:3, 3:], out[3, 3:] = cross_matrix(c), -w * np.eye(3), c
    return out


_PLANES = tuple(combinations(range(4), 2))
_PAIRS = np.array([np.concatenate([_meets(i), _meets(j)]) for i, j in _PLANES])
"""(6, 8, 6)"""
_COMPONENTS = np.array([_meets(j)[i] for i, j in _PLANES])
"""(6, 6): e_i' (L e_j) for every pair of planes."""
