"""What a mount expects to see of every feature in the map, before anything is searched.

Source: Davison, Scene, section 5.2.1; Solà, toolbox, `correctKnownLmks`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.groups import Group, groups
from scene_core.filter.observe import (
    SensorState,
    innovation_covariance,
    observe,
    residual,
    roles,
    rows,
    sensor_state,
)
from scene_core.filter.particles import open_predictions
from scene_core.filter.records import Predictions
from scene_core.filter.scores import score
from scene_core.filter.world import Label, World
from scene_core.models import segments
from scene_core.models.base import Fault

SAMPLES = 17
"""Places along a segment at which its visibility is tried."""


def predictions(world: World, mount_id: str) -> tuple[Predictions, ...]:
    """One record per group of features. A marker is not looked for by a sensor at its own hook,
    a segment not by a sensor that can not measure lines."""
    at = sensor_state(world, mount_id)
    sensor, here = at.mount.sensor, (at.mount.robot, at.mount.hook)
    out = []
    for group in groups(world):
        if group.carrier is not None and (group.carrier.id, group.hook) == here:
            continue
        if group.model.space is not sensor.space:
            continue
        if group.partial:
            out.append(open_predictions(world, at, group))
        elif group.model.shape == "point":
            out.append(_of_points(world, at, group))
        elif segments.seen_by(sensor) is None:
            out.append(_of_segments(world, at, group))
    return tuple(out)


def _of_points(world: World, at: SensorState, group: Group) -> Predictions:
    sensor = at.mount.sensor
    seen = observe(at, group, world.gauss.x)
    E = innovation_covariance(world.gauss.P, rows(at, seen))
    R = sensor.R(seen.h)
    # A marker moves: where it was first seen from says nothing about how it looks now.
    pose0 = group.pose0 if group.carrier is None else np.broadcast_to(at.xws, group.pose0.shape)
    return Predictions(
        mount=at.mount.id,
        model=group.model.name,
        labels=group.labels,
        h=seen.h,
        H=roles(at, seen, world.gauss),
        E=E,
        R=R,
        fault=sensor.visibility(seen.h, seen.X_S, at.xws, pose0, seen.X_W),
        score=score(sensor, world.policies.selection.score, E, R),
        selected=np.zeros(len(group.labels), dtype=bool),
    )


def _of_segments(world: World, at: SensorState, group: Group) -> Predictions:
    """E and R of the distances between a line and the ends that are expected of it."""
    seen = observe(at, group, world.gauss.x)
    ends, fault = visible_ends(world, at, group)
    expected = residual(at, seen, ends)
    E = innovation_covariance(world.gauss.P, expected.rows)
    return Predictions(
        mount=at.mount.id,
        model=group.model.name,
        labels=group.labels,
        h=seen.h,
        H=roles(at, seen, world.gauss),
        E=E,
        R=expected.R,
        fault=fault,
        score=score(at.mount.sensor, world.policies.selection.score, E, expected.R),
        selected=np.zeros(len(group.labels), dtype=bool),
        shape="segment",
        ends=ends,
    )


def visible_ends(world: World, at: SensorState, group: Group) -> tuple[Vec, np.ndarray]:
    """Both ends of the longest visible part of each segment, as measured (N, 4), and faults (N,).

    The segment between its off-filter extents is tried at SAMPLES places. Where nothing is visible
    the ends are those of the whole segment, if they can be projected at all.
    """
    sensor, k = at.mount.sensor, at.k
    y = world.gauss.x[group.columns]
    assert group.extents is not None
    t0, t1 = group.extents[:, :1], group.extents[:, 1:]
    t = t0 + (t1 - t0) * np.linspace(0.0, 1.0, SAMPLES)
    n = len(group.labels)
    pairs = np.stack([t, t], axis=-1)
    X_W = group.model.ends(np.repeat(y[:, None], SAMPLES, axis=1), pairs)[..., :4].reshape(-1, 4)
    X_S = sensor.space.to_local(at.xws, X_W).X
    h = sensor.project(X_S, k).h
    here = np.broadcast_to(at.xws, (len(X_W), at.xws.size))
    fault = np.asarray(sensor.visibility(h, X_S, at.xws, here, X_W)).reshape(n, SAMPLES)
    h = h.reshape(n, SAMPLES, 2)
    first, last = _longest_run(fault == 0)
    every = np.arange(n)
    ends = np.concatenate([h[every, first], h[every, last]], axis=1)
    seen = last > first
    unseen = np.bitwise_and.reduce(fault, axis=1)
    unseen = np.where(unseen == 0, int(Fault.OUTSIDE), unseen)
    return ends, np.where(seen, 0, unseen).astype(int)


def _longest_run(inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last index of the longest run of True in every row; 0 and 0 without one."""
    length = np.zeros(inside.shape, dtype=int)
    run = np.zeros(len(inside), dtype=int)
    for i in range(inside.shape[1]):
        run = np.where(inside[:, i], run + 1, 0)
        length[:, i] = run
    last = length.argmax(axis=1)
    longest = length[np.arange(len(inside)), last]
    first = last - np.maximum(longest, 1) + 1
    return np.maximum(first, 0), last


def with_selected(preds: Sequence[Predictions], chosen: Sequence[Label]) -> tuple[Predictions, ...]:
    """The same predictions with the selection marked."""
    wanted = set(chosen)
    return tuple(
        replace(p, selected=np.array([label in wanted for label in p.labels], dtype=bool))
        for p in preds
    )
