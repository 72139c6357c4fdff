"""A point seen from the whole pose of the sensor that saw it first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D, relative
from scene_core.models import equidistant
from scene_core.models.base import FeatureModel, Initialised, Normalised, Redefined
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.ray_point import RayPoint


@dataclass(frozen=True)
class FramedHomogeneous(RayPoint):
    """An anchor frame, a direction in it and an inverse distance: X = (rho t + R(q/|q|) m, rho)

    y = (x0, y0, z0, qw, qx, qy, qz, a, b, rho) [m, 1, rad, 1/m]; t = (x0, y0, z0) and q are the
    pose of the sensor at the first view, (a, b) = theta (m_x, m_y) / |(m_x, m_y)| the angle theta
    from its z axis and where to: what the image says, with the image's own noise, and good beyond
    90 degrees. Nothing but copying happens when the feature starts, so nothing is linearised until
    it is seen again. A first view leaves rho to the prior N(rho_mean, rho_sd^2). Converted to a
    Euclidean point p = t + R m / rho once, seen from c,
    4 sigma_rho / rho^2 / |p - c| |cos(R m, p - c)| < linearity.

    Source: Ceriani, Marzorati, Matteucci, Migliore, Sorrenti, *On feature parameterization for
    EKF-based monocular SLAM*, IFAC 2011, "FHP", whose direction are ideal image coordinates;
    the toolbox lists it as "fhmPnt" and does not have it.
    """

    name = "framed homogeneous"
    space = THREE_D
    state_labels = ("x0", "y0", "z0", "qw", "qx", "qy", "qz", "a", "b", "rho")
    state_units = ("m", "m", "m", "", "", "", "", "rad", "rad", "1/m")

    def successor(self) -> FeatureModel:
        return EuclideanPoint()

    def direction(self, y: Vec) -> tuple[Vec, Mat]:
        """R(q/|q|) m (..., 3), and its Jacobian by (q, a, b) (..., 3, 6)."""
        q, dq = quaternion.normalise(y[..., 3:7])
        m, dm = equidistant.ray(y[..., 7:9])
        turned = quaternion.rotate(q, m)
        J = np.concatenate([turned.by_q @ dq, turned.by_v @ dm], axis=-1)
        return turned.v, J

    def coordinates(self, m: Vec) -> tuple[Vec, Mat]:
        """(a, b) (..., 2) of directions in the anchor's frame."""
        return equidistant.flat(m)

    def initialise(self, xws: Vec, X: Vec) -> Initialised:
        """y = (t, q, (a, b) of m, w / |m|) for the sensor pose (t, q) and X = (m, w)."""
        c, by_m = self.coordinates(X[..., :3])
        length = np.sqrt(np.vecdot(X[..., :3], X[..., :3]))
        y = np.empty((*X.shape[:-1], 10))
        y[..., :7], y[..., 7:9], y[..., 9] = xws, c, X[..., 3] / length
        by_xws = np.eye(10, 7)
        by_X = np.zeros((*y.shape, 4))
        by_X[..., 7:9, :3] = by_m
        by_X[..., 9, :3] = -(X[..., 3] / length**3)[..., None] * X[..., :3]
        by_X[..., 9, 3] = 1.0 / length
        return Initialised(y, by_xws, by_X)

    def redefine(self, y: Vec, xpdef: Vec) -> Redefined:
        """The anchor's pose seen from xpdef; what it sees is the same."""
        pose = relative(self.space, xpdef, y[..., :7])
        value = np.concatenate([pose.x, y[..., 7:]], axis=-1)
        by_state = np.zeros((*y.shape, 10))
        by_state[..., range(7, 10), range(7, 10)] = 1.0
        by_state[..., :7, :7] = pose.by_b
        by_xpdef = np.zeros((*y.shape, 7))
        by_xpdef[..., :7, :] = pose.by_a
        return Redefined(value, by_state, by_xpdef)

    def normalise(self, y: Vec) -> Normalised:
        """q / |q| with its projector, and a negative rho raised to rho_min."""
        q, dq = quaternion.normalise(y[..., 3:7])
        value = y.copy()
        value[..., 3:7], value[..., 9] = q, self.in_front(y[..., 9])
        J = np.zeros((*y.shape, 10))
        J[..., range(10), range(10)] = 1.0
        J[..., 3:7, 3:7] = dq
        return Normalised(value, J)
