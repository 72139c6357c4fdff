"""What blocks of a covariance know of each other: plain and canonical correlations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scene_core.arrays import Mat, Vec

RANK_TOLERANCE = 1e-9
"""Directions with less than this part of a block's largest (unit-free) variance do not count: a
normalised quaternion has four numbers and three degrees of freedom."""


def correlation(P: Mat) -> Mat:
    """Correlation matrix P_ij / (sd_i sd_j) (n, n); rows of known components (sd 0) are zero."""
    sd = np.sqrt(np.maximum(np.diag(P), 0.0))
    scale = np.divide(1.0, sd, out=np.zeros_like(sd), where=sd > 0.0)
    return np.clip(P * scale[:, None] * scale, -1.0, 1.0)


def whitening(P: Mat) -> Mat:
    """W (..., n, n) with W P W' = I on the range of P (..., n, n), zero elsewhere.

    Components are scaled to unit variance first, so that the rank is judged free of units.
    """
    sd = np.sqrt(np.maximum(np.diagonal(P, axis1=-2, axis2=-1), 0.0))
    scale = np.divide(1.0, sd, out=np.zeros_like(sd), where=sd > 0.0)
    values, vectors = np.linalg.eigh(P * scale[..., :, None] * scale[..., None, :])
    known = values > RANK_TOLERANCE * np.maximum(values[..., -1:], RANK_TOLERANCE)
    roots = np.sqrt(np.divide(1.0, values, out=np.zeros_like(values), where=known))
    return roots[..., :, None] * np.swapaxes(vectors, -1, -2) * scale[..., None, :]


def largest_canonical_correlations(P: Mat, a: slice, others: Sequence[slice]) -> Vec:
    """Largest canonical correlation (K,) of block `a` of P with each of the K blocks `others`.

    rho = max over p, q of corr(p' x_a, q' x_b) = largest singular value of W_a P_ab W_b', in
    [0, 1]; invariant under any invertible change of coordinates of either block. Hotelling,
    Relations between two sets of variates, 1936.
    """
    out = np.zeros(len(others))
    Wa = whitening(P[a, a])
    for size in {b.stop - b.start for b in others}:
        which = [i for i, b in enumerate(others) if b.stop - b.start == size]
        index = np.array([others[i].start for i in which])[:, None] + np.arange(size)
        Wb = whitening(P[index[:, :, None], index[:, None, :]])
        Pab = np.moveaxis(P[a][:, index], 1, 0)
        out[which] = _largest_singular_value(Wa @ Pab @ np.swapaxes(Wb, -1, -2))
    return out


def block_correlations(P: Mat, blocks: Sequence[slice]) -> Mat:
    """Largest canonical correlation (K, K) of every pair of K blocks; one on the diagonal."""
    out = np.eye(len(blocks))
    n = sum(b.stop - b.start for b in blocks)
    rows, starts, at = np.zeros((n, P.shape[0])), [], 0
    for b in blocks:
        size = b.stop - b.start
        rows[at : at + size, b] = whitening(P[b, b])
        starts.append(slice(at, at + size))
        at += size
    C = rows @ P @ rows.T
    sizes = np.array([b.stop - b.start for b in blocks])
    first = np.array([s.start for s in starts])
    i, j = np.triu_indices(len(blocks), 1)
    for ni, nj in {(int(sizes[p]), int(sizes[q])) for p, q in zip(i, j, strict=True)}:
        pick = (sizes[i] == ni) & (sizes[j] == nj)
        r = first[i[pick]][:, None, None] + np.arange(ni)[:, None]
        c = first[j[pick]][:, None, None] + np.arange(nj)
        out[i[pick], j[pick]] = _largest_singular_value(C[r, c])
    return np.maximum(out, out.T)


def _largest_singular_value(M: Mat) -> Vec:
    small = M @ np.swapaxes(M, -1, -2) if M.shape[-2] <= M.shape[-1] else np.swapaxes(M, -1, -2) @ M
    return np.sqrt(np.clip(np.linalg.eigvalsh(small)[..., -1], 0.0, 1.0))
