"""A line as two homogeneous points of the world, without an anchor."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.models.features.homogeneous import HomogeneousPoint
from scene_core.models.point_pair import PointPair


@dataclass(frozen=True)
class HomogeneousLine(PointPair):
    """Two points of projective space: X = y = (h1, rho1, h2, rho2)

    y = (h1x, h1y, h1z, rho1, h2x, h2y, h2z, rho2) [1, 1/m], either as in "homogeneous point". A
    first view leaves both rho to the prior N(rho_mean, rho_sd^2). Never converted. The ends are
    t = 0 and 1, X(t) = X1 + t (X2 - X1).

    Over-confident, as "homogeneous point" says why: without an anchor the error of the place it was
    first seen from is forgotten. NEES 26 round the house (5 seeds, 400 frames; the toolbox 14), for
    6.9 of an "inverse depth line" and 7.0 of an "anchored homogeneous line"; 7.2 where updates
    carry the axes along (`Update.invariant`).

    Source: Solà, Vidal-Calleja, Civera, Montiel, *Impact of landmark parametrization on monocular
    EKF-SLAM with points and lines*, IJCV 2012, "HPL"; the toolbox's landmark "hmgLin".
    """

    name = "homogeneous line"
    state_labels = ("h1x", "h1y", "h1z", "rho1", "h2x", "h2y", "h2z", "rho2")
    state_units = ("", "", "", "1/m", "", "", "", "1/m")
    shared = 0

    @property
    def support(self) -> HomogeneousPoint:
        return HomogeneousPoint(rho_mean=self.rho_mean, rho_sd=self.rho_sd)
