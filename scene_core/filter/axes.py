"""Redefinition of axes for the whole map: everything is told from where a robot is now.

With xp the position state of the robot that defines the new axes, every block goes its own way,

    y' = redefine(y, xp(xv)),   dy' = (dy'/dy) dy + (dy'/dxp)(dxp/dxv) dxv,

and all of them together are one linear map of the state: x' = g(x), P' = J P J'. J has the blocks'
own Jacobians on its diagonal and one more column of blocks, that of the defining robot, whose own
pose becomes the identity with no uncertainty. Sensor poses and calibrations do not depend on the
axes. What a sensor will see stays as it was: h, H P H' and S.

Source: Davison, *Models and State Representation in Scene*, section 4 and `func_xvredef`;
Castellanos, Martinez-Cantin, Tardós, Neira, *Robocentric map joining*, RAS 2007.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.fixed import EXACT, TOLD, deviation, not_flat
from scene_core.filter.groups import Group, groups
from scene_core.filter.world import Axes, Feature, Gaussian, Label, Robot, World
from scene_core.geometry.embedding import embed, flatten
from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import THREE_D, Space, relative
from scene_core.models.base import FeatureModel, completed
from scene_core.params import ParamError

AT_ONCE = 64
"""Blocks that are multiplied together: no temporary is as large as P."""
NOTHING = 1e-12
"""Elements of the defining robot's Jacobian that are zero but for rounding."""


@dataclass(frozen=True)
class Definition:
    """Where the new axes are: the position state of a robot's base, and what it depends on."""

    robot: Robot
    xp: Vec
    dxp_by_dxv: Mat
    P: Mat
    """Covariance of xv."""
    up: str

    @cached_property
    def pose(self) -> Vec:
        """(7,)"""
        return self.seen_in(THREE_D)[0]

    @cached_property
    def pose_cov(self) -> Mat:
        """(7, 7)"""
        J = self.seen_in(THREE_D)[1]
        return J @ self.P @ J.T

    def seen_in(self, space: Space) -> tuple[Vec, Mat]:
        """xpdef (n,) as a position state of `space`, and its Jacobian by xv."""
        if space is self.robot.motion.space:
            return self.xp, self.dxp_by_dxv
        xp, by_xp = embed(self.xp, self.robot.motion.space, self.up)
        flat, by_pose = flatten(xp, space, self.up)
        return flat, by_pose @ by_xp @ self.dxp_by_dxv


@dataclass(frozen=True)
class Change:
    """Blocks of one kind in the new axes."""

    columns: np.ndarray
    """State indices (N, s)."""
    value: Vec
    """(N, s)"""
    by_own: Mat
    """(N, s, s)"""
    by_definer: Mat
    """(N, s, size of the defining robot's block)"""


def definition(world: World, robot: str) -> Definition:
    """The position state of a robot's base. Raises ParamError when there is no such robot."""
    if robot not in world.robots:
        raise ParamError(f"no robot '{robot}': choose one of {', '.join(world.robots)}")
    r = world.robots[robot]
    xv = world.gauss.mean(r.block)
    xp, dxp_by_dxv = completed(r.motion.xp(xv), r.motion.xp, xv)
    assert dxp_by_dxv is not None
    return Definition(r, xp, dxp_by_dxv, world.gauss.cov(r.block), world.up)


def redefine(world: World, robot: str) -> World:
    """The world in axes whose origin is where `robot` is now.

    Raises ParamError, naming the model, where a direction of the world that a model relies on would
    change, or where a robot or landmark would leave its plane or line.
    """
    at = definition(world, robot)
    reason = refusal(world, at)
    if reason:
        raise ParamError(f"the axes can not be put at robot '{robot}': {reason}")
    gauss, parts = world.gauss, changes(world, at)
    x = gauss.x.copy()
    for part in parts:
        x[part.columns] = part.value
    definer = gauss.layout[at.robot.block].slice
    P = times(parts, times(parts, gauss.P, definer).T, definer)
    features = dict(world.features)
    for group in groups(world):
        features |= _told(world, group, at)
    return replace(
        world,
        gauss=Gaussian(frozen(x), frozen(0.5 * (P + P.T)), gauss.layout),
        features=features,
        axes=_axes(world, at),
    )


