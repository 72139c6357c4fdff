"""What cameras that also measure depth share: the point at a depth along a pixel's ray."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Vec
from scene_core.models.base import Backprojection


def at_inverse_depth(ray: Backprojection, s: Vec) -> Backprojection:
    """X = (m, s m_z): the ray's unit vector m ended at depth 1 / s along the optical axis, with
    s (..., 1) [1/m].

    dX_by_dn is the Jacobian by s; those by z and k are at constant s.
    """
    assert ray.dX_by_dz is not None and ray.dX_by_dk is not None
    X, by_z, by_k = (np.array(part) for part in (ray.X, ray.dX_by_dz, ray.dX_by_dk))
    X[..., 3:] = s * X[..., 2:3]
    by_z[..., 3, :] = s * by_z[..., 2, :]
    by_k[..., 3, :] = s * by_k[..., 2, :]
    by_s = np.zeros((*X.shape, 1))
    by_s[..., 3, 0] = X[..., 2]
    return Backprojection(X, by_z, by_s, by_k)
