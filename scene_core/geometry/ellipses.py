"""Chi-square gates, ellipses and ellipsoids of covariances, and consistency statistics.

An ellipse is stated by confidence and dimension: a 95 % region has a half-width of 1.960, 2.448,
2.795 standard deviations in 1-D, 2-D, 3-D.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.special import gammaincinv

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion


@lru_cache(maxsize=4096)
def chi2_gate(dof: float, confidence: float) -> float:
    """The chi-square quantile: d2 of `dof` degrees of freedom stays below it with `confidence`."""
    return float(2.0 * gammaincinv(dof / 2.0, confidence))


def sigma(dim: int, confidence: float) -> float:
    """Half-width, in standard deviations, of the region of `dim` dimensions and `confidence`."""
    return float(np.sqrt(chi2_gate(dim, confidence)))


def chi2_band(dof: float, n: int = 1, probability: float = 0.95) -> tuple[float, float]:
    """Two-sided interval of the mean of n independent chi-square values of `dof` degrees each.

    Source: Bar-Shalom, Li, Kirubarajan, *Estimation with Applications*, section 5.4.
    """
    tail = (1.0 - probability) / 2.0
    return chi2_gate(dof * n, tail) / n, chi2_gate(dof * n, 1.0 - tail) / n


CERTAIN = 1e-6
"""What is left of a variance when it is made zero: linearising leaves some of the second order."""


def d2(nu: Vec, S: Mat) -> Vec:
    """Squared Mahalanobis distances nu' S^-1 nu (...,) of nu (..., m) under S (..., m, m)."""
    m = nu.shape[-1]
    if m == 1:
        return nu[..., 0] ** 2 / S[..., 0, 0]
    if m == 2:
        a, b, c = S[..., 0, 0], S[..., 0, 1], S[..., 1, 1]
        u, v = nu[..., 0], nu[..., 1]
        return (c * u * u - 2.0 * b * u * v + a * v * v) / (a * c - b * b)
    return (nu * np.linalg.solve(S, nu[..., None])[..., 0]).sum(-1)


def nees(e: Vec, P: Mat) -> float:
    """Normalised estimation error squared e' P^-1 e of an error on the tangent (n,).

    NaN where P, with its diagonal scaled to one, has an eigenvalue below `CERTAIN`: an error in a
    direction that is said to be known exactly has no finite NEES.
    """
    P = np.asarray(P)
    scale = np.sqrt(np.maximum(np.diagonal(P), 0.0))
    if not (scale > 0.0).all():
        return float("nan")
    C = P / np.outer(scale, scale)
    if np.linalg.eigvalsh(C)[0] < CERTAIN:
        return float("nan")
    r = np.linalg.solve(np.linalg.cholesky(C), e / scale)
    return float(r @ r)


def ellipsoids(P: Mat) -> tuple[Vec, Vec]:
    """Axes of covariances (..., 3, 3): standard deviations (..., 3) and orientations wxyz (..., 4).

    Multiply the first by `sigma(3, confidence)`. Eigenvalues below zero by rounding count as zero.
    """
    values, axes = np.linalg.eigh(P)
    axes[..., :, 0] *= np.sign(np.linalg.det(axes))[..., None]
    return np.sqrt(np.maximum(values, 0.0)), quaternion.from_matrix(axes)


def roots(P: Mat) -> Mat:
    """L (..., d, d) with L L' = P, for positive semi-definite P: lower triangular for d <= 2."""
    P = np.asarray(P, dtype=np.float64)
    if P.shape[-1] == 1:
        return np.sqrt(np.maximum(P, 0.0))
    if P.shape[-1] == 2:
        L = np.zeros_like(P)
        L[..., 0, 0] = np.sqrt(np.maximum(P[..., 0, 0], 0.0))
        wide = np.where(L[..., 0, 0] > 0.0, L[..., 0, 0], 1.0)
        L[..., 1, 0] = np.where(L[..., 0, 0] > 0.0, P[..., 1, 0] / wide, 0.0)
        L[..., 1, 1] = np.sqrt(np.maximum(P[..., 1, 1] - L[..., 1, 0] ** 2, 0.0))
        return L
    values, axes = np.linalg.eigh(P)
    return axes * np.sqrt(np.maximum(values, 0.0))[..., None, :]


def ellipse_points(mean: Vec, P: Mat, half_width: float, count: int = 32) -> Vec:
    """Open contours (..., count, 2) of planar ellipses at `half_width` standard deviations."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    circle = half_width * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.asarray(mean)[..., None, :] + circle @ np.swapaxes(roots(P), -1, -2)
