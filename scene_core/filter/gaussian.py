"""Kalman filter algebra on named blocks.

Every operation touches only the rows and columns it must: prediction those of one robot, an update
the non-zero columns of H. The update subtracts V V' with V = P H' L^-T, S = L L', so P stays
symmetric by construction and needs no repair.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from scene_core.arrays import Mat, Vec
from scene_core.filter.world import Block, Gaussian, Layout

(gemm,) = get_blas_funcs(("gemm",), dtype=np.float64)
potrf, trtrs = get_lapack_funcs(("potrf", "trtrs"), dtype=np.float64)


class FilterError(ArithmeticError):
    """The filter can not go on with these numbers: the message says why and what to change."""


@dataclass(frozen=True)
class Rows:
    """Block-sparse Jacobian of k measurements of size m, M = k m rows in all.

    Every row has the same `shared` columns (robot, sensor pose, calibration) and, where `own` is
    not None, columns of its own (its feature).
    """

    shared: np.ndarray
    """State indices (ns,)."""
    H_shared: Mat
    """(k, m, ns)"""
    own: np.ndarray | None = None
    """State indices (k, s)."""
    H_own: Mat | None = None
    """(k, m, s)"""


def stack_size(parts: Sequence[Rows]) -> int:
    return sum(p.H_shared.shape[0] * p.H_shared.shape[1] for p in parts)


def times_P(parts: Sequence[Rows], P: Mat) -> Mat:
    """H P (M, n)."""
    out = np.empty((stack_size(parts), P.shape[1]))
    at = 0
    for p in parts:
        k, m, ns = p.H_shared.shape
        rows = out[at : at + k * m]
        np.matmul(p.H_shared.reshape(k * m, ns), P[p.shared], out=rows)
        if p.own is not None and p.H_own is not None:
            rows += (p.H_own @ P[p.own]).reshape(k * m, -1)
        at += k * m
    return out


def times_Ht(A: Mat, parts: Sequence[Rows]) -> Mat:
    """A H' (r, M) for A (r, n)."""
    out = np.empty((A.shape[0], stack_size(parts)))
    at = 0
    for p in parts:
        k, m, ns = p.H_shared.shape
        columns = out[:, at : at + k * m]
        np.matmul(A[:, p.shared], p.H_shared.reshape(k * m, ns).T, out=columns)
        if p.own is not None and p.H_own is not None:
            gathered = A[:, p.own].transpose(1, 0, 2)
            columns += (
                (gathered @ p.H_own.transpose(0, 2, 1)).transpose(1, 0, 2).reshape(len(A), k * m)
            )
        at += k * m
    return out


def dense(parts: Sequence[Rows], n: int) -> Mat:
    """H as an ordinary matrix (M, n)."""
    return times_Ht(np.eye(n), parts).T


class Workspace:
    """A state being worked on: private copies of x and P, sealed into a Gaussian at the end."""

    def __init__(self, gauss: Gaussian) -> None:
        self.layout = gauss.layout
        self.x = gauss.x.copy()
        self.P = gauss.P.copy()

    def seal(self) -> Gaussian:
        """The finished state; the workspace must not be used afterwards."""
        check_healthy(self.x, self.P)
        self.x.flags.writeable = False
        self.P.flags.writeable = False
        return Gaussian(self.x, self.P, self.layout)

    def transform(
        self, target: np.ndarray, source: np.ndarray, J: Mat, Q: Mat | None = None
    ) -> None:
        """x[target] becomes a function of x[source] with Jacobian J; covariances only.

        P_t* = J P_s*,  P_tt = J P_ss J' + Q. `source` contains `target`, or J says otherwise.
        """
        P = self.P
        A = J @ P[source]
        B = A[:, source] @ J.T
        if Q is not None:
            B = B + Q
        P[target] = A
        P[:, target] = A.T
        P[np.ix_(target, target)] = 0.5 * (B + B.T)

    def update(self, parts: Sequence[Rows], nu: Vec, R: Mat) -> tuple[Mat, float]:
        """x += K nu, P -= K S K'. Returns S (M, M) and d2 of the whole stack.

        nu (M,), R (M, M) or the blocks (k, m, m) along its diagonal.
        """
        HP = times_P(parts, self.P)
        S = times_Ht(HP, parts)
        add_noise(S, R)
        return S, self.gain(HP, S, nu)

    def gain(self, HP: Mat, S: Mat, nu: Vec) -> float:
        """The update from H P (M, n) and S (M, M) that are already known. Returns d2.

        With S = L L':  V = L^-1 H P,  x += V' L^-1 nu,  P -= V' V.
        """
        L, info = potrf(S, lower=1, clean=1)
        if info != 0:
            raise FilterError(
                "the innovation covariance is not positive definite: measurement or process noise "
                "is absurd; undo the last edit or raise the sensor's noise"
            )
        V, info = trtrs(L, HP, lower=1)
        w, info = trtrs(L, nu, lower=1)
        self.x += w @ V
        downdate(self.P, V)
        return float(w @ w)

    def set_block(self, block: Block, value: Vec, J: Mat | None) -> None:
        """The block becomes `value`, a function of itself with Jacobian J (None: identity)."""
        at, P = block.slice, self.P
        self.x[at] = value
        if J is None:
            return
        A = J @ P[at]
        B = A[:, at] @ J.T
        P[at] = A
        P[:, at] = A.T
        P[at, at] = 0.5 * (B + B.T)


