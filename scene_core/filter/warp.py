"""How a patch seen at first looks from here: the local affine map between two views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.groups import Group, groups, states
from scene_core.filter.observe import SensorState
from scene_core.filter.world import Label, World
from scene_core.models.base import Sensor


def warps(world: World, at: SensorState, labels: Sequence[Label], step: float = 1.0) -> Mat:
    """Local affine map (N, m, m) from each feature's first view to this one.

    A surface element facing the first view is assumed: the pixels z0 and z0 + step along each axis
    are put on the plane through the feature perpendicular to its first ray, and projected here.
    """
    m = at.mount.sensor.measurement_size
    out = np.empty((len(labels), m, m))
    place = {label: i for i, label in enumerate(labels)}
    for group in groups(world, labels):
        features = [world.features[label] for label in group.labels]
        for mount in {f.mount for f in features}:
            chosen = [i for i, f in enumerate(features) if f.mount == mount]
            X_W = points(group.rows(chosen), world.gauss.x)
            z0 = np.array([features[i].z0 for i in chosen])
            first = world.mounts[mount].sensor
            k0 = world.mount_calib(mount)
            index = [place[group.labels[i]] for i in chosen]
            out[index] = _affine(at, first, k0, z0, group.pose0[chosen], X_W, step)
    return out


def points(group: Group, x: Vec) -> Vec:
    """Homogeneous points (N, d+1) of a group; of partial features at their particles' mean."""
    y, _ = states(group, x)
    if not group.partial:
        return group.model.primitive(y).X
    lam = np.array([group.model.moments(p)[0] for p in group.particles])
    return group.model.point(y, lam).X


def _affine(
    at: SensorState, first: Sensor, k0: Vec, z0: Vec, pose0: Vec, X_W: Vec, step: float
) -> Mat:
    space, m = first.space, first.measurement_size
    d = space.d
    X_0 = space.to_local(pose0, X_W).X
    axis, w = X_0[:, :d], X_0[:, d:]
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    unit = axis / length
    # All shifted pixels in one batch: (2 m, N) flattened, + and - half a step along each axis.
    shifts = 0.5 * step * np.concatenate([np.eye(m), -np.eye(m)])
    z = (z0 + shifts[:, None]).reshape(-1, m)
    ray = first.backproject(z, np.zeros((len(z), len(first.unmeasured))), k0).X[:, :d]
    unit, length, w, pose = (np.tile(part, (2 * m, 1)) for part in (unit, length, w, pose0))
    facing = np.sum(ray * unit, axis=1, keepdims=True)
    on_plane = np.concatenate([ray * (length / facing), w], axis=1)
    X_S = space.to_local(at.xws, space.to_world(pose, on_plane).X).X
    h = at.mount.sensor.project(X_S, at.k).h.reshape(2, m, -1, m)
    return ((h[0] - h[1]) / step).transpose(1, 2, 0)
