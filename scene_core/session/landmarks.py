"""How far the mapped landmarks are from the true ones."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.ports import Truth
from scene_core.filter.world import World
from scene_core.geometry.spaces import Space, embed_points
from scene_core.session.alignment import Similarity


def landmark_errors(
    world: World, truth: Truth | None, space: Space, by: Similarity | None = None
) -> Vec:
    """Distances [m] of the features in their final parametrisation that have a true place.

    `by` brings the map into the axes of the truth, as it does the positions of a robot in `space`.
    Features given at the start are left out.
    """
    if truth is None or len(truth.points) == 0:
        return np.zeros(0)
    row = {int(identity): k for k, identity in enumerate(truth.ids)}
    d = truth.points.shape[1]
    errors = []
    for feature in world.features.values():
        k = row.get(feature.appearance) if isinstance(feature.appearance, int) else None
        if k is None or feature.known or feature.model.space.d != d:
            continue
        if feature.model.shape != "point" or feature.model.successor() is not None:
            continue
        X = feature.model.primitive(world.gauss.mean(feature.block)[None]).X[0]
        # A homogeneous point may still lie at infinity.
        if X[d] > 0.0:
            place = _aligned(X[:d] / X[d], space, world.up, by)
            errors.append(np.linalg.norm(place - truth.points[k]))
    return np.array(errors)


def _aligned(place: Vec, space: Space, up: str, by: Similarity | None) -> Vec:
    if by is None:
        return place
    if space.d == len(place):
        return by.points(place)
    # A plane's axes in the world: what lies in them moves, the rest stays.
    axes = embed_points(np.eye(space.d), space, up)
    return place + (by.points(place @ axes.T) - place @ axes.T) @ axes
