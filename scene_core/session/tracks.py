"""The history of one robot: what was estimated, what is true, and how wrong the filter was."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.world import Axes, World
from scene_core.geometry.ellipses import chi2_band, nees
from scene_core.geometry.embedding import embed_points
from scene_core.geometry.spaces import Space
from scene_core.models.base import completed
from scene_core.session.alignment import Alignment, Similarity, aligned_poses, umeyama
from scene_core.session.axes import (
    estimate_axes,
    points_from,
    poses_from,
    poses_told_first,
    truth_axes,
)
from scene_core.session.columns import Column
from scene_core.session.published import RobotSeries


@dataclass(frozen=True)
class PoseEstimate:
    """A robot's position state and its covariance on the tangent."""

    xp: Vec
    P: Mat
    """(tangent, tangent)"""


def body_name(robot: str, body: str) -> str:
    """What a body of a robot is called, in series and on the page."""
    return robot if body == "base" else f"{robot} {body}"


def pose_estimate(world: World, robot: str, body: str = "base") -> PoseEstimate:
    """xp of a body of a robot, and J P J' with J = d tangent / d xv."""
    r = world.robots[robot]
    xv, space = world.gauss.mean(r.block), r.motion.space
    xp, dxp_by_dxv = completed(r.motion.xp(xv, body), lambda v: r.motion.xp(v, body), xv)
    assert dxp_by_dxv is not None
    J = space.tangent_map(xp) @ dxp_by_dxv
    return PoseEstimate(xp, J @ world.gauss.cov(r.block) @ J.T)


def pose_error(space: Space, xp: Vec, true_xp: Vec) -> Vec:
    """Estimate minus truth on the tangent, in the frame in which `pose_estimate` gives P."""
    return -space.difference(true_xp, xp)


class RobotTrack:
    """The columns of a body of a robot. Poses and positions are told in the axes the run began in;
    errors, their standard deviations and NEES are of the axes in force at the time."""

    def __init__(self, space: Space, up: str, robot: str, body: str) -> None:
        t = space.tangent
        self.space, self.up, self.robot, self.body = space, up, robot, body
        self.xp, self.true_xp = Column(space.n), Column(space.n)
        self.error, self.sd, self.nees = Column(t), Column(t), Column()
        self.position, self.true_position = Column(3), Column(3)
        self.columns = (
            *(self.xp, self.true_xp, self.error, self.sd, self.nees),
            *(self.position, self.true_position),
        )
        self.known = False
        """Whether the truth was known in any frame."""

    def embedded(self, xp: Vec) -> Vec:
        """Positions of poses (..., n) in the world's three axes."""
        return embed_points(np.atleast_2d(self.space.position(xp)), self.space, self.up)

    def pad(self, rows: int) -> None:
        """Rows of NaN up to so many, for frames in which the robot had no such body."""
        for column in self.columns:
            column.pad(rows)

    def is_there(self, rows: int) -> bool:
        """Whether the robot has this body in the last of the first rows."""
        return rows == 0 or bool(np.isfinite(self.xp.view(rows)[-1]).all())

    def add(self, world: World, true_xp: Vec | None) -> None:
        at = pose_estimate(world, self.robot, self.body)
        pose = estimate_axes(world.axes)
        xp = poses_told_first(pose, at.xp, self.space, self.up)
        self.xp.append(xp)
        self.position.append(self.embedded(xp)[0])
        self.sd.append(np.sqrt(np.maximum(at.P.diagonal(), 0.0)))
        if true_xp is None or not np.isfinite(true_xp).all():
            for column in (self.true_xp, self.true_position, self.error, self.nees):
                column.append(np.nan)
            return
        self.known = True
        seen = poses_from(truth_axes(world.axes, aligned=False), true_xp, self.space, self.up)
        e = pose_error(self.space, at.xp, seen)
        self.true_xp.append(true_xp)
        self.true_position.append(self.embedded(true_xp)[0])
        self.error.append(e)
        self.nees.append(nees(e, at.P) if np.isfinite(e).all() else math.nan)

    def series(self, rows: int, axes: Axes | None, align: Alignment) -> RobotSeries:
        """The first rows, as seen from the present axes."""
        space, known, fit = self.space, self.known, None
        error = self.error.view(rows)
        there = truth_axes(axes, aligned=False)
        true_position = points_from(there, self.true_position.view(rows))
        if known and align != "none":
            true_position, error, fit = self._aligned(rows, axes, align)
        rotation = ("rx", "ry", "rz") if space.d == 3 else ("phi",) if space.d == 2 else ()
        return RobotSeries(
            labels=space.labels[: space.d] + rotation,
            units=("m",) * space.d + ("rad",) * len(rotation),
            position=points_from(estimate_axes(axes), self.position.view(rows)),
            true_position=true_position if known else None,
            error=error if known else None,
            sd=self.sd.view(rows),
            nees=self.nees.view(rows) if known and align == "none" else None,
            nees_dof=space.tangent,
            nees_band=chi2_band(space.tangent),
            alignment=fit,
            robot=self.robot,
            body=self.body,
        )

    def _aligned(
        self, rows: int, axes: Axes | None, align: Alignment
    ) -> tuple[Vec, Vec, Similarity | None]:
        """The truth moved into the estimate's axes (at most 500 frames decide how), errors, how
        in the axes the run began in."""
        xp, true_xp = self.xp.view(rows), self.true_xp.view(rows)
        step = max(1, len(xp) // 500)
        fit = umeyama(self.space, true_xp[::step], xp[::step], align)
        if fit is None:
            unknown = np.full_like(self.error.view(rows), np.nan)
            pose = truth_axes(axes, aligned=False)
            return points_from(pose, self.true_position.view(rows)), unknown, None
        moved = aligned_poses(self.space, fit, true_xp)
        pose = estimate_axes(axes)
        seen, true = (poses_from(pose, x, self.space, self.up) for x in (xp, moved))
        at = points_from(pose, self.embedded(moved))
        return at, -self.space.difference(true, seen), fit
