"""A line on two rays from one place, kept so that a single view of it is enough."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.point_pair import PointPair
from scene_core.params import param


@dataclass(frozen=True)
class InverseDepthLine(PointPair):
    """An anchor and two inverse-depth points: X = (rho1 x0 + m1, rho1, rho2 x0 + m2, rho2)

    y = (x0, y0, z0, pitch1, yaw1, rho1, pitch2, yaw2, rho2) [m, rad, 1/m], m = m(pitch, yaw) the
    unit rays through the ends of the segment that was seen first; see "inverse depth". A first view
    leaves both rho to the prior N(rho_mean, rho_sd^2). Never converted. The ends are t = 0 and 1,
    X(t) = X1 + t (X2 - X1): evenly spaced as seen from the anchor, regular for points at infinity.

    Source: Solà, Vidal-Calleja, Civera, Montiel, *Impact of landmark parametrization on monocular
    EKF-SLAM with points and lines*, IJCV 2012, "IDL"; the toolbox's landmark "idpLin".
    """

    name = "inverse depth line"
    state_labels = ("x0", "y0", "z0", "pitch1", "yaw1", "rho1", "pitch2", "yaw2", "rho2")
    state_units = ("m", "m", "m", "rad", "rad", "1/m", "rad", "rad", "1/m")
    shared = 3

    pole: Literal["z", "y"] = param("z", choices=("z", "y"), effect="on reset", label="Pole")
    """World axis the pitch is measured towards: the vertical, so that level rays are regular."""

    @property
    def support(self) -> InverseDepth:
        return InverseDepth(rho_mean=self.rho_mean, rho_sd=self.rho_sd, pole=self.pole)
