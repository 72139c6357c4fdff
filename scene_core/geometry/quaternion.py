"""Quaternions q = (w, x, y, z), Hamilton, q^WR: v_W = R(q) v_R. Batched over leading axes.

R(q) is the homogeneous quadratic form (degree two in q, no division by |q|^2), so Jacobians by q
are those of a polynomial; q is put back on the unit sphere by `normalise`, with its projector.

Source: Davison, *Models and State Representation in Scene*, section 4.3, eq. 12; Solà, *Quaternion
kinematics for the error-state Kalman filter*, sections 1-4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec

# fmt: off
# Position (row, column) of the component of p in left(p), and its sign.
_LEFT_INDEX = np.array([[0, 1, 2, 3],
                        [1, 0, 3, 2],
                        [2, 3, 0, 1],
                        [3, 2, 1, 0]])
_LEFT_SIGN = np.array([[1.0, -1.0, -1.0, -1.0],
                       [1.0,  1.0, -1.0,  1.0],
                       [1.0,  1.0,  1.0, -1.0],
                       [1.0, -1.0,  1.0,  1.0]])
_RIGHT_SIGN = np.array([[1.0, -1.0, -1.0, -1.0],
                        [1.0,  1.0,  1.0, -1.0],
                        [1.0, -1.0,  1.0,  1.0],
                        [1.0,  1.0, -1.0,  1.0]])
# fmt: on

CONJUGATE = np.diag([1.0, -1.0, -1.0, -1.0])
"""d conjugate(q) / dq (4, 4)."""
CONJUGATE.flags.writeable = False


def _by_q_forms() -> tuple[Mat, Mat]:
    """B with q B = dR/dq laid out (j, i, k), so that v_j B sums to d(R v)_i/dq_k; same for R'."""
    basis = np.eye(4)
    left = np.stack([left_matrix(e) for e in basis])
    right = np.stack([right_matrix(e) for e in basis])
    # [0; R v] = left(q) right(q)' [0; v], bilinear in q: symmetrised it is dR/dq.
    m = np.einsum("kab,lcb->klac", left, right)[:, :, 1:, 1:]
    form = m + m.transpose(1, 0, 2, 3)  # (k, l, i, j), symmetric in k and l
    rotate = form.transpose(1, 3, 2, 0).reshape(4, 36)
    back = form.transpose(1, 2, 3, 0).reshape(4, 36)
    return np.ascontiguousarray(rotate), np.ascontiguousarray(back)


class Rotated(NamedTuple):
    """A rotated vector (..., 3), its Jacobian by q (..., 3, 4), and that by v: the matrix itself,
    (3, 3) without batch axes when q has none."""

    v: Vec
    by_q: Mat
    by_v: Mat


def left_matrix(p: Vec) -> Mat:
    """left(p) (..., 4, 4) with product(p, q) = left(p) q."""
    return np.asarray(p)[..., _LEFT_INDEX] * _LEFT_SIGN


def right_matrix(q: Vec) -> Mat:
    """right(q) (..., 4, 4) with product(p, q) = right(q) p."""
    return np.asarray(q)[..., _LEFT_INDEX] * _RIGHT_SIGN


def product(p: Vec, q: Vec) -> Vec:
    """p * q (..., 4): the rotation q followed, in the outer frame, by p; q^WC = q^WR * q^RC."""
    return (left_matrix(p) @ np.asarray(q)[..., None])[..., 0]


def conjugate(q: Vec) -> Vec:
    """(w, -x, -y, -z): the inverse of a unit quaternion."""
    return np.asarray(q) * CONJUGATE.diagonal()


_BY_Q, _BACK_BY_Q = _by_q_forms()


def matrix(q: Vec) -> Mat:
    """R(q) (..., 3, 3), the homogeneous quadratic form of Scene eq. 12; a rotation for |q| = 1."""
    q = np.asarray(q)
    # Euler's theorem for degree two: R = (dR/dq) q / 2; the (j, i) layout of R' is R's (i, j).
    by_q = (q @ _BACK_BY_Q).reshape(*q.shape[:-1], 3, 3, 4)
    return 0.5 * (by_q @ q[..., None, :, None])[..., 0]


def _turn(q: Vec, v: Vec, form: Mat) -> Rotated:
    if q.ndim == 1:
        by_q = (q @ form).reshape(3, 12)
        M = 0.5 * (by_q.reshape(3, 3, 4) @ q).T
        return Rotated(v @ M.T, (v @ by_q).reshape(*v.shape, 4), M)
    by_q = (q @ form).reshape(*q.shape[:-1], 3, 12)
    M = 0.5 * np.swapaxes(
        (by_q.reshape(*q.shape[:-1], 3, 3, 4) @ q[..., None, :, None])[..., 0], -1, -2
    )
    moved = (M @ v[..., None])[..., 0]
    return Rotated(moved, (v[..., None, :] @ by_q)[..., 0, :].reshape(*moved.shape, 4), M)


def rotate(q: Vec, v: Vec) -> Rotated:
    """R(q) v for vectors v (..., 3), with one q (4,) or a batch of them (..., 4)."""
    return _turn(np.asarray(q), np.asarray(v), _BY_Q)


def rotate_back(q: Vec, v: Vec) -> Rotated:
    """R(q)' v for vectors v (..., 3), with one q (4,) or a batch of them (..., 4)."""
    return _turn(np.asarray(q), np.asarray(v), _BACK_BY_Q)


