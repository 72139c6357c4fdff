"""Scene's active stereo head: two cameras that turn towards one point and look at nothing else."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D, wrap
from scene_core.models import first_view
from scene_core.models.base import Backprojection, Fault, Innovation, Projection, Sensor
from scene_core.models.directions import SCENE, angles, direction
from scene_core.params import param


@dataclass(frozen=True)
class StereoHead(Sensor):
    """h = (atan2(x, z), atan2(y, |(x, z)|), atan2(I w / 2, |m|)) of X = (m, w) = (x, y, z, w)

    h = (pan, elevation, vergence) [rad]: the angles at which the head fixates a point, seen from
    the middle between its cameras in Scene's axes: x left, y up, z forward; k = (I) [m], the
    distance between the cameras. R = diag(sd_pan^2, sd_elevation^2, sd_vergence^2). The height of
    the head is part of its mount's pose. A point at infinity has vergence 0.

    Source: Davison, Scene library, head point features of the Nomad's active head, where the limit
    of the vergence is declared and never tested.
    """

    name = "stereo head"
    space = THREE_D
    pane = "polar"
    measurement_size = 3
    labels = ("pan", "elevation", "vergence")
    units = ("rad", "rad", "rad")
    calib_labels = ("I",)
    calib_units = ("m",)

    interocular: float = param(
        0.18, unit="m", lo=0.001, hi=10.0, soft=(0.05, 0.5), label="Interocular distance"
    )
    """Distance I between the two cameras."""
    sd_pan: float = param(0.002, unit="rad", lo=1e-6, hi=1.0, soft=(0.0005, 0.05), label="Pan sd")
    """Standard deviation of a measured pan angle."""
    sd_elevation: float = param(
        0.01, unit="rad", lo=1e-6, hi=1.0, soft=(0.0005, 0.05), label="Elevation sd"
    )
    """Standard deviation of a measured elevation."""
    sd_vergence: float = param(
        0.002, unit="rad", lo=1e-6, hi=1.0, soft=(0.0005, 0.05), label="Vergence sd"
    )
    """Standard deviation of a measured vergence."""
    pan_max: float = param(np.pi / 2, unit="rad", lo=0.01, hi=np.pi, soft=(0.1, 3.1))
    """The head turns this far to either side."""
    elevation_max: float = param(
        math.radians(40.0), unit="rad", lo=0.01, hi=np.pi / 2, soft=(0.1, 1.5)
    )
    """The head tilts this far up and down."""
    vergence_max: float = param(np.pi / 4, unit="rad", lo=0.01, hi=1.5, soft=(0.1, 1.5))
    """Each camera turns inwards this far: nearer points can not be fixated."""
    reach_max: float = param(
        10.0, unit="m", lo=0.1, hi=1e4, soft=(2.0, 50.0), label="Initial distance, max"
    )
    """No feature is started farther away: its vergence says too little."""
    max_scale: float = param(1.4, lo=0.0, hi=100.0, soft=(0.0, 5.0), label="Scale change, max")
    """A feature is not measured from farther, or nearer, than this many times the distance of its
    first view. 0: no limit."""
    max_angle: float = param(
        np.pi / 4, unit="rad", lo=0.0, hi=np.pi, soft=(0.0, 1.6), label="View change, max"
    )
    """A feature is not measured from a direction that differs more than this from that of its
    first view. 0: no limit."""

    @property
    def limits(self) -> tuple[tuple[float, float], ...]:
        far = math.atan2(0.5 * self.interocular, self.reach_max)
        return (
            (-self.pan_max, self.pan_max),
            (-self.elevation_max, self.elevation_max),
            (far, self.vergence_max),
        )

    @property
    def calib0(self) -> Vec:
        return np.array([self.interocular])

    def project(self, X: Vec, k: Vec) -> Projection:
        m, w = X[..., :3], X[..., 3]
        length = np.maximum(np.sqrt(np.vecdot(m, m)), 1e-12)
        turn = angles(m, SCENE)
        half = 0.5 * k[0] * w
        h = np.empty(m.shape)
        h[..., :2], h[..., 2] = turn.value, np.arctan2(half, length)
        dh_by_dX, dh_by_dk = np.zeros((*m.shape, 4)), np.zeros((*m.shape, 1))
        dh_by_dX[..., :2, :3] = turn.by_m
        # d atan2(a, b) = (b da - a db) / (a^2 + b^2)
        square = half**2 + length**2
        dh_by_dX[..., 2, :3] = -(half / (square * length))[..., None] * m
        dh_by_dX[..., 2, 3] = 0.5 * k[0] * length / square
        dh_by_dk[..., 2, 0] = 0.5 * w * length / square
        return Projection(h, dh_by_dX, dh_by_dk)

    def backproject(self, z: Vec, n: Vec, k: Vec) -> Backprojection:
        """X = (direction(pan, elevation), 2 tan(vergence) / I).

        A vergence below that of `reach_max` is raised to it and keeps its spread.
        """
        ray = direction(z[..., 0], z[..., 1], SCENE)
        t = np.maximum(np.tan(z[..., 2]), 0.5 * k[0] / self.reach_max)
        X = np.concatenate([ray.m, (2.0 * t / k[0])[..., None]], axis=-1)
        dX_by_dz, dX_by_dk = np.zeros((*X.shape, 3)), np.zeros((*X.shape, 1))
        dX_by_dz[..., :3, :2] = ray.by_angles
        dX_by_dz[..., 3, 2] = 2.0 * (1.0 + t**2) / k[0]
        dX_by_dk[..., 3, 0] = -X[..., 3] / k[0]
        return Backprojection(X, dX_by_dz, np.zeros((*X.shape, 0)), dX_by_dk)

    def R(self, h: Vec) -> Mat:
        return np.broadcast_to(self._R, (*h.shape[:-1], 3, 3))

    @property
    def _R(self) -> Mat:
        return np.diag([self.sd_pan**2, self.sd_elevation**2, self.sd_vergence**2])

    def nu(self, h: Vec, z: Vec) -> Innovation:
        return Innovation(wrap(z - h), -np.eye(3), np.eye(3))

    def visibility(self, h: Vec, X: Vec, xws: Vec, pose0: Vec, y_X: Vec) -> np.ndarray:
        """OUTSIDE what the head can turn to, SCALE and ANGLE against the first view."""
        most = (self.pan_max, self.elevation_max, self.vergence_max)
        outside = (np.abs(h) > most).any(-1) * int(Fault.OUTSIDE)
        return outside | first_view.faults(xws, pose0, y_X, self.max_scale, self.max_angle)

    def selection_score(self, E: Mat) -> Vec:
        """Volume 4/3 pi sqrt(det S) of the region to search, S = E + R (R is the same everywhere).

        Source: Davison, Scene library.
        """
        return 4.0 / 3.0 * np.pi * np.sqrt(np.maximum(np.linalg.det(E + self._R), 0.0))
