"""A point kept as its coordinates, in one, two and three dimensions: y = m, X = (y, 1)."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry.spaces import Space
from scene_core.models.base import Initialised, Primitive, Redefined


def initialise(space: Space, xws: Vec, X: Vec) -> Initialised:
    """y = m / w of X = (m, w) moved to the world.

    Raises ValueError where w <= 0: the measurement does not say how far away the point is.
    """
    seen = space.to_world(xws, X)
    w = X[..., -1:]
    if not (w > 0.0).all():
        raise ValueError(
            f"a point at inverse distance {float(w.min()):g} 1/m has no place: it takes a sensor "
            "that measures distance, or a parametrisation with a prior for it"
        )
    y = seen.X[..., :-1] / w
    # d(m/w) = (dm - (m/w) dw) / w, with dw/dxws = 0.
    by_world = np.zeros((*y.shape, space.d + 1))
    by_world[..., : space.d] = np.eye(space.d)
    by_world[..., space.d] = -y
    by_world /= w[..., None]
    return Initialised(y, by_world @ seen.by_xp, by_world @ seen.by_X)


def primitive(space: Space, y: Vec) -> Primitive:
    """X = (y, 1)."""
    return Primitive(with_w(y, 1.0), np.eye(space.d + 1)[:, : space.d])


def redefine(space: Space, y: Vec, xpdef: Vec) -> Redefined:
    """y seen from xpdef."""
    seen = space.to_local(xpdef, primitive(space, y).X)
    d = space.d
    return Redefined(seen.X[..., :d], seen.by_X[..., :d, :d], seen.by_xp[..., :d, :])


def with_w(m: Vec, w: float) -> Vec:
    """X = (m, w) (..., d+1) of m (..., d): points for w = 1, directions for w = 0."""
    X = np.full((*m.shape[:-1], m.shape[-1] + 1), w)
    X[..., :-1] = m
    return X
