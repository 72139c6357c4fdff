"""How far the mapped landmarks are from the true ones."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.ports import Truth
from scene_core.filter.world import World
from scene_core.geometry.embedding import flatten
from scene_core.geometry.spaces import SPACES
from scene_core.session.axes import truth_axes


def landmark_errors(world: World, truth: Truth | None) -> Vec:
    """Distances [m] of the features in their final parametrisation that have a true place, in the
    order of the map, in the axes of the map; nothing is aligned. Features given at the start are
    left out.
    """
    if truth is None or len(truth.points) == 0:
        return np.zeros(0)
    places = _seen(world, truth.points)
    if places is None:
        return np.zeros(0)
    row = {int(identity): k for k, identity in enumerate(truth.ids)}
    d = truth.points.shape[1]
    errors = []
    for feature in world.features.values():
        k = row.get(feature.appearance) if isinstance(feature.appearance, int) else None
        model = feature.model
        if k is None or feature.known or model.space.d != d:
            continue
        if model.shape != "point" or model.successor() is not None:
            continue
        X = model.primitive(world.gauss.mean(feature.block)[None]).X[0]
        # A homogeneous point may still lie at infinity.
        if X[d] > 0.0:
            errors.append(np.linalg.norm(X[:d] / X[d] - places[k]))
    return np.array(errors)


def _seen(world: World, points: Vec) -> Vec | None:
    """True points (K, d) in the axes of the map; None when nobody knows where those truly are."""
    pose = truth_axes(world.axes, aligned=False)
    if pose is None:
        return points
    if not np.isfinite(pose).all():
        return None
    space = SPACES[points.shape[1]]
    X = np.concatenate([points, np.ones((len(points), 1))], axis=1)
    return space.to_local(flatten(pose, space, world.up)[0], X).X[:, :-1]
