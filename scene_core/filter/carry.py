"""Carrying the uncertainty of the axes along when an update moves the map.

No sensor of a map says where its axes are. A small move a of the axes changes every block by
dx = N(x) a, N = dx'/dxpdef of its own `redefine`, and a measurement of features cannot tell: at
every x, H(x) N(x) = 0. But H is taken at another x in every frame. What an update leaves in the
directions N(x) is no longer what the next one leaves alone, and so the filter believes to learn
where its axes are. Told as dx = N(x) a + e, with a what the error of a robot's pose says of the
axes, the error (a, e) does not depend on x, and P is told anew where the update puts x:

    P <- T P T',   T = I + (N(x+) - N(x)) A,   A = N_xp(x)^-1 dxp/dxv,   A N(x) = I

Source: Barrau, Bonnabel, *An EKF-SLAM algorithm with consistency properties*, 2015; Julier,
Uhlmann, *A counter example to the theory of simultaneous localization and map building*, ICRA 2001.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.axes import Definition
from scene_core.filter.gaussian import Workspace
from scene_core.filter.groups import groups
from scene_core.filter.world import Robot, World
from scene_core.geometry.spaces import relative
from scene_core.models.base import completed


class Carried:
    """The axes as an update finds them: x is where P was told before it.

    Axes have as many directions as the space of the robot whose pose says how wrong they are.
    """

    def __init__(self, world: World, robot: str, x: Vec) -> None:
        self.world, self.robot, self.x = world, world.robots[robot], x.copy()
        motion = self.robot.motion
        origin = motion.space.identity()
        move = motion.space.from_tangent(origin)
        nothing_known = np.zeros((0, 0))
        self.origin = Definition(self.robot, origin, move, nothing_known, world.up)

    @cached_property
    def seen(self) -> Mat:
        """A (t, n): the move of the axes that the error of the robot's state says."""
        motion, at = self.robot.motion, self.world.gauss.layout[self.robot.block]
        xv = self.x[at.slice]
        xp, dxp_by_dxv = completed(motion.xp(xv), motion.xp, xv)
        assert dxp_by_dxv is not None
        xpdef, by_move = self.origin.seen_in(motion.space)
        A: Mat = np.linalg.pinv(relative(motion.space, xpdef, xp).by_a @ by_move) @ dxp_by_dxv
        return A

    @cached_property
    def before(self) -> Mat:
        """N(x)"""
        return self.moved_by(self.x)

    def moved_by(self, x: Vec) -> Mat:
        """N(x) (n, t): the change of every block for a small move of the axes."""
        N = np.zeros((x.size, self.origin.dxp_by_dxv.shape[1]))
        for robot in self.world.robots.values():
            N[self.world.gauss.layout[robot.block].slice] = self._robot(robot, x)
        for group in groups(self.world):
            if group.carrier is None:
                model, y = group.model, x[group.columns]
                xpdef, by_move = self.origin.seen_in(model.space)
                _, _, by_xpdef = completed(model.redefine(y, xpdef), model.redefine, y, xpdef)
                assert by_xpdef is not None
                N[group.columns] = by_xpdef @ by_move
        return N

    def _robot(self, robot: Robot, x: Vec) -> Mat:
        motion, xv = robot.motion, x[self.world.gauss.layout[robot.block].slice]
        xpdef, by_move = self.origin.seen_in(motion.space)
        _, _, by_xpdef = completed(motion.redefine(xv, xpdef), motion.redefine, xv, xpdef)
        assert by_xpdef is not None
        return by_xpdef @ by_move

    def robot_at(self, x: Vec) -> Mat:
        """The rows and columns of T that are the robot's own: what multiplies, from the right, a
        Jacobian that was taken at x, where the robot alone has moved."""
        at = self.world.gauss.layout[self.robot.block]
        own = self._robot(self.robot, x) - self.before[at.slice]
        return np.eye(at.size) + own @ self.seen

    def carry(self, work: Workspace) -> None:
        """Tell the covariance of an updated state where that has been put."""
        at, P = self.world.gauss.layout[self.robot.block].slice, work.P
        D = (self.moved_by(work.x) - self.before) @ self.seen
        # D P_r + (D P_r)' + D P_rr D', symmetric to the last bit.
        half = D @ (P[at] + 0.5 * P[at, at] @ D.T)
        P += half + half.T


def carried(world: World, robot: str, x: Vec) -> Carried | None:
    """The axes before an update by something on a robot; None where they are not to be carried."""
    return Carried(world, robot, x) if world.policies.update.invariant else None