def normalise(q: Vec) -> tuple[Vec, Mat]:
    """q / |q| and its exact Jacobian, the projector (I - q q' / |q|^2) / |q|."""
    q = np.asarray(q, dtype=np.float64)
    length = np.sqrt((q * q).sum(-1))[..., None]
    unit = q / length
    return unit, (np.eye(4) - unit[..., :, None] * unit[..., None, :]) / length[..., None]


def _sine_terms(a2: float) -> tuple[float, float, float]:
    """cos(a/2), S = sin(a/2)/a and (dS/da)/a from a^2; near zero by their Taylor series."""
    if a2 < 1e-3:
        return (
            1.0 - a2 / 8 + a2**2 / 384 - a2**3 / 46080,
            0.5 - a2 / 48 + a2**2 / 3840 - a2**3 / 645120,
            -1 / 24 + a2 / 960 - a2**2 / 107520 + a2**3 / 23224320,
        )
    a = math.sqrt(a2)
    cos, S = math.cos(a / 2), math.sin(a / 2) / a
    return cos, S, (0.5 * cos - S) / a2


def from_rotation_vector(theta: Vec) -> tuple[Vec, Mat]:
    """q = (cos a/2, theta sin(a/2)/a), a = |theta| [rad], and dq/dtheta (..., 4, 3).

    Finite everywhere: near a = 0 the coefficients are their Taylor series.
    """
    theta = np.asarray(theta, dtype=np.float64)
    a2 = np.vecdot(theta, theta)
    if theta.ndim == 1:
        cos, S, dS = _sine_terms(float(a2))
    else:
        terms = np.array([_sine_terms(x) for x in a2.ravel().tolist()]).reshape(*a2.shape, 3)
        cos, S, dS = terms[..., 0], terms[..., 1, None], terms[..., 2, None, None]
    q = np.empty((*theta.shape[:-1], 4))
    q[..., 0] = cos
    q[..., 1:] = S * theta
    J = np.empty((*theta.shape[:-1], 4, 3))
    J[..., 0, :] = -0.5 * q[..., 1:]
    J[..., 1:, :] = dS * (theta[..., :, None] * theta[..., None, :])
    J[..., (1, 2, 3), (0, 1, 2)] += S
    return q, J


def to_rotation_vector(q: Vec) -> tuple[Vec, Mat]:
    """theta [rad], |theta| <= pi, the logarithm of q or -q (the same rotation), and dtheta/dq.

    theta = 2 atan2(n, w) / n * (x, y, z), n = |(x, y, z)|, w >= 0; degree zero in q, so q need not
    be normalised. Jacobian (..., 3, 4), finite at the identity; the value jumps at |theta| = pi.
    """
    q = np.asarray(q, dtype=np.float64)
    sign = np.where(q[..., 0] < 0.0, -1.0, 1.0)
    w = sign * q[..., 0]
    v = sign[..., None] * q[..., 1:]
    n2 = (v * v).sum(-1)
    length2 = n2 + w * w
    small = n2 < 1e-4 * length2
    n = np.sqrt(np.where(small, 1.0, n2))
    safe_w = np.where(small, w, 1.0)
    r = np.where(small, n2, 0.0) / safe_w**2
    g = np.where(
        small,
        2.0 / safe_w * (1 - r / 3 + r**2 / 5 - r**3 / 7 + r**4 / 9),
        2.0 * np.arctan2(n, w) / n,
    )
    dg = np.where(  # (dg/dn) / n
        small,
        2.0 / safe_w**3 * (-2 / 3 + 4 / 5 * r - 6 / 7 * r**2 + 8 / 9 * r**3 - 10 / 11 * r**4),
        (2.0 * w / length2 - g) / (n * n),
    )
    J = np.empty((*q.shape[:-1], 3, 4))
    J[..., :, 0] = (-2.0 / length2)[..., None] * v
    J[..., :, 1:] = dg[..., None, None] * (v[..., :, None] * v[..., None, :])
    J[..., (0, 1, 2), (1, 2, 3)] += g[..., None]
    return g[..., None] * v, sign[..., None, None] * J


def from_matrix(R: Mat) -> Vec:
    """Unit quaternion (..., 4) of rotation matrices (..., 3, 3), by the largest of its components.

    Source: Shepperd, *Quaternion from rotation matrix*, 1978.
    """
    R = np.asarray(R, dtype=np.float64)
    # K = 4 q q' - I |q|^2, from the sums and differences of R's entries.
    K = np.empty((*R.shape[:-2], 4, 4))
    d0, d1, d2 = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    K[..., 0, 0] = 1 + d0 + d1 + d2
    K[..., 1, 1] = 1 + d0 - d1 - d2
    K[..., 2, 2] = 1 - d0 + d1 - d2
    K[..., 3, 3] = 1 - d0 - d1 + d2
    for a, i, j in ((1, 2, 1), (2, 0, 2), (3, 1, 0)):
        K[..., 0, a] = K[..., a, 0] = R[..., i, j] - R[..., j, i]
        b, c = i + 1, j + 1
        K[..., b, c] = K[..., c, b] = R[..., i, j] + R[..., j, i]
    best = np.argmax(np.diagonal(K, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(K, best[..., None, None], axis=-2)[..., 0, :]
    return normalise(row)[0]


def from_euler(roll: float, pitch: float, yaw: float) -> Vec:
    """Unit quaternion of R = Rz(yaw) Ry(pitch) Rx(roll); angles in rad."""
    out = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in ((2, yaw), (1, pitch), (0, roll)):
        q = np.zeros(4)
        q[0], q[axis + 1] = np.cos(angle / 2), np.sin(angle / 2)
        out = product(out, q)
    return out