def refusal(world: World, at: Definition) -> str:
    """Which model would not go on in the new axes as in the old, and why; empty: none."""
    for name, robot in world.robots.items():
        where = f"the motion model '{robot.motion.name}' of robot '{name}'"
        for word in robot.motion.world_fixed:
            if change := deviation(word, at.pose, at.pose_cov, at.up):
                return f"{where} relies on {word}, and {change}"
        if change := not_flat(robot.motion.space, at.pose, at.pose_cov, at.up):
            return f"{where} is for {robot.motion.space.name}, and {change}"
    for name, one in world.instruments.items():
        for word in one.model.world_fixed:
            if change := deviation(word, at.pose, at.pose_cov, at.up):
                return f"the instrument '{one.model.name}' ({name}) relies on {word}, and {change}"
    for group in groups(world):
        space = group.model.space
        if change := not_flat(space, at.pose, at.pose_cov, at.up):
            return f"the landmarks '{group.model.name}' are for {space.name}, and {change}"
        if change := _doubtful(group, at):
            return change
    return ""


def _doubtful(group: Group, at: Definition) -> str:
    """How uncertain the particles of open features would become; empty: not at all.

    All particles of a feature would be wrong by one error, that of the defining robot's pose, and
    nothing keeps how particles and the state are correlated: what a sensor will see would change.
    """
    model = group.model
    if not group.partial or type(model).redefine_free is FeatureModel.redefine_free:
        return ""
    xpdef, by_xv = at.seen_in(model.space)
    P = by_xv @ at.P @ by_xv.T
    for label, cloud in zip(group.labels, group.particles, strict=True):
        J = central_differences(model.redefine_free, (cloud.lam, xpdef), 1)
        variances = np.diagonal(J @ P @ np.swapaxes(J, -1, -2), axis1=-2, axis2=-1)
        # The median: a particle at the seam of a circle seems to move by a whole turn.
        sds = np.sqrt(np.maximum(np.median(variances, axis=0), 0.0))
        for what, unit, sd in zip(model.free_labels, model.free_units, sds, strict=True):
            if sd > EXACT:
                value = f"{np.degrees(sd):.2g} deg" if unit == "rad" else f"{sd:.2g} {unit}"
                return (
                    f"the particles of the landmark {label} ('{model.name}') carry its {what} in "
                    f"the axes, and the new ones are known only to {value}: wait until it has "
                    "settled, or delete it"
                )
    return ""


def changes(world: World, at: Definition) -> list[Change]:
    """All blocks that depend on the axes, as they are in the new ones."""
    robots = [_robot(world, robot, at) for robot in world.robots.values()]
    return robots + [
        _features(world, group, at) for group in groups(world) if group.carrier is None
    ]


