"""How far a segment reaches along its line, which is kept outside the filter.

Source: Solà, *An EKF-SLAM toolbox in Matlab*, end points of lines beside the filter and their
extension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.birth import end_rays
from scene_core.filter.groups import Group, groups, moments
from scene_core.filter.observe import SensorState, sensor_state
from scene_core.filter.world import Label, World
from scene_core.geometry.numdiff import central_differences
from scene_core.models import plucker
from scene_core.models.base import FeatureModel

GRAZING = np.radians(10.0)
"""A ray that makes a smaller angle with the line says nothing about where it ends."""
KNOWN = 0.1
"""Part of a segment's length to which both ends of a known line are known."""


def extended(world: World, mount: str, labels: Sequence[Label], measured: Sequence[Vec]) -> World:
    """Segments made longer by ends that were measured beyond them.

    An end is where its ray comes nearest to the line. While the line itself is not yet known, its
    ends are those last measured: where the earlier ones are along it would be a mere guess.
    """
    found = {
        label: z
        for label, z in zip(labels, measured, strict=True)
        if world.features[label].extent is not None
    }
    if not found:
        return world
    at = sensor_state(world, mount)
    features = dict(world.features)
    for group in groups(world, list(found)):
        z = np.array([found[label] for label in group.labels])
        for label, (first, last) in zip(
            group.labels, _reach(group, world, at, z).tolist(), strict=True
        ):
            features[label] = replace(features[label], extent=(first, last))
    return replace(world, features=features)


def _reach(group: Group, world: World, at: SensorState, z: Vec) -> Vec:
    """The new extents (N, 2) of a group whose ends z (N, 4) were measured."""
    model, extents = group.model, group.extents
    assert extents is not None
    y, Pyy = moments(group, world.gauss.x, world.gauss.P)
    rays = end_rays(at, z)
    t = model.along(y, at.xws[:3], rays)
    v = plucker.join(model.ends(y, extents)).L[:, None, 3:]
    across = np.abs(np.vecdot(rays, v)) < np.cos(GRAZING) * np.linalg.norm(v, axis=-1)
    # What is not measured makes nothing longer.
    usable = np.isfinite(t) & across
    low, high = np.where(usable, t, np.inf), np.where(usable, t, -np.inf)
    longer = np.stack(
        [np.minimum(extents, low).min(axis=1), np.maximum(extents, high).max(axis=1)], axis=1
    )
    anew = np.where(np.all(np.isfinite(t), axis=1, keepdims=True), np.sort(t, axis=1), extents)
    return np.where(known(model, y, Pyy, extents)[:, None], longer, anew)


def known(model: FeatureModel, y: Vec, Pyy: Mat, extents: Vec) -> np.ndarray:
    """Whether both ends of each segment (N,) are known to a tenth of its length."""
    out = np.asarray(np.all(model.ends(y, extents)[:, [3, 7]] > 0.0, axis=1))
    rows = np.flatnonzero(out)

    def places(y: Vec) -> Vec:
        X = model.ends(y, extents[rows]).reshape(-1, 2, 4)
        return (X[..., :3] / X[..., 3:]).reshape(-1, 6)

    if rows.size:
        ends, J = places(y[rows]), central_differences(places, (y[rows],), 0)
        variance = np.vecdot(J @ Pyy[rows], J).reshape(-1, 2, 3).sum(axis=-1).max(axis=-1)
        length = np.linalg.norm(ends[:, 3:] - ends[:, :3], axis=-1)
        out[rows] = np.sqrt(variance) < KNOWN * length
    return out
