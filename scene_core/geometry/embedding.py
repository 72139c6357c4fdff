"""Poses of a line or a plane told in a space of more dimensions, and back."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D, Space, wrap

# fmt: off
_AXES: dict[tuple[str, str], Mat] = {
    ("1-D", "y"): np.array([[0.0], [0.0], [1.0]]),
    ("1-D", "z"): np.array([[1.0], [0.0], [0.0]]),
    ("2-D", "y"): np.array([[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]),
    ("2-D", "z"): np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]),
    ("3-D", "y"): np.eye(3),
    ("3-D", "z"): np.eye(3),
}
# fmt: on


def embed(xp: Vec, space: Space, up: str, into: Space = THREE_D) -> tuple[Vec, Mat]:
    """The position state (..., m) in `into`, which has more dimensions, of a pose in `space`, and
    its Jacobian (..., m, n). A pose on a line lies in the plane with x = phi = 0. In 3-D:

    up = "y" (Scene): the plane's z and x are the world's z and x, phi turns about y. up = "z" (the
    toolbox): the plane's z is the world's x, its x the world's y, phi turns about z. A line's z
    runs along the world's z, resp. x.
    """
    if space is into:
        return xp, np.eye(space.n)
    if into.d == 2:
        J = np.eye(into.n, space.n)
        return xp @ J.T, np.broadcast_to(J, (*xp.shape[:-1], *J.shape))
    axes = _AXES[space.name, up]
    out = np.zeros((*xp.shape[:-1], 7))
    J = np.zeros((*xp.shape[:-1], 7, space.n))
    out[..., :3] = xp[..., : space.d] @ axes.T
    out[..., 3] = 1.0
    J[..., :3, : space.d] = axes
    if space.d == 2:
        half = 0.5 * xp[..., 2]
        up_axis = 4 + "xyz".index(up)
        out[..., 3], out[..., up_axis] = np.cos(half), np.sin(half)
        J[..., 3, 2], J[..., up_axis, 2] = -0.5 * np.sin(half), 0.5 * np.cos(half)
    return out, J


def flatten(xp: Vec, space: Space, up: str) -> tuple[Vec, Mat]:
    """The position state (..., n) in `space` of a 3-D pose (..., 7) that lies in it, and its
    Jacobian (..., n, 7): the left inverse of `embed`."""
    if space.d == 3:
        return xp, np.eye(7)
    axes = _AXES[space.name, up]
    out, J = np.zeros((*xp.shape[:-1], space.n)), np.zeros((*xp.shape[:-1], space.n, 7))
    out[..., : space.d] = xp[..., :3] @ axes
    J[..., : space.d, :3] = axes.T
    if space.d == 2:
        up_axis = 4 + "xyz".index(up)
        c, s = xp[..., 3], xp[..., up_axis]
        out[..., 2] = wrap(2.0 * np.arctan2(s, c))
        length2 = c * c + s * s
        J[..., 2, 3], J[..., 2, up_axis] = -2.0 * s / length2, 2.0 * c / length2
    return out, J


def embed_points(points: Vec, space: Space, up: str) -> Vec:
    """Points (..., d) of `space` in 3-D world axes (..., 3), see `embed`."""
    return points @ _AXES[space.name, up].T


def embed_covariances(P: Mat, space: Space, up: str) -> Mat:
    """Covariances (..., d, d) of points of `space` in 3-D world axes (..., 3, 3)."""
    axes = _AXES[space.name, up]
    return axes @ P @ axes.T