def times(parts: Sequence[Change], M: Mat, definer: slice) -> Mat:
    """J M, M (n, r)."""
    out = np.array(M)
    cause = M[definer]
    for part in parts:
        for first in range(0, len(part.columns), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            rows = part.columns[some]
            out[rows] = part.by_own[some] @ M[rows] + part.by_definer[some] @ cause
    return out


def _robot(world: World, robot: Robot, at: Definition) -> Change:
    motion, block = robot.motion, world.gauss.layout[robot.block]
    xpdef, dxpdef_by_dxv = at.seen_in(motion.space)
    xv = world.gauss.mean(robot.block)
    value, by_xv, by_xpdef = completed(motion.redefine(xv, xpdef), motion.redefine, xv, xpdef)
    value, N = completed(motion.normalise(value), motion.normalise, value)
    assert by_xv is not None and by_xpdef is not None and N is not None
    by_own, by_definer = N @ by_xv, N @ by_xpdef @ dxpdef_by_dxv
    if robot is at.robot:
        # Its pose is now the same whatever it was; that has to be so to the last bit.
        by_own, by_definer = by_own + by_definer, np.zeros_like(by_own)
        by_own[np.abs(by_own) < NOTHING] = 0.0
    return Change(block.indices[None], value[None], by_own[None], by_definer[None])


def _features(world: World, group: Group, at: Definition) -> Change:
    model, y = group.model, world.gauss.x[group.columns]
    xpdef, dxpdef_by_dxv = at.seen_in(model.space)
    value, by_y, by_xpdef = completed(model.redefine(y, xpdef), model.redefine, y, xpdef)
    assert by_y is not None and by_xpdef is not None
    shape = (*y.shape, y.shape[-1])
    by_own, by_definer = np.broadcast_to(by_y, shape), by_xpdef @ dxpdef_by_dxv
    proper = model.normalise(value)
    if proper is not None:
        value, N = completed(proper, model.normalise, value)
        assert N is not None
        by_own, by_definer = N @ by_own, N @ by_definer
    by_definer = np.broadcast_to(by_definer, (*y.shape, by_definer.shape[-1]))
    return Change(group.columns, value, by_own, by_definer)


def _told(world: World, group: Group, at: Definition) -> dict[Label, Feature]:
    """What is known of features besides their state: first views, particles, extents."""
    out = {}
    for i, label in enumerate(group.labels):
        feature = world.features[label]
        space = world.mounts[feature.mount].sensor.space
        pose0 = relative(space, at.seen_in(space)[0], feature.pose0).x
        feature = replace(feature, pose0=frozen(space.normalise(pose0)[0]))
        xpdef, _ = at.seen_in(group.model.space)
        if feature.particles is not None:
            lam = group.model.redefine_free(feature.particles.lam, xpdef)
            feature = replace(feature, particles=feature.particles._replace(lam=frozen(lam)))
        if feature.extent is not None:
            y = world.gauss.x[group.columns[i]]
            feature = replace(feature, extent=_extent(group.model, y, feature.extent, xpdef))
        out[label] = feature
    return out


def _extent(
    model: FeatureModel, y: Vec, extent: tuple[float, float], xpdef: Vec
) -> tuple[float, float]:
    """Where both ends of a segment are along the line as it is told in the new axes."""
    d, space = model.space.d, model.space
    a, b = space.to_local(xpdef, model.ends(y, np.array(extent)).reshape(2, d + 1)).X
    moved = model.redefine(y, xpdef).value
    proper = model.normalise(moved)
    moved = moved if proper is None else proper.value
    # From beside the end that is nearer than infinity the rays to both meet the line under a good
    # angle; an end at infinity, or projectively beyond, is a direction.
    near = a if abs(a[d]) > abs(b[d]) else b
    way = a[:d] * b[d] - b[:d] * a[d]
    way /= max(float(np.linalg.norm(way)), 1e-18)
    aside = np.eye(d)[np.argmin(np.abs(way))]
    aside -= (aside @ way) * way
    origin = near[:d] / near[d] + aside if near[d] else aside
    t = model.along(moved, origin, np.array([a[:d] - a[d] * origin, b[:d] - b[d] * origin]))
    return float(t[0]), float(t[1])


def _axes(world: World, at: Definition) -> Axes:
    before = world.axes
    pose = at.pose if before is None else THREE_D.compose(before.pose, at.pose).x
    lost = {word for word in TOLD if deviation(word, at.pose, at.pose_cov, at.up)}
    if before is not None:
        lost |= before.lost
    pose = frozen(THREE_D.normalise(pose)[0])
    return Axes(pose, at.robot.id, world.frame, frozenset(lost))
