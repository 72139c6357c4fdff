"""A camera that also tells how deep in the picture a point is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import Backprojection, Fault, Projection
from scene_core.models.camera import Camera, Lens, pixels, unpixels
from scene_core.models.depth import at_inverse_depth
from scene_core.models.ordered import demand_order
from scene_core.params import param


@dataclass(frozen=True)
class DepthCamera(Camera):
    """h = (u0 + fu x/z, v0 + fv y/z, z/w) of X = (x, y, z, w)

    h = (u, v, depth) [px, px, m], k = (u0, v0, fu, fv) [px]. The depth is measured along the
    optical axis, not along the ray. R = diag(sd_px^2, sd_px^2, sd_d^2) with
    sd_d = sd_depth + depth_growth depth^2: the error of a depth that comes from triangulation.

    Source: Solà, *An EKF-SLAM toolbox in Matlab*, sensor "pinHoleDepth" (depth_growth = 0; its
    simulator takes the variance for the deviation); Khoshelham, Oude Elberink, *Accuracy and
    Resolution of Kinect Depth Data*, Sensors 2012.
    """

    name = "depth camera"
    measurement_size = 3
    labels = ("u", "v", "depth")
    units = ("px", "px", "m")
    unmeasured = ()
    calib_labels = ("u0", "v0", "fu", "fv")
    calib_units = ("px", "px", "px", "px")

    sd_depth: float = param(
        0.002, unit="m", lo=1e-6, hi=10.0, soft=(0.0005, 0.5), label="Depth noise"
    )
    """Standard deviation of a measured depth, close to the camera."""
    depth_growth: float = param(
        0.003, unit="1/m", lo=0.0, hi=1.0, soft=(0.0, 0.02), label="Depth noise, growth"
    )
    """What is added to it, times the square of the depth. 0: the same at every depth."""
    reach_min: float = param(
        0.3,
        unit="m",
        lo=1e-3,
        hi=1000.0,
        soft=(0.05, 2.0),
        label="Reach, min",
        below="reach_max",
    )
    """Points of less depth have none that can be measured."""
    reach_max: float = param(
        8.0, unit="m", lo=0.01, hi=10000.0, soft=(1.0, 20.0), label="Reach, max"
    )
    """Points of more depth have none that can be measured."""

    def __post_init__(self) -> None:
        demand_order(self)

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        width, height = self.image_size
        return (0.0, float(width)), (0.0, float(height)), (self.reach_min, self.reach_max)

    @property
    def calib0(self) -> Vec:
        return np.array([self.u0, self.v0, self.f_u, self.f_v])

    def with_calib(self, k: Vec) -> Self:
        return self._with_centre(k)

    def image(self, p: Vec, k: Vec) -> Lens:
        return pixels(Lens(p, np.eye(2), np.zeros((2, 0))), k[2:4], k[:2])

    def unimage(self, h: Vec, k: Vec) -> Lens:
        return unpixels(h, k[2:4], k[:2])

    def project(self, X: Vec, k: Vec) -> Projection:
        seen = super().project(X, k)
        # A point at infinity is out of reach; it only must stay finite.
        iw = 1.0 / np.maximum(X[..., 3], 1e-12)
        depth = X[..., 2] * iw
        h = np.concatenate([seen.h, depth[..., None]], axis=-1)
        dh_by_dX, dh_by_dk = np.zeros((*h.shape, 4)), np.zeros((*h.shape, 4))
        dh_by_dX[..., :2, :], dh_by_dk[..., :2, :] = seen.dh_by_dX, seen.dh_by_dk
        dh_by_dX[..., 2, 2], dh_by_dX[..., 2, 3] = iw, -depth * iw
        return Projection(h, dh_by_dX, dh_by_dk)

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """X = (m, m_z / depth), m the unit ray of (u, v)."""
        s = 1.0 / np.maximum(z[..., 2:], 1e-12)
        X, by_uv, by_s, by_k = at_inverse_depth(super().backproject(z[..., :2], s, k), s)
        assert by_uv is not None and by_s is not None
        dX_by_dz = np.concatenate([by_uv, by_s * -(s**2)[..., None]], axis=-1)
        return Backprojection(X, dX_by_dz, np.zeros((*X.shape, 0)), by_k)

    def R(self, h: Vec) -> Mat:
        # Beyond the reach nothing is measured; the noise of such a prediction only must be finite.
        depth = np.clip(h[..., 2], 0.0, self.reach_max)
        R = np.zeros((*h.shape, 3))
        R[..., 0, 0] = R[..., 1, 1] = self.sd_px**2
        R[..., 2, 2] = (self.sd_depth + self.depth_growth * depth**2) ** 2
        return R

    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """As any camera's, and OUTSIDE the reach in depth."""
        seen = super().visibility(h[..., :2], X, xws, pose0, y_X)
        depth = h[..., 2]
        beyond = (depth < self.reach_min) | (depth > self.reach_max)
        return seen | (beyond & (X[..., 2] > 0.0)) * int(Fault.OUTSIDE)
