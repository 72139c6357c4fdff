"""Radial distortion of any order, r_out = r (1 + d1 r^2 + d2 r^4 + ...), and its inverse.

Used forwards or backwards by the cameras; whichever way needs the inverse gets it by Newton's
method, with the Jacobians of the implicit function, so that the coefficients may be estimated.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec

_EYE = np.eye(2)
_ONE = np.ones(())


class Scaled(NamedTuple):
    """Points (..., 2), Jacobians by the argument (..., 2, 2) and coefficients (..., 2, nd)."""

    p: Vec
    by_p: Mat
    by_d: Mat


@lru_cache(maxsize=1024)
def _fold(d: tuple[float, ...]) -> float:
    # dr_out/dr = 1 + 3 d1 s + 5 d2 s^2 + ... with s = r^2; its smallest positive root.
    slopes = [(2 * i + 3) * di for i, di in enumerate(d)]
    roots = np.roots([*slopes[::-1], 1.0])
    real = roots.real[(np.abs(roots.imag) < 1e-9 * (1.0 + np.abs(roots))) & (roots.real > 0.0)]
    return float(np.sqrt(real.min())) if len(real) else np.inf


def fold_radius(d: Vec | tuple[float, ...]) -> float:
    """The radius up to which the distortion is one to one; inf when it is everywhere."""
    return _fold(d if isinstance(d, tuple) else tuple(d.tolist()))


def _factor(s: Vec, d: Vec) -> tuple[Vec, Vec]:
    """L = 1 + d1 s + d2 s^2 + ... and dL/ds, by Horner's rule."""
    coefficients = d.tolist()
    n = len(coefficients)
    L, dL = coefficients[-1] * s, n * coefficients[-1] + 0.0 * s
    for i in range(n - 1, 0, -1):
        L = (L + coefficients[i - 1]) * s
        dL = dL * s + i * coefficients[i - 1]
    return L + 1.0, dL


def _powers(s: Vec, count: int) -> Vec:
    """(s, s^2, ...) (..., count)."""
    out = np.empty((*s.shape, count))
    power = s
    for i in range(count):
        out[..., i] = power
        power = power * s
    return out


def distort(p: Vec, d: Vec) -> Scaled:
    """p L(|p|^2) for points p (..., 2), with Jacobians.

    Outside `fold_radius` the polynomial bends back; the caller marks such points as not visible.
    """
    if not len(d):
        return Scaled(p, _EYE, np.zeros((*p.shape, 0)))
    s = np.vecdot(p, p)
    L, dL = _factor(s, d)
    by_p = (2.0 * dL[..., None] * p)[..., :, None] * p[..., None, :]
    by_p[..., 0, 0] += L
    by_p[..., 1, 1] += L
    return Scaled(L[..., None] * p, by_p, p[..., :, None] * _powers(s, len(d))[..., None, :])


def undistort(p_out: Vec, d: Vec) -> Scaled:
    """p with p L(|p|^2) = p_out (..., 2), |p| below the fold, with Jacobians by p_out and by d.

    With A = dp_out/dp: dp/dp_out = A^-1 and dp/dd_i = -A^-1 p |p|^(2i). A p_out farther out than
    the fold's image has no origin: it gets the fold's own, in its direction.
    """
    if not len(d):
        return Scaled(p_out, _EYE, np.zeros((*p_out.shape, 0)))
    r_out = np.sqrt(np.vecdot(p_out, p_out))
    r, reached = _inverse_radius(r_out, d)
    s = r * r
    L, dL = _factor(s, d)
    p = p_out * (reached / L)[..., None]
    # A = L I + 2 L' p p', inverted by the Sherman-Morrison formula.
    slope = (2.0 * dL / (L + 2.0 * dL * s))[..., None, None]
    by_p = (_EYE - slope * (p[..., :, None] * p[..., None, :])) / L[..., None, None]
    by_d = -(by_p @ p[..., None]) * _powers(s, len(d))[..., None, :]
    return Scaled(p, by_p, by_d)


def _inverse_radius(r_out: Vec, d: Vec) -> tuple[Vec, Vec]:
    """r with r L(r^2) = r_out, and the fraction of r_out that the lens reaches (1 but beyond the
    fold)."""
    fold = fold_radius(d)
    # Just short of the fold the slope is still positive, which keeps the Jacobian finite.
    limit = 0.999 * fold
    most = limit * float(_factor(np.array(limit**2), d)[0]) if np.isfinite(fold) else np.inf
    target = np.minimum(r_out, most)
    r = np.minimum(target, limit)
    for _ in range(8):
        step = _newton_step(r, target, d)
        r = np.minimum(np.maximum(r - step, 0.0), limit)
        if np.abs(step).max(initial=0.0) < 1e-9:  # quadratic: the next step would be 1e-18
            break
    else:
        bad = np.abs(_newton_step(r, target, d)) > 1e-12 * (1.0 + r)
        r = np.where(bad, _bisected(target, d, limit), r)
    if np.isinf(most):
        return r, _ONE
    return r, target / np.where(target > 0.0, r_out, 1.0) + (target <= 0.0)


def _newton_step(r: Vec, target: Vec, d: Vec) -> Vec:
    L, dL = _factor(r * r, d)
    return (r * L - target) / (L + 2.0 * dL * r * r)


def _bisected(target: Vec, d: Vec, limit: float) -> Vec:
    """The same root where Newton's method strays: a bracket halved down to the last bits."""
    lo, hi = np.zeros_like(target), np.minimum(np.maximum(2.0 * target, 1.0), limit)
    for _ in range(60):
        low = (hi * _factor(hi * hi, d)[0] < target) & (hi < limit)
        if not low.any():
            break
        hi = np.where(low, np.minimum(2.0 * hi, limit), hi)
    for _ in range(60):
        mid = 0.5 * (lo + hi)
        below = mid * _factor(mid * mid, d)[0] < target
        lo, hi = np.where(below, mid, lo), np.where(below, hi, mid)
    return 0.5 * (lo + hi)
