"""A camera with the five distortion coefficients of OpenCV."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models import radial
from scene_core.models.camera import Camera, Lens, pixels, unpixels
from scene_core.params import param

_RADIAL = [0, 1, 4]
"""Places of k1, k2, k3 among OpenCV's coefficients."""


@dataclass(frozen=True)
class OpenCV(Camera):
    """h = (u0 + f_u q_x, v0 + f_v q_y),  q = p (1 + k1 r^2 + k2 r^4 + k3 r^6) + t,  p = (x/z, y/z)
    t = (2 p1 p_x p_y + p2 (r^2 + 2 p_x^2), p1 (r^2 + 2 p_y^2) + 2 p2 p_x p_y)

    r = |p|; h = (u, v) [px]; k = (u0, v0, fu, fv, k1, k2, p1, p2, k3) [px, 1], the coefficients in
    OpenCV's order. Inverse by Newton's method in the plane, with the Jacobian of the implicit
    function. Seen is what lies where the lens maps one to one: within the radial fold, and where
    det dq/dp > 0.

    Source: OpenCV, *Camera calibration and 3D reconstruction*; Brown, *Decentering distortion of
    lenses*, 1966.
    """

    name = "opencv"
    calib_labels = ("u0", "v0", "fu", "fv", "k1", "k2", "p1", "p2", "k3")
    calib_units = ("px", "px", "px", "px", "", "", "", "", "")

    k1: float = param(-0.1, lo=-100.0, hi=100.0, soft=(-1.0, 1.0), label="k1")
    """Radial distortion with the third power of the radius."""
    k2: float = param(0.02, lo=-100.0, hi=100.0, soft=(-1.0, 1.0), label="k2")
    """Radial distortion with its fifth power."""
    p1: float = param(0.0, lo=-1.0, hi=1.0, soft=(-0.01, 0.01), label="p1")
    """Tangential distortion of a lens tilted about the image's rows."""
    p2: float = param(0.0, lo=-1.0, hi=1.0, soft=(-0.01, 0.01), label="p2")
    """Tangential distortion of a lens tilted about the image's columns."""
    k3: float = param(0.0, lo=-100.0, hi=100.0, soft=(-1.0, 1.0), label="k3")
    """Radial distortion with the seventh power of the radius."""

    @property
    def calib0(self) -> Vec:
        centre = (self.u0, self.v0, self.f_u, self.f_v)
        return np.array([*centre, self.k1, self.k2, self.p1, self.p2, self.k3])

    def with_calib(self, k: Vec) -> Self:
        k1, k2, p1, p2, k3 = (float(x) for x in k[4:])
        return dataclasses.replace(self._with_centre(k), k1=k1, k2=k2, p1=p1, p2=p2, k3=k3)

    def image(self, p: Vec, k: Vec) -> Lens:
        return pixels(_distort(p, k[4:]), k[2:4], k[:2])

    def unimage(self, h: Vec, k: Vec) -> Lens:
        q = unpixels(h, k[2:4], k[:2])
        p = _undistort(q.p, k[4:])
        by_k = np.concatenate([p.by_p @ q.by_k, p.by_k], axis=-1)
        return Lens(p.p, p.by_p @ q.by_p, by_k)

    def in_domain(self, X: Vec) -> np.ndarray | bool:
        fold = radial.fold_radius((self.k1, self.k2, self.k3))
        if fold == np.inf and not (self.p1 or self.p2):
            return True
        # Points behind are judged elsewhere; here they only must stay finite.
        p = X[..., :2] / np.maximum(X[..., 2:3], 1e-9)
        J = _distort(p, self.calib0[4:]).by_p
        return (np.vecdot(p, p) < fold**2) & (_det(J) > 0.0)


def _distort(p: Vec, d: Vec) -> Lens:
    """q (..., 2) of p (..., 2), d = (k1, k2, p1, p2, k3)."""
    r = radial.distort(p, d[_RADIAL])
    x, y = p[..., 0], p[..., 1]
    xx, xy, yy, p1, p2 = x * x, x * y, y * y, d[2], d[3]
    by_d = np.zeros((*p.shape, 5))
    by_d[..., _RADIAL] = r.by_d
    by_d[..., 0, 2] = by_d[..., 1, 3] = 2.0 * xy
    by_d[..., 0, 3], by_d[..., 1, 2] = 3.0 * xx + yy, xx + 3.0 * yy
    by_p = r.by_p.copy()
    cross = 2.0 * (p1 * x + p2 * y)
    by_p[..., 0, 0] += 2.0 * p1 * y + 6.0 * p2 * x
    by_p[..., 0, 1] += cross
    by_p[..., 1, 0] += cross
    by_p[..., 1, 1] += 6.0 * p1 * y + 2.0 * p2 * x
    return Lens(r.p + by_d[..., 2:4] @ d[2:4], by_p, by_d)


def _undistort(q: Vec, d: Vec) -> Lens:
    """p with distorted place q (..., 2), with its Jacobians by q and by d.

    With A = dq/dp: dp/dq = A^-1 and dp/dd = -A^-1 dq/dd. Newton's method starts at the inverse of
    the radial part; a q that has no origin keeps that.
    """
    start = radial.undistort(q, d[_RADIAL]).p
    p = start
    if d[2] or d[3]:
        for _ in range(10):
            at = _distort(p, d)
            step = (_inverse(at.by_p) @ (at.p - q)[..., None])[..., 0]
            p = p - step
            if np.abs(step).max(initial=0.0) < 1e-9:  # quadratic: the next step would be 1e-18
                break
        else:
            lost = np.abs(_distort(p, d).p - q).max(-1) > 1e-9 * (1.0 + np.abs(q).max(-1))
            p = np.where(lost[..., None], start, p)
    at = _distort(p, d)
    A_inv = _inverse(at.by_p)
    return Lens(p, A_inv, -(A_inv @ at.by_k))


def _det(A: Mat) -> Vec:
    return A[..., 0, 0] * A[..., 1, 1] - A[..., 0, 1] * A[..., 1, 0]


def _inverse(A: Mat) -> Mat:
    """A^-1 (..., 2, 2), bounded at the fold, where A has none."""
    det = _det(A)
    det = np.where(np.abs(det) < 1e-6, np.copysign(1e-6, det), det)
    out = np.empty_like(A)
    out[..., 0, 0], out[..., 1, 1] = A[..., 1, 1], A[..., 0, 0]
    out[..., 0, 1], out[..., 1, 0] = -A[..., 0, 1], -A[..., 1, 0]
    return out / det[..., None, None]
