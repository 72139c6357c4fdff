"""A line as an anchor and two homogeneous points seen from there."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.models.features.anchored_homogeneous import AnchoredHomogeneous
from scene_core.models.point_pair import PointPair


@dataclass(frozen=True)
class AnchoredHomogeneousLine(PointPair):
    """An anchor, two unit vectors and their inverse distances:
    X = (rho1 x0 + v1, rho1, rho2 x0 + v2, rho2)

    y = (x0, y0, z0, v1x, v1y, v1z, rho1, v2x, v2y, v2z, rho2) [m, 1, 1/m]; after an update either
    (v, rho) is divided by |v|, see "anchored homogeneous". A first view leaves both rho to the
    prior N(rho_mean, rho_sd^2). Never converted. The ends are t = 0 and 1, X(t) = X1 + t (X2 - X1).

    Source: Solà, Vidal-Calleja, Civera, Montiel, *Impact of landmark parametrization on monocular
    EKF-SLAM with points and lines*, IJCV 2012, "AHPL"; the toolbox's landmark "ahmLin",
    which starts with the derivative of the second ray a row too high.
    """

    name = "anchored homogeneous line"
    state_labels = (
        *("x0", "y0", "z0"),
        *("v1x", "v1y", "v1z", "rho1"),
        *("v2x", "v2y", "v2z", "rho2"),
    )
    state_units = ("m", "m", "m", "", "", "", "1/m", "", "", "", "1/m")
    shared = 3

    @property
    def support(self) -> AnchoredHomogeneous:
        return AnchoredHomogeneous(rho_mean=self.rho_mean, rho_sd=self.rho_sd)
