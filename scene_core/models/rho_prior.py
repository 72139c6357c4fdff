"""The inverse distance that a first view leaves open, told by a prior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import FeatureModel
from scene_core.params import param


@dataclass(frozen=True)
class RhoPrior(FeatureModel):
    """A landmark that may start from its direction alone: rho ~ N(rho_mean, rho_sd^2) [1/m], for
    both ends of a line independently.

    Two standard deviations of the defaults reach from 1 m to infinity, and beyond.

    Source: Montiel, Civera, Davison, *Unified Inverse Depth Parametrization for Monocular SLAM*,
    RSS 2006; the numbers: Solà, *An EKF-SLAM toolbox in Matlab*, `nonObsMean` and `nonObsStd`.
    """

    unmeasured = ("rho",)

    rho_mean: float = param(
        0.01, unit="1/m", lo=1e-6, hi=100.0, soft=(0.001, 2.0), effect="next feature", label="Prior"
    )
    """Inverse distance of a new feature."""
    rho_sd: float = param(
        0.5,
        unit="1/m",
        lo=1e-6,
        hi=100.0,
        soft=(0.01, 2.0),
        effect="next feature",
        label="Prior sd",
    )
    """Its standard deviation: two of them should reach the inverse of the nearest distance."""

    def prior(self) -> tuple[Vec, Mat]:
        n = 2 if self.shape == "segment" else 1
        return np.full(n, self.rho_mean), self.rho_sd**2 * np.eye(n)
