"""The observation chain, written once for every landmark and every sensor.

y -> X_W = primitive(y) -> X_S = to_local(xws) -> h = project(X_S, k),  xws = xp(xv) * x_RS.
The chain rule gives dh/dy, dh/dxv, dh/dx_RS and dh/dk; only blocks that are in the state enter H.
All features of one model go through in one call.

Source: Davison, Scene, sections 4 and 5.2; Solà, toolbox manual, section 5.1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.gaussian import Rows
from scene_core.filter.records import Predictions
from scene_core.filter.world import Gaussian, Label, Mount, World
from scene_core.geometry.spaces import embed
from scene_core.models.base import FeatureModel, Sensor, completed


@dataclass(frozen=True)
class SensorState:
    """Where a sensor is in the world, and how that depends on the state."""

    mount: Mount
    xws: Vec
    """Pose of the sensor in the world (n,)."""
    k: Vec
    """Calibration in force."""
    roles: tuple[str, ...]
    """Blocks of the state the measurement depends on, besides the features."""
    columns: np.ndarray
    """State indices of those blocks (ns,)."""
    dxws_by_dx: Mat
    """(n, ns), zero in the calibration columns."""
    calib_columns: slice | None
    """Where the calibration stands within `columns`."""


@dataclass(frozen=True)
class Group:
    """Features of one model, ready to go through the chain together."""

    model: FeatureModel
    labels: tuple[Label, ...]
    columns: np.ndarray
    """State indices (N, s)."""
    pose0: Vec
    """(N, n)"""


@dataclass(frozen=True)
class Observed:
    """Output of the chain for one group."""

    group: Group
    h: Vec
    H_shared: Mat
    H_own: Mat
    X_W: Vec
    X_S: Vec


def sensor_state(world: World, mount_id: str, gauss: Gaussian | None = None) -> SensorState:
    """Pose and calibration of a mount, with the Jacobian of its pose by the state."""
    g = gauss or world.gauss
    mount = world.mounts[mount_id]
    robot = world.robots[mount.robot]
    space = mount.sensor.space
    xv = g.mean(robot.block)
    xp, dxp_by_dxv = completed(
        robot.motion.xp(xv, mount.hook), lambda v: robot.motion.xp(v, mount.hook), xv
    )
    assert dxp_by_dxv is not None
    if robot.motion.space is not space:
        xp, dxp3_by_dxp = embed(xp, robot.motion.space, world.up)
        dxp_by_dxv = dxp3_by_dxp @ dxp_by_dxv
    in_state = mount.pose_block in g.layout
    pose = g.mean(mount.pose_block) if in_state else mount.pose
    xws, by_xp, by_pose = space.compose(xp, pose)
    roles, jacobians = [robot.block], [by_xp @ dxp_by_dxv]
    if in_state:
        roles.append(mount.pose_block)
        jacobians.append(by_pose)
    calib_columns = None
    k = mount.sensor.calib0
    if mount.calib_block in g.layout:
        k = g.mean(mount.calib_block)
        at = sum(J.shape[1] for J in jacobians)
        calib_columns = slice(at, at + k.size)
        roles.append(mount.calib_block)
        jacobians.append(np.zeros((space.n, k.size)))
    columns = np.concatenate([g.layout[r].indices for r in roles])
    return SensorState(
        mount, xws, k, tuple(roles), columns, np.concatenate(jacobians, axis=1), calib_columns
    )


def groups(world: World, labels: Sequence[Label] | None = None) -> list[Group]:
    """Features by model, in the order of their labels."""
    by_model: dict[FeatureModel, list[Label]] = {}
    features, layout = world.features, world.gauss.layout.by_name
    for label in features if labels is None else labels:
        by_model.setdefault(features[label].model, []).append(label)
    out = []
    for model, members in by_model.items():
        starts = np.array([layout[features[label].block].start for label in members])
        columns = starts[:, None] + np.arange(model.state_size)
        pose0 = np.array([features[label].pose0 for label in members])
        out.append(Group(model, tuple(members), columns, pose0))
    return out


def observe(sensor_at: SensorState, group: Group, x: Vec) -> Observed:
    """h, its Jacobians and the points on the way, for all features of a group."""
    sensor, model, k = sensor_at.mount.sensor, group.model, sensor_at.k
    y = x[group.columns]
    X_W, dXW_by_dy = completed(model.primitive(y), model.primitive, y)
    X_S, dXS_by_dxws, dXS_by_dXW = sensor.space.to_local(sensor_at.xws, X_W)
    h, dh_by_dXS, dh_by_dk = completed(sensor.project(X_S, k), sensor.project, X_S, k)
    assert dXW_by_dy is not None and dh_by_dXS is not None
    H_shared = (dh_by_dXS @ dXS_by_dxws) @ sensor_at.dxws_by_dx
    if sensor_at.calib_columns is not None:
        H_shared[..., sensor_at.calib_columns] = dh_by_dk
    H_own = (dh_by_dXS @ dXS_by_dXW) @ dXW_by_dy
    return Observed(group, h, H_shared, H_own, X_W, X_S)


def rows(sensor_at: SensorState, seen: Observed) -> Rows:
    """The group's Jacobian as block-sparse rows."""
    return Rows(sensor_at.columns, seen.H_shared, seen.group.columns, seen.H_own)


