"""Two cameras side by side as one sensor."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import Backprojection, Fault, Projection
from scene_core.models.camera import Camera, Lens, pixels, unpixels
from scene_core.models.depth import at_inverse_depth
from scene_core.params import param


@dataclass(frozen=True)
class StereoPair(Camera):
    """h = (u0 + fu x/z, v0 + fv y/z, u0 + fu (x - b w)/z, v0 + fv y/z) of X = (x, y, z, w)

    h = (uL, vL, uR, vR) [px] of a rectified pair, the sensor's axes being those of the left
    camera and the right one b along its x; k = (u0, v0, fu, fv, b) [px, m].
    R = diag(sd_px^2, sd_row^2, sd_px^2, sd_row^2). Four numbers for three: where a measurement
    contradicts itself, the point is that of least squares, with the mean of both rows. A point at
    infinity has no disparity and may be measured, not initialised: one starts within `reach_max`.

    Source: Hartley, Zisserman, *Multiple View Geometry*, section 11.12; Barfoot, *State Estimation
    for Robotics*, section 6.4.
    """

    name = "stereo"
    measurement_size = 4
    labels = ("uL", "vL", "uR", "vR")
    units = ("px", "px", "px", "px")
    unmeasured = ()
    calib_labels = ("u0", "v0", "fu", "fv", "baseline")
    calib_units = ("px", "px", "px", "px", "m")

    baseline: float = param(0.24, unit="m", lo=1e-4, hi=100.0, soft=(0.02, 1.0), label="Baseline")
    """Distance of the two cameras."""
    sd_row: float = param(0.0, unit="px", lo=0.0, hi=100.0, soft=(0.0, 5.0), label="Row noise")
    """Standard deviation of a measured row where it differs from that of a column. 0: the same."""
    reach_max: float = param(
        50.0, unit="m", lo=0.1, hi=1e5, soft=(2.0, 100.0), label="Initial depth, max"
    )
    """A point that is measured to be deeper than this, or beyond infinity, starts here."""

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        return 2 * super().limits

    @property
    def calib0(self) -> Vec:
        return np.array([self.u0, self.v0, self.f_u, self.f_v, self.baseline])

    def with_calib(self, k: Vec) -> Self:
        return dataclasses.replace(self._with_centre(k), baseline=float(k[4]))

    def image(self, p: Vec, k: Vec) -> Lens:
        return pixels(Lens(p, np.eye(2), np.zeros((2, 0))), k[2:4], k[:2])

    def unimage(self, h: Vec, k: Vec) -> Lens:
        return unpixels(h, k[2:4], k[:2])

    def project(self, X: Vec, k: Vec) -> Projection:
        across = np.zeros((4, 4))
        across[0, 3] = k[4]
        left, right = super().project(X, k[:4]), super().project(X - X @ across.T, k[:4])
        assert right.dh_by_dX is not None
        h = np.concatenate([left.h, right.h], axis=-1)
        dh_by_dX, dh_by_dk = np.zeros((*h.shape, 4)), np.zeros((*h.shape, 5))
        dh_by_dX[..., :2, :] = left.dh_by_dX
        dh_by_dX[..., 2:, :] = right.dh_by_dX @ (np.eye(4) - across)
        dh_by_dk[..., :2, :4], dh_by_dk[..., 2:, :4] = left.dh_by_dk, right.dh_by_dk
        dh_by_dk[..., 2:, 4] = -right.dh_by_dX[..., 0] * X[..., 3:]
        return Projection(h, dh_by_dX, dh_by_dk)

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """X = (m, m_z (uL - uR) / (fu b)), m the unit ray of (uL, (vL + vR) / 2).

        A disparity nearer to zero than that of `reach_max`, or below, is raised to it; its spread
        is kept, so that the point may turn out to be anywhere beyond.
        """
        # Of (uL, v) by (uL, vL, uR, vR).
        middle = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.5]])
        fb = k[2] * k[4]
        s = np.maximum((z[..., :1] - z[..., 2:3]) / fb, 1.0 / self.reach_max)
        ray = super().backproject(z @ middle.T, s, k[:4])
        X, by_uv, by_s, by_k4 = at_inverse_depth(ray, s)
        assert by_uv is not None and by_s is not None and by_k4 is not None
        dX_by_dz = by_uv @ middle + by_s @ (np.array([[1.0, 0.0, -1.0, 0.0]]) / fb)
        dX_by_dk = np.zeros((*X.shape, 5))
        dX_by_dk[..., :4] = by_k4
        ds_by_dk = np.zeros((*s.shape[:-1], 1, 5))
        ds_by_dk[..., 0, 2:3], ds_by_dk[..., 0, 4:] = -s / k[2], -s / k[4]
        return Backprojection(X, dX_by_dz, np.zeros((*X.shape, 0)), dX_by_dk + by_s @ ds_by_dk)

    def R(self, h: Vec) -> Mat:
        sd = np.array([self.sd_px, self.sd_row or self.sd_px])
        return np.broadcast_to(np.diag(np.tile(sd**2, 2)), (*h.shape[:-1], 4, 4))

    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """As any camera's, and OUTSIDE where the right image does not show it."""
        seen = super().visibility(h[..., :2], X, xws, pose0, y_X)
        u = h[..., 2]
        missed = (u < self.border) | (u > self.width - self.border)
        return seen | (missed & (X[..., 2] > 0.0)) * int(Fault.OUTSIDE)
