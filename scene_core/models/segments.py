"""How a sensor of directions sees straight lines, written once for all of them.

The two points of a line, X_S = (m1, w1, m2, w2) in the sensor's frame, and the sensor's centre span
the plane with the unit normal n = m1 x m2 / |m1 x m2|; that is what is predicted, h = n, whatever
the lens does to straight lines. What is measured are the ends of a segment, z = (z1, z2); with
their unit rays r(z) the innovation is

    nu = (n . r(z1), n . r(z2)) [rad],

the distances of the two measured ends from the line on the unit sphere, so that an end may slide
along its line. With calibration k in the state both n and r depend on the state.

Source: Solà, *An EKF-SLAM toolbox in Matlab*, line landmarks and the innovation "ortDst" (there in
the plane of an ideal pinhole); Solà et al., IJCV 2012.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import Moved, Space
from scene_core.models.base import Backprojection, Sensor, completed
from scene_core.models.plucker import cross_matrix

LABELS = ("nx", "ny", "nz")
"""What is predicted of a line."""
NU_LABELS = ("first end", "second end")
"""What the innovation of a line measures, in radians."""


class Normal(NamedTuple):
    """Unit normal n (..., 3) of the plane through the sensor and a line, and dn/dX (..., 3, 8)."""

    n: Vec
    by_X: Mat


class EndDistances(NamedTuple):
    """nu (..., 2) with Jacobians by the normal, by z (..., 4) and by the calibration."""

    nu: Vec
    by_n: Mat
    by_z: Mat
    by_k: Mat


def seen_by(sensor: Sensor) -> str | None:
    """Why a sensor can not measure segments; None when it can."""
    if sensor.space.d == 3 and sensor.measurement_size == 2 and sensor.unmeasured == ("rho",):
        return None
    return (
        f"'{sensor.name}' can not measure lines: only sensors of a direction in space can, like "
        "cameras"
    )


def to_local(space: Space, xp: Vec, X: Vec) -> tuple[Vec, Mat, Mat]:
    """Both points of segments X (..., 8) seen from xp, with Jacobians by xp and by X."""
    return _moved(space.to_local, xp, X)


def to_world(space: Space, xp: Vec, X: Vec) -> tuple[Vec, Mat, Mat]:
    """Both points of segments X (..., 8) seen from xp, in the frame in which xp is given."""
    return _moved(space.to_world, xp, X)


def _moved(move: Callable[[Vec, Vec], Moved], xp: Vec, X: Vec) -> tuple[Vec, Mat, Mat]:
    first, second = move(xp, X[..., :4]), move(xp, X[..., 4:])
    moved = np.concatenate([first.X, second.X], axis=-1)
    by_X = np.zeros((*first.by_X.shape[:-2], 8, 8))
    by_X[..., :4, :4], by_X[..., 4:, 4:] = first.by_X, second.by_X
    return moved, np.concatenate([first.by_xp, second.by_xp], axis=-2), by_X


def normal(X: Vec) -> Normal:
    """n of a line through X (..., 8) in the sensor's frame.

    dn = (I - n n') / |c| dc, c = m1 x m2. A line through the sensor's centre has no plane: its
    normal is finite and means nothing.
    """
    m1, m2 = X[..., :3], X[..., 4:7]
    c = np.cross(m1, m2)
    length = np.maximum(np.linalg.norm(c, axis=-1, keepdims=True), 1e-300)
    n = c / length
    project = (np.eye(3) - n[..., :, None] * n[..., None, :]) / length[..., None]
    by_X = np.zeros((*n.shape, 8))
    by_X[..., :3] = -project @ cross_matrix(m2)
    by_X[..., 4:7] = project @ cross_matrix(m1)
    return Normal(n, by_X)


def end_distances(sensor: Sensor, n: Vec, z: Vec, k: Vec) -> EndDistances:
    """nu of measured ends z (..., 4) against the planes with the normals n (..., 3)."""
    nu = np.empty((*z.shape[:-1], 2))
    by_n = np.empty((*nu.shape, 3))
    by_z = np.zeros((*nu.shape, 4))
    by_k = np.empty((*nu.shape, k.size))
    for i, at in enumerate((slice(0, 2), slice(2, 4))):
        ray = _rays(sensor, z[..., at], k)
        assert ray.dX_by_dz is not None and ray.dX_by_dk is not None
        nu[..., i] = np.vecdot(n, ray.X[..., :3])
        by_n[..., i, :] = ray.X[..., :3]
        row = n[..., None, :]
        by_z[..., i, at] = (row @ ray.dX_by_dz[..., :3, :])[..., 0, :]
        by_k[..., i, :] = (row @ ray.dX_by_dk[..., :3, :])[..., 0, :]
    return EndDistances(nu, by_n, by_z, by_k)


def backproject(sensor: Sensor, z: Vec, n: Vec, k: Vec) -> Backprojection:
    """X (..., 8) of the ends z (..., 4) at the open inverse distances n (..., 2), with Jacobians by
    all three."""
    X, by_z = np.empty((*z.shape[:-1], 8)), np.zeros((*z.shape[:-1], 8, 4))
    by_n, by_k = np.zeros((*z.shape[:-1], 8, 2)), np.empty((*z.shape[:-1], 8, k.size))
    for i in range(2):
        end, pixel = slice(4 * i, 4 * i + 4), slice(2 * i, 2 * i + 2)
        one = _rays(sensor, z[..., pixel], k, n[..., i : i + 1])
        X[..., end] = one.X
        by_z[..., end, pixel] = one.dX_by_dz
        by_n[..., end, i : i + 1] = one.dX_by_dn
        by_k[..., end, :] = one.dX_by_dk
    return Backprojection(X, by_z, by_n, by_k)


def noise(sensor: Sensor, z: Vec) -> Mat:
    """R (..., 4, 4) of both ends."""
    R = np.zeros((*z.shape, 4))
    R[..., :2, :2], R[..., 2:, 2:] = sensor.R(z[..., :2]), sensor.R(z[..., 2:])
    return R


def _rays(sensor: Sensor, z: Vec, k: Vec, n: Vec | None = None) -> Backprojection:
    if n is None:
        n = np.zeros((*z.shape[:-1], 1))
    return completed(sensor.backproject(z, n, k), sensor.backproject, z, n, k)
