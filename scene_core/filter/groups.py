"""Features by model, ready to go through the observation chain together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.world import Label, Robot, World
from scene_core.geometry.embedding import embed
from scene_core.models.base import FeatureModel, Particles, completed


@dataclass(frozen=True)
class Group:
    """Features of one model; markers of one carrier's hook; partial features by themselves."""

    model: FeatureModel
    labels: tuple[Label, ...]
    columns: np.ndarray
    """State indices (N, s): of each feature's block, or of the carrier's for markers."""
    pose0: Vec
    """(N, n)"""
    particles: tuple[Particles, ...] = ()
    """Of partial features."""
    extents: Vec | None = None
    """Of segments (N, 2)."""
    carrier: Robot | None = None
    offsets: Vec | None = None
    """Of markers (N, d)."""
    up: str = "z"
    hook: str = "base"
    """Of the carrier: what the markers are fixed to."""

    @property
    def partial(self) -> bool:
        return bool(self.particles)

    def rows(self, chosen: Sequence[int] | np.ndarray) -> Group:
        """Some of the features."""
        index = np.asarray(chosen, dtype=int)
        return Group(
            self.model,
            tuple(self.labels[i] for i in index),
            self.columns[index],
            self.pose0[index],
            tuple(self.particles[i] for i in index) if self.particles else (),
            None if self.extents is None else self.extents[index],
            self.carrier,
            None if self.offsets is None else self.offsets[index],
            self.up,
            self.hook,
        )


def groups(world: World, labels: Sequence[Label] | None = None) -> list[Group]:
    """Features by model, in the order of their labels."""
    by_kind: dict[tuple, list[Label]] = {}
    features, layout = world.features, world.gauss.layout.by_name
    kinds: list[FeatureModel] = []
    kind: dict[int, int] = {}
    for label in features if labels is None else labels:
        f = features[label]
        # Equal models are one kind; a user's model need not be hashable.
        if id(f.model) not in kind:
            same = next((k for k, model in enumerate(kinds) if model == f.model), len(kinds))
            if same == len(kinds):
                kinds.append(f.model)
            kind[id(f.model)] = same
        of = (kind[id(f.model)], f.carrier, f.hook, f.particles is None)
        by_kind.setdefault(of, []).append(label)
    out = []
    for members in by_kind.values():
        kin = [features[label] for label in members]
        model, first = kin[0].model, kin[0]
        size = layout[first.block].size
        starts = np.array([layout[f.block].start for f in kin])
        out.append(
            Group(
                model,
                tuple(members),
                starts[:, None] + np.arange(size),
                np.array([f.pose0 for f in kin]),
                tuple(f.particles for f in kin if f.particles is not None),
                np.array([f.extent for f in kin]) if model.shape == "segment" else None,
                world.robots[first.carrier] if first.carrier else None,
                np.array([f.offset for f in kin]) if first.carrier else None,
                world.up,
                first.hook,
            )
        )
    return out


def states(group: Group, x: Vec) -> tuple[Vec, Mat | None]:
    """y (N, n) of every feature, and its Jacobian by the group's columns (None: identity).

    A marker's coordinates are y = R(q) offset + t, (t, q) = xp of its carrier's hook.
    """
    if group.carrier is None or group.offsets is None:
        return x[group.columns], None
    motion, space = group.carrier.motion, group.model.space
    xv = x[group.columns[0]]
    xp, dxp_by_dxv = completed(motion.xp(xv, group.hook), lambda v: motion.xp(v, group.hook), xv)
    assert dxp_by_dxv is not None
    if motion.space is not space:
        xp, by_xp = embed(xp, motion.space, group.up, space)
        dxp_by_dxv = by_xp @ dxp_by_dxv
    at_carrier = np.concatenate([group.offsets, np.ones((len(group.offsets), 1))], axis=1)
    seen = space.to_world(xp, at_carrier)
    return seen.X[:, :-1], seen.by_xp[:, :-1] @ dxp_by_dxv


def moments(group: Group, x: Vec, P: Mat) -> tuple[Vec, Mat]:
    """Mean y (N, n) and covariance (N, n, n) of every feature."""
    y, J = states(group, x)
    Pyy = P[group.columns[:, :, None], group.columns[:, None, :]]
    return y, Pyy if J is None else J @ Pyy @ np.swapaxes(J, -1, -2)


def rows_of(world: World, labels: Sequence[Label]) -> tuple[Mat, list[slice]]:
    """A covariance and where each feature's own rows are in it: P, with rows added for the
    coordinates of markers, which have no block."""
    gauss, features = world.gauss, world.features
    where = {k: gauss.layout[features[k].block].slice for k in labels}
    T = [np.eye(gauss.x.size)]
    at = gauss.x.size
    for group in groups(world, [k for k in labels if features[k].carrier]):
        _, by_columns = states(group, gauss.x)
        assert by_columns is not None
        for label, columns, J in zip(group.labels, group.columns, by_columns, strict=True):
            own = np.zeros((len(J), gauss.x.size))
            own[:, columns] = J
            T.append(own)
            where[label] = slice(at, at + len(J))
            at += len(J)
    out = list(where.values())
    return (
        (gauss.P, out) if len(T) == 1 else (np.concatenate(T) @ gauss.P @ np.concatenate(T).T, out)
    )
