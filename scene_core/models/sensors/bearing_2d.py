"""A planar sensor that tells the direction of a point and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import TWO_D, wrap
from scene_core.models.base import Backprojection, Fault, Innovation, Projection, Sensor
from scene_core.params import param


@dataclass(frozen=True)
class PlanarBearing(Sensor):
    """h = atan2(x, z) of X = (z, x, w)

    h = (b) [rad], from the sensor's z axis towards its x axis; R = sd^2. The distance stays open
    (rho, the inverse distance [1/m]): a point at infinity is as good as any.

    Source: Bailey, *Constrained Initialisation for Bearing-Only SLAM*, ICRA 2003, in the axes of
    Scene.
    """

    name = "planar bearing"
    space = TWO_D
    pane = "polar"
    measurement_size = 1
    labels = ("b",)
    units = ("rad",)
    unmeasured = ("rho",)

    sd: float = param(0.02, unit="rad", lo=1e-6, hi=3.2, soft=(0.001, 0.2), label="Noise")
    """Standard deviation of a measured bearing."""
    field_of_view: float = param(
        2 * np.pi, unit="rad", lo=0.01, hi=2 * np.pi, soft=(0.5, 2 * np.pi), label="Field of view"
    )
    """Full opening angle, symmetric about the sensor's z axis."""

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        half = 0.5 * self.field_of_view
        return ((-half, half),)

    def project(self, X: Vec, k: Vec) -> Projection:
        z, x = X[..., 0], X[..., 1]
        # On the sensor itself there is no direction; it only must stay finite.
        m2 = np.maximum(z * z + x * x, 1e-24)
        h = np.arctan2(x, z)[..., None]
        dh_by_dX = np.zeros((*h.shape, 3))
        dh_by_dX[..., 0, 0], dh_by_dX[..., 0, 1] = -x / m2, z / m2
        return Projection(h, dh_by_dX, np.zeros((*h.shape, 0)))

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """X = (cos b, sin b, rho), n = (rho) [1/m]."""
        c, s = np.cos(z[..., 0]), np.sin(z[..., 0])
        X = np.stack([c, s, np.broadcast_to(n[..., 0], c.shape)], axis=-1)
        dX_by_dz = np.stack([-s, c, np.zeros_like(c)], axis=-1)[..., None]
        dX_by_dn = np.array([[0.0], [0.0], [1.0]])
        return Backprojection(X, dX_by_dz, dX_by_dn, np.zeros((*X.shape, 0)))

    def R(self, h: Vec) -> Mat:
        return np.full((*h.shape, 1), self.sd**2)

    def nu(self, h: Vec, z: Vec) -> Innovation:
        return Innovation(wrap(z - h), -np.eye(1), np.eye(1))

    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """OUTSIDE the field of view."""
        return np.where(np.abs(h[..., 0]) > 0.5 * self.field_of_view, int(Fault.OUTSIDE), 0)
