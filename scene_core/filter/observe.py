"""The observation chain, written once for every landmark and every sensor.

y -> X_W = primitive(y) -> X_S = to_local(xws) -> h = project(X_S, k),  xws = xp(xv) * x_RS.
The chain rule gives dh/dy, dh/dxv, dh/dx_RS and dh/dk; only blocks that are in the state enter H.
All features of one model go through in one call. For segments h is the normal of the plane through
the line and the sensor (`scene_core.models.segments`).

Source: Davison, Scene, sections 4 and 5.2; Solà, toolbox manual, section 5.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.gaussian import Rows
from scene_core.filter.groups import Group, groups, states
from scene_core.filter.world import Gaussian, Mount, World
from scene_core.geometry.embedding import embed
from scene_core.models import segments
from scene_core.models.base import completed

__all__ = ["Group", "Observed", "Residual", "SensorState", "groups", "observe", "sensor_state"]


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
class Observed:
    """Output of the chain for one group."""

    group: Group
    h: Vec
    H_shared: Mat
    H_own: Mat
    X_W: Vec
    X_S: Vec


@dataclass(frozen=True)
class Residual:
    """What measurements say against what was expected, ready for an update."""

    nu: Vec
    """(N, m)"""
    rows: Rows
    """-d nu / dx"""
    R: Mat
    """Covariance of nu from the measurement's noise (N, m, m)."""


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
        xp, dxp3_by_dxp = embed(xp, robot.motion.space, world.up, space)
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


def observe(sensor_at: SensorState, group: Group, x: Vec) -> Observed:
    """h, its Jacobians and the points on the way, for all features of a complete group."""
    y, dy_by_dx = states(group, x)
    X_W, dXW_by_dy = completed(group.model.primitive(y), group.model.primitive, y)
    assert dXW_by_dy is not None
    return see(sensor_at, group, X_W, dXW_by_dy if dy_by_dx is None else dXW_by_dy @ dy_by_dx)


def see(sensor_at: SensorState, group: Group, X_W: Vec, dXW_by_dx: Mat) -> Observed:
    """The sensor's half of the chain, for points or segments X_W with their Jacobians by the
    group's columns."""
    sensor, k = sensor_at.mount.sensor, sensor_at.k
    if group.model.shape == "segment":
        X_S, dXS_by_dxws, dXS_by_dXW = segments.to_local(sensor.space, sensor_at.xws, X_W)
        h, dh_by_dXS = segments.normal(X_S)
        dh_by_dk = None
    else:
        X_S, dXS_by_dxws, dXS_by_dXW = sensor.space.to_local(sensor_at.xws, X_W)
        h, dh_by_dXS, dh_by_dk = completed(sensor.project(X_S, k), sensor.project, X_S, k)
        assert dh_by_dXS is not None
    H_shared = (dh_by_dXS @ dXS_by_dxws) @ sensor_at.dxws_by_dx
    if sensor_at.calib_columns is not None and dh_by_dk is not None:
        H_shared[..., sensor_at.calib_columns] = dh_by_dk
    H_own = (dh_by_dXS @ dXS_by_dXW) @ dXW_by_dx
    return Observed(group, h, H_shared, H_own, X_W, X_S)


def residual(sensor_at: SensorState, seen: Observed, z: Vec, R: Mat | None = None) -> Residual:
    """nu of measurements z (N, mz), one for each feature of the group, with -dnu/dx.

    R (N, mz, mz): the measurements' own covariance; None: the sensor's.
    """
    sensor, columns = sensor_at.mount.sensor, sensor_at.columns
    if seen.group.model.shape != "segment":
        own = sensor.R(seen.h) if R is None else R
        return Residual(sensor.nu(seen.h, z).nu, rows(sensor_at, seen), own)
    nu, by_n, by_z, by_k = segments.end_distances(sensor, seen.h, z, sensor_at.k)
    H_shared = -by_n @ seen.H_shared
    if sensor_at.calib_columns is not None:
        H_shared[..., sensor_at.calib_columns] -= by_k
    noise = segments.noise(sensor, z) if R is None else R
    parts = Rows(columns, H_shared, seen.group.columns, -by_n @ seen.H_own)
    return Residual(nu, parts, by_z @ noise @ np.swapaxes(by_z, -1, -2))


def rows(sensor_at: SensorState, seen: Observed) -> Rows:
    """The group's Jacobian as block-sparse rows."""
    return Rows(sensor_at.columns, seen.H_shared, seen.group.columns, seen.H_own)


def innovation_covariance(P: Mat, parts: Rows) -> Mat:
    """E = H P H' (N, m, m) of every feature on its own."""
    sc, fc = parts.shared, parts.own
    Hs, Hf = parts.H_shared, parts.H_own
    assert fc is not None and Hf is not None
    P_s = P[sc]
    P_ss = P_s[:, sc]
    P_sf = P_s[:, fc].transpose(1, 0, 2)
    P_ff = P[fc[:, :, None], fc[:, None, :]]
    Hft = Hf.transpose(0, 2, 1)
    cross = (Hs @ P_sf) @ Hft
    E = (Hs @ P_ss) @ Hs.transpose(0, 2, 1) + cross + cross.transpose(0, 2, 1) + (Hf @ P_ff) @ Hft
    return 0.5 * (E + E.transpose(0, 2, 1))


def roles(at: SensorState, seen: Observed, gauss: Gaussian) -> Mapping[str, Mat]:
    """H by block name, and the features' own part as "feature"."""
    out, start = {}, 0
    for role in at.roles:
        size = gauss.layout[role].size
        out[role] = seen.H_shared[..., start : start + size]
        start += size
    return out | {"feature": seen.H_own}
