"""An omnidirectional camera: any rotationally symmetric lens or mirror, by a polynomial."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models import equidistant
from scene_core.models.base import Backprojection, Projection
from scene_core.models.camera import CentralCamera, Lens
from scene_core.params import ParamError, param


@dataclass(frozen=True)
class Omnidirectional(CentralCamera):
    """h = (u0, v0) + [1 e; d c] rho(theta) (x, y) / r,  rho = a0 + a1 theta + a2 theta^2 + ...,
    theta = atan2(z, r),  r = |(x, y)|

    theta is the elevation above the plane of the lens [rad]: pi/2 on the optical axis, negative
    behind; rho falls from 0 at pi/2 to the edge of the image. h = (u, v) [px];
    k = (u0, v0, c, d, e, a0, a1, ...) [px, 1], c, d and e as in the literature, whose first
    coordinate counts rows and whose second columns. Seen is what lies above `theta_min`. The
    inverse is Newton's method on the same polynomial, with the Jacobian of the implicit function.

    Source: Scaramuzza, Martinelli, Siegwart, *A flexible technique for accurate omnidirectional
    camera calibration and structure from motion*, ICVS 2006; Solà, *An EKF-SLAM toolbox in Matlab*,
    sensor "omniCam", whose inverse is a second polynomial fitted to the first and whose view ends
    at theta = 0.
    """

    name = "omnidirectional"

    width: int = param(1280, unit="px", lo=8, hi=16384, effect="on reset", label="Width")
    """Width of the image."""
    height: int = param(800, unit="px", lo=8, hi=16384, effect="on reset", label="Height")
    """Height of the image."""
    u0: float = param(640.0, unit="px", lo=-16384.0, hi=16384.0, soft=(0.0, 1280.0))
    """Column of the optical axis, from the image's left border."""
    v0: float = param(400.0, unit="px", lo=-16384.0, hi=16384.0, soft=(0.0, 800.0))
    """Row of the optical axis, from the image's top border."""
    affine_c: float = param(1.0, lo=0.1, hi=10.0, soft=(0.9, 1.1), label="Affine c")
    """Scale of the rows against the columns: pixels that are not square, or a sensor askew."""
    affine_d: float = param(0.0, lo=-5.0, hi=5.0, soft=(-0.05, 0.05), label="Affine d")
    """Shear of the rows with the columns."""
    affine_e: float = param(0.0, lo=-5.0, hi=5.0, soft=(-0.05, 0.05), label="Affine e")
    """Shear of the columns with the rows."""
    polynomial: tuple[float, ...] = param(
        (608.9396077927713, -362.9889834959149, -23.561944901923447, 5.0),
        unit="px",
        lo=-1e6,
        hi=1e6,
    )
    """a0, a1, ...: distance from the centre of the image by the elevation in radians. These show
    190 degrees across 1280 pixels."""
    theta_min: float = param(
        -0.09, unit="rad", lo=-1.5, hi=1.5, soft=(-0.6, 0.6), label="Lowest elevation"
    )
    """Elevation at which the view ends, negative behind the plane of the lens."""

    def __post_init__(self) -> None:
        edge, centre = (
            np.polynomial.polynomial.polyval(theta, self.polynomial or (0.0,))
            for theta in (self.theta_min, 0.5 * np.pi)
        )
        if not edge > centre:
            raise ParamError(
                f"the polynomial {self.polynomial} puts the edge of the view (at {self.theta_min} "
                f"rad) {edge:.6g} px from the centre and the optical axis {centre:.6g} px: it must "
                "fall with the elevation, so give at least a0 and a negative a1, in px"
            )

    @property
    def calib_labels(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As many a as the polynomial has coefficients."""
        return ("u0", "v0", "c", "d", "e", *(f"a{i}" for i in range(len(self.polynomial))))

    @property
    def calib_units(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("px", "px", "", "", "") + ("px",) * len(self.polynomial)

    @property
    def calib0(self) -> Vec:
        affine = (self.affine_c, self.affine_d, self.affine_e)
        return np.array([self.u0, self.v0, *affine, *self.polynomial])

    def with_calib(self, k: Vec) -> Self:
        u0, v0, c, d, e, *a = (float(x) for x in k)
        return dataclasses.replace(
            self, u0=u0, v0=v0, affine_c=c, affine_d=d, affine_e=e, polynomial=tuple(a)
        )

    def image(self, p: Vec, k: Vec) -> Lens:
        """Pixels of p = alpha (x, y) / r, alpha = pi/2 - theta the angle to the axis."""
        alpha = np.sqrt(np.vecdot(p, p))
        rho, slope, powers = _polynomial(0.5 * np.pi - alpha, k[5:])
        on_axis = alpha < 1e-9
        safe = np.where(on_axis, 1.0, alpha)
        way = p / safe[..., None]
        # On the axis rho = 0 and q = -rho' p; q = rho p / alpha elsewhere, with
        # dq/dp = rho / alpha (I - way way') - rho' way way'.
        across = np.where(on_axis, -slope, rho / safe)
        q = across[..., None] * p
        by_p = -((across + slope)[..., None] * way)[..., :, None] * way[..., None, :]
        by_p[..., 0, 0] += across
        by_p[..., 1, 1] += across
        A = _affine(k)
        by_k = np.zeros((*p.shape, len(k)))
        by_k[..., 0, 0] = by_k[..., 1, 1] = 1.0
        by_k[..., 1, 2] = by_k[..., 0, 4] = q[..., 1]
        by_k[..., 1, 3] = q[..., 0]
        by_k[..., 5:] = (way @ A.T)[..., :, None] * powers[..., None, :]
        return Lens(k[:2] + q @ A.T, A @ by_p, by_k)

    def unimage(self, h: Vec, k: Vec) -> Lens:
        """p = alpha (x, y) / r seen at pixels h; the edge of the view for pixels beyond it."""
        A_inv = np.linalg.inv(_affine(k))
        q = (h - k[:2]) @ A_inv.T
        rho = np.sqrt(np.vecdot(q, q))
        way = q / np.maximum(rho, 1e-12)[..., None]
        theta = _inverse(rho, k[5:], self.theta_min)
        _, slope, powers = _polynomial(theta, k[5:])
        slope = np.minimum(slope, -1e-3)
        alpha = 0.5 * np.pi - theta
        # d alpha / d rho = -1 / rho', d alpha / d a_i = theta^i / rho'.
        across = np.where(rho > 1e-9, alpha / np.maximum(rho, 1e-12), -1.0 / slope)
        by_q = -((across + 1.0 / slope)[..., None] * way)[..., :, None] * way[..., None, :]
        by_q[..., 0, 0] += across
        by_q[..., 1, 1] += across
        by_h = by_q @ A_inv
        by_k = np.zeros((*h.shape, len(k)))
        by_k[..., :2] = -by_h
        # A q = h - c: dq/dA = -A^-1 dA q.
        by_k[..., 2], by_k[..., 3] = -by_h[..., 1] * q[..., 1:], -by_h[..., 1] * q[..., :1]
        by_k[..., 4] = -by_h[..., 0] * q[..., 1:]
        by_k[..., 5:] = way[..., :, None] * (powers / slope[..., None])[..., None, :]
        return Lens(alpha[..., None] * way, by_h, by_k)

    def project(self, X: Vec, k: Vec) -> Projection:
        return equidistant.project(self.image, X, k)

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        return equidistant.backproject(self.unimage, z, n, k)

    def behind(self, X: Vec) -> np.ndarray:
        return equidistant.angle(X) >= 0.5 * np.pi - self.theta_min


def _affine(k: Vec) -> Mat:
    return np.array([[1.0, k[4]], [k[3], k[2]]])


def _polynomial(theta: Vec, a: Vec) -> tuple[Vec, Vec, Vec]:
    """rho (...,), drho/dtheta (...,) and drho/da = (1, theta, theta^2, ...) (..., n)."""
    powers = theta[..., None] ** np.arange(len(a))
    return powers @ a, powers[..., :-1] @ (a[1:] * np.arange(1, len(a))), powers


def _inverse(rho: Vec, a: Vec, lowest: float) -> Vec:
    """theta in [lowest, pi/2] with rho(theta) = rho, rho falling there; the nearer end for a rho
    that is not reached. Newton's method, halved back into the bracket where it strays."""
    lo, hi = np.full(rho.shape, lowest), np.full(rho.shape, 0.5 * np.pi)
    ends = _polynomial(np.array([0.5 * np.pi, lowest]), a)[0]
    target = np.clip(rho, ends[0], max(ends))
    theta = 0.5 * np.pi - (target - ends[0]) * (0.5 * np.pi - lowest) / (ends[1] - ends[0])
    for _ in range(60):
        value, slope, _ = _polynomial(theta, a)
        lo, hi = np.where(value >= target, theta, lo), np.where(value <= target, theta, hi)
        step = (value - target) / np.minimum(slope, -1e-3)
        after = theta - step
        after = np.where((after >= lo) & (after <= hi), after, 0.5 * (lo + hi))
        done = np.abs(after - theta).max(initial=0.0) < 1e-14
        theta = after
        if done:
            break
    return theta