def innovation_covariance(P: Mat, sensor_at: SensorState, seen: Observed) -> Mat:
    """E = H P H' (N, m, m) of every feature on its own."""
    sc, fc = sensor_at.columns, seen.group.columns
    Hs, Hf = seen.H_shared, seen.H_own
    P_s = P[sc]
    P_ss = P_s[:, sc]
    P_sf = P_s[:, fc].transpose(1, 0, 2)
    P_ff = P[fc[:, :, None], fc[:, None, :]]
    Hft = Hf.transpose(0, 2, 1)
    cross = (Hs @ P_sf) @ Hft
    E = (Hs @ P_ss) @ Hs.transpose(0, 2, 1) + cross + cross.transpose(0, 2, 1) + (Hf @ P_ff) @ Hft
    return 0.5 * (E + E.transpose(0, 2, 1))


def predictions(world: World, mount_id: str) -> tuple[Predictions, ...]:
    """What a mount expects to see of every feature in the map, one record per model."""
    at = sensor_state(world, mount_id)
    sensor, x, P = at.mount.sensor, world.gauss.x, world.gauss.P
    how = world.policies.selection.score
    out = []
    for group in groups(world):
        seen = observe(at, group, x)
        E = innovation_covariance(P, at, seen)
        fault = sensor.visibility(seen.h, seen.X_S, at.xws, group.pose0, seen.X_W)
        out.append(
            Predictions(
                mount=mount_id,
                model=group.model.name,
                labels=group.labels,
                h=seen.h,
                H=roles(at, seen, world.gauss),
                E=E,
                R=sensor.R(seen.h),
                fault=fault,
                score=score(sensor, how, E),
                selected=np.zeros(len(group.labels), dtype=bool),
            )
        )
    return tuple(out)


def roles(at: SensorState, seen: Observed, gauss: Gaussian) -> Mapping[str, Mat]:
    """H by block name, and the features' own part as "feature"."""
    out, start = {}, 0
    for role in at.roles:
        size = gauss.layout[role].size
        out[role] = seen.H_shared[..., start : start + size]
        start += size
    return out | {"feature": seen.H_own}


def score(sensor: Sensor, how: str, E: Mat) -> Vec:
    """Selection score of every feature: the sensor's own (trace), or the determinant of E."""
    return np.linalg.det(E) if how == "determinant" else sensor.selection_score(E)


def with_selected(preds: Sequence[Predictions], chosen: Sequence[Label]) -> tuple[Predictions, ...]:
    """The same predictions with the selection marked."""
    wanted = set(chosen)
    return tuple(
        replace(p, selected=np.array([label in wanted for label in p.labels], dtype=bool))
        for p in preds
    )


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
            X_W = group.model.primitive(world.gauss.x[group.columns[chosen]]).X
            z0 = np.array([features[i].z0 for i in chosen])
            first = world.mounts[mount].sensor
            k0 = world.mount_calib(mount)
            index = [place[group.labels[i]] for i in chosen]
            out[index] = _affine(at, first, k0, z0, group.pose0[chosen], X_W, step)
    return out


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
