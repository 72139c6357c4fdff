"""What all cameras share: the image, its noise, and when a feature can be expected in it.

Axes: x right, y down, z forward; pixels u right, v down. Scene's camera (x left, y up) is this one
with its mount rotated by pi about z.
"""

from __future__ import annotations

import dataclasses
from abc import abstractmethod
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D
from scene_core.models import first_view
from scene_core.models.base import Backprojection, Fault, Projection, Sensor
from scene_core.params import param


class Lens(NamedTuple):
    """A planar map of a lens: values (..., 2), Jacobians by the input (..., 2, 2) and by the
    calibration k (..., 2, nk)."""

    p: Vec
    by_p: Mat
    by_k: Mat


@dataclass(frozen=True)
class CentralCamera(Sensor):
    """A camera whose rays all meet in one point, whatever its lens.

    w does not enter: a point at infinity is as good as any.
    """

    space = THREE_D
    pane = "image"
    measurement_size = 2
    labels = ("u", "v")
    units = ("px", "px")
    unmeasured = ("rho",)

    width: int = param(320, unit="px", lo=8, hi=16384, effect="on reset", label="Width")
    """Width of the image."""
    height: int = param(240, unit="px", lo=8, hi=16384, effect="on reset", label="Height")
    """Height of the image."""
    u0: float = param(162.0, unit="px", lo=-16384.0, hi=16384.0, soft=(100.0, 220.0))
    """Column of the optical axis, from the image's left border."""
    v0: float = param(125.0, unit="px", lo=-16384.0, hi=16384.0, soft=(80.0, 160.0))
    """Row of the optical axis, from the image's top border."""
    sd_px: float = param(1.0, unit="px", lo=1e-4, hi=100.0, soft=(0.1, 5.0), label="Pixel noise")
    """Standard deviation of a measured position, in columns and in rows."""
    border: float = param(0.0, unit="px", lo=0.0, hi=1000.0, soft=(0.0, 60.0), label="Border")
    """No feature is measured nearer than this to the border of the image."""
    max_scale: float = param(2.0, lo=0.0, hi=100.0, soft=(0.0, 5.0), label="Scale change, max")
    """A feature is not measured from farther, or nearer, than this many times the distance of its
    first view. 0: no limit."""
    max_angle: float = param(
        np.pi / 4, unit="rad", lo=0.0, hi=np.pi, soft=(0.0, 1.6), label="View change, max"
    )
    """A feature is not measured from a direction that differs more than this from that of its
    first view. 0: no limit."""

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) [px]."""
        return self.width, self.height

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        return (0.0, float(self.width)), (0.0, float(self.height))

    @abstractmethod
    def with_calib(self, k: Vec) -> Self:
        """The same camera with calib0 = k."""

    def behind(self, X: Vec) -> np.ndarray:
        """Where points X (..., 4) are behind the lens, so that their h means nothing."""
        return X[..., 2] <= 0.0

    def in_domain(self, X: Vec) -> np.ndarray | bool:
        """Where points X (..., 4) that are not behind lie on the part of the lens that maps one to
        one; one beyond is not seen though its h may lie inside the image. True: everywhere."""
        return True

    def R(self, h: Vec) -> Mat:
        return np.broadcast_to(self.sd_px**2 * np.eye(2), (*h.shape[:-1], 2, 2))

    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """BEHIND the lens, OUTSIDE the image less its border, SCALE and ANGLE against the first
        view (`first_view.faults`)."""
        low = (self.border, self.border)
        high = (self.width - self.border, self.height - self.border)
        outside = ((h < low) | (h > high)).any(-1)
        domain = self.in_domain(X)
        if domain is not True:
            outside = outside | ~np.asarray(domain)
        fault = np.where(self.behind(X), int(Fault.BEHIND), outside * int(Fault.OUTSIDE))
        return fault | first_view.faults(xws, pose0, y_X, self.max_scale, self.max_angle)


@dataclass(frozen=True)
class Camera(CentralCamera):
    """A camera with focal lengths: h = image(p, k), k = (u0, v0, fu, fv, ...), p = (x / z, y / z).

    Final cameras supply the lens from p to pixels and back; one that takes other coordinates than
    p says so, and projects by them.
    """

    f_u: float = param(195.0, unit="px", lo=1.0, hi=1e5, soft=(50.0, 800.0), label="f u")
    """Focal length in columns: pixels per unit of x / z near the axis."""
    f_v: float = param(195.0, unit="px", lo=1.0, hi=1e5, soft=(50.0, 800.0), label="f v")
    """Focal length in rows."""

    @abstractmethod
    def image(self, p: Vec, k: Vec) -> Lens:
        """Pixels h (..., 2) of p = (x / z, y / z) (..., 2)."""

    @abstractmethod
    def unimage(self, h: Vec, k: Vec) -> Lens:
        """p (..., 2) seen at pixels h (..., 2)."""

    def project(self, X: Vec, k: Vec) -> Projection:
        p, iz = _plane(X)
        lens = self.image(p, k)
        # dp/dX = [1/z, 0, -p_x/z, 0; 0, 1/z, -p_y/z, 0]
        dh_by_dX = np.zeros((*p.shape, 4))
        dh_by_dX[..., :2] = lens.by_p * iz[..., None, None]
        dh_by_dX[..., 2] = -(dh_by_dX[..., :2] @ p[..., None])[..., 0]
        return Projection(lens.p, dh_by_dX, lens.by_k)

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """Unit ray m = (p, 1) / |(p, 1)| and w = n, n (..., 1) the inverse distance [1/m].

        The Jacobian of v / |v| is exact: SceneLib's has the square of the norm, the toolbox's is
        I / |v|.
        """
        lens = self.unimage(z, k)
        length = np.sqrt(1.0 + np.vecdot(lens.p, lens.p))[..., None]
        X = np.empty((*lens.p.shape[:-1], 4))
        X[..., :2] = lens.p / length
        X[..., 2] = 1.0 / length[..., 0]
        X[..., 3] = n[..., 0]
        # d(v/|v|)/dv = (I - m m') / |v|; v's third component is constant.
        m = X[..., :3]
        by_p = -m[..., :, None] * m[..., None, :2]
        by_p[..., 0, 0] += 1.0
        by_p[..., 1, 1] += 1.0
        by_p /= length[..., None]
        by_z, by_k = np.zeros((*X.shape, 2)), np.zeros((*X.shape, lens.by_k.shape[-1]))
        by_z[..., :3, :] = by_p @ lens.by_p
        by_k[..., :3, :] = by_p @ lens.by_k
        by_n = np.zeros((4, 1))
        by_n[3, 0] = 1.0
        return Backprojection(X, by_z, by_n, by_k)

    def _with_centre(self, k: Vec) -> Self:
        u0, v0, f_u, f_v = (float(x) for x in k[:4])
        return dataclasses.replace(self, u0=u0, v0=v0, f_u=f_u, f_v=f_v)


def _plane(X: Vec) -> tuple[Vec, Vec]:
    """p = (x / z, y / z) (..., 2) and 1 / z (...,), bounded where z is (nearly) zero.

    Such points are not visible; they only must not spoil the others in the batch.
    """
    z = X[..., 2]
    if z.min(initial=1.0) < 1e-6:
        floor = 1e-9 * (1.0 + np.abs(X[..., :2]).sum(-1))
        z = np.where(np.abs(z) < floor, np.copysign(floor, z), z)
    iz = 1.0 / z
    return X[..., :2] * iz[..., None], iz


def pixels(q: Lens, f: Vec, c: Vec) -> Lens:
    """h = c + f q for an ideal position q = (q_x, q_y), with k = (c, f, whatever q depends on)."""
    nd = q.by_k.shape[-1]
    by_k = np.zeros((*q.p.shape, 4 + nd))
    by_k[..., 0, 0] = by_k[..., 1, 1] = 1.0
    by_k[..., 0, 2], by_k[..., 1, 3] = q.p[..., 0], q.p[..., 1]
    by_k[..., 4:] = f[:, None] * q.by_k
    return Lens(c + f * q.p, f[:, None] * q.by_p, by_k)


def unpixels(h: Vec, f: Vec, c: Vec) -> Lens:
    """q = (h - c) / f, by k = (c, f)."""
    q = (h - c) / f
    by_k = np.zeros((*q.shape, 4))
    by_k[..., 0, 0], by_k[..., 1, 1] = -1.0 / f[0], -1.0 / f[1]
    by_k[..., 0, 2], by_k[..., 1, 3] = -q[..., 0] / f[0], -q[..., 1] / f[1]
    return Lens(q, np.diag(1.0 / f), by_k)
