"""New axes in a running session: what is done, and how things told in others are seen from them.

Truth and the rows of the metrics are told once, in the axes the run began in. Whoever shows or
judges them asks here for what they are in the present ones: the truth as seen from where the
defining robot *truly* was, so that errors are relative to it as its covariance is.
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from scene_core.arrays import Vec, frozen
from scene_core.filter.axes import redefine
from scene_core.filter.records import Event, PhaseRecord, Trace
from scene_core.filter.world import Axes
from scene_core.geometry.embedding import embed, flatten
from scene_core.geometry.spaces import THREE_D, Space, relative


def zeroed(trace: Trace, robot: str) -> PhaseRecord:
    """A last phase of a complete frame: the axes are put where a robot is.

    Raises ParamError with a sentence when a model does not allow it.
    """
    t0 = perf_counter()
    world = redefine(trace.world, robot)
    assert world.axes is not None
    true_pose = _true_pose(trace, robot)
    world = replace(world, axes=replace(world.axes, true_pose=true_pose))
    text = f"the axes are where robot '{robot}' is: it is at zero for certain, all else is relative"
    truth = trace.frame.truth
    if truth is not None and true_pose is None:
        text += "; where it truly is nobody knows in this frame: no errors from now on"
    event = Event(trace.frame.index, "info", text)
    ms = 1e3 * (perf_counter() - t0)
    return PhaseRecord("manage", None, world, ms, events=(event,))


def _true_pose(trace: Trace, robot: str) -> Vec | None:
    truth, motion = trace.frame.truth, trace.world.robots[robot].motion
    xp = None if truth is None else truth.xp.get(robot)
    if xp is None or not np.isfinite(xp).all():
        return None
    return frozen(embed(np.asarray(xp), motion.space, trace.world.up)[0])


def estimate_axes(axes: Axes | None) -> Vec | None:
    """The pose (7,) of the present axes in the first ones; None: they are the same."""
    return None if axes is None else axes.pose


def truth_axes(axes: Axes | None, aligned: bool) -> Vec | None:
    """The same for the truth: NaN where nobody knows it. Truth that was aligned with the estimate
    is seen from where the estimate is."""
    if axes is None or aligned:
        return estimate_axes(axes)
    return np.full(7, np.nan) if axes.true_pose is None else axes.true_pose


def points_from(pose: Vec | None, points: Vec) -> Vec:
    """Points (..., 3) of the first axes seen from a pose (7,) in them."""
    if pose is None or points.size == 0:
        return points
    X = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)
    return THREE_D.to_local(pose, X).X[..., :3]


def poses_from(pose: Vec | None, xp: Vec, space: Space, up: str) -> Vec:
    """Position states (..., n) of the first axes seen from a pose (7,) in them."""
    return xp if pose is None else relative(space, flatten(pose, space, up)[0], xp).x


def poses_told_first(pose: Vec | None, xp: Vec, space: Space, up: str) -> Vec:
    """The way back: position states (..., n) seen from a pose, told in the first axes."""
    return xp if pose is None else space.compose(flatten(pose, space, up)[0], xp).x