def add_noise(S: Mat, R: Mat) -> None:
    """S += R for a full R or the blocks (k, m, m) of its diagonal."""
    if R.ndim == 2:
        S += R
        return
    m = R.shape[1]
    for i, block in enumerate(R):
        S[i * m : (i + 1) * m, i * m : (i + 1) * m] += block


def downdate(P: Mat, V: Mat) -> None:
    """P -= V' V in place for C-contiguous symmetric P (n, n) and V (M, n)."""
    W = np.asfortranarray(V.T)
    out = gemm(-1.0, W, W, beta=1.0, c=P.T, trans_b=True, overwrite_c=True)
    assert np.shares_memory(out, P), "BLAS copied P: it must be one contiguous array"


def check_healthy(x: Vec, P: Mat) -> None:
    """Raise FilterError unless the state is finite and no variance is negative."""
    variances = P.diagonal()
    # A sum is not finite as soon as one term is not; it costs a tenth of isfinite over P.
    if not (np.isfinite(x).all() and np.isfinite(P.sum())):
        raise FilterError(
            "the state is no longer finite: a parameter is absurd or a model returned NaN; "
            "undo the last edit and redo the frame"
        )
    if variances.size and variances.min() < -1e-9 * max(1.0, float(variances.max())):
        raise FilterError(
            f"the covariance is no longer positive (variance {variances.min():.2g}): a noise is "
            "too small or a model's Jacobian is wrong; undo the last edit and redo the frame"
        )


def augment(gauss: Gaussian, name: str, y: Vec, by: Mapping[str, Mat], noise: Mat) -> Gaussian:
    """A new block y = g(x, noise) at the end: P_yx = J P, P_yy = J P J' + noise.

    by: Jacobian of y by block name.
    """
    n, s = gauss.x.size, y.size
    columns = np.concatenate([gauss.layout[b].indices for b in by]) if by else np.zeros(0, int)
    J = np.concatenate(list(by.values()), axis=1) if by else np.zeros((s, 0))
    x, P = np.empty(n + s), np.empty((n + s, n + s))
    x[:n], x[n:] = gauss.x, y
    P[:n, :n] = gauss.P
    A = J @ gauss.P[columns]
    P[n:, :n], P[:n, n:] = A, A.T
    B = A[:, columns] @ J.T + noise
    P[n:, n:] = 0.5 * (B + B.T)
    sizes = {b.name: b.size for b in gauss.layout.blocks} | {name: s}
    return _sealed(x, P, Layout.of(sizes))


def drop(gauss: Gaussian, names: Sequence[str]) -> Gaussian:
    """Marginalise blocks out: their rows and columns are removed, nothing else changes."""
    gone = set(names)
    keep = [b for b in gauss.layout.blocks if b.name not in gone]
    index = np.concatenate([b.indices for b in keep]) if keep else np.zeros(0, int)
    layout = Layout.of({b.name: b.size for b in keep})
    return _sealed(gauss.x[index], gauss.P[np.ix_(index, index)], layout)


def convert(gauss: Gaussian, name: str, y: Vec, J: Mat, noise: Mat | None = None) -> Gaussian:
    """Replace a block by a function y of itself, possibly of another size, with Jacobian J; `noise`
    is what something outside the state adds to its covariance."""
    block = gauss.layout[name]
    a, b, n, s = block.start, block.start + block.size, gauss.x.size, y.size
    m = n - block.size + s
    x, P = np.empty(m), np.empty((m, m))
    x[:a], x[a : a + s], x[a + s :] = gauss.x[:a], y, gauss.x[b:]
    old, new = (slice(0, a), slice(b, n)), (slice(0, a), slice(a + s, m))
    A = J @ gauss.P[a:b]
    for i in (0, 1):
        for j in (0, 1):
            P[new[i], new[j]] = gauss.P[old[i], old[j]]
        P[a : a + s, new[i]] = A[:, old[i]]
        P[new[i], a : a + s] = A[:, old[i]].T
    B = A[:, a:b] @ J.T
    if noise is not None:
        B = B + noise
    P[a : a + s, a : a + s] = 0.5 * (B + B.T)
    sizes = {k.name: (s if k.name == name else k.size) for k in gauss.layout.blocks}
    return _sealed(x, P, Layout.of(sizes))


def _sealed(x: Vec, P: Mat, layout: Layout) -> Gaussian:
    x.flags.writeable = False
    P.flags.writeable = False
    return Gaussian(x, P, layout)
