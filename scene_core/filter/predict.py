"""Prediction of the robots and their internal measurements.

Over the control intervals since the last frame, for the robot's state v and calibration k:
    xv <- f(xv, u, dt, k),   F <- [df/dxv  df/dk; 0 1] F,   Q <- F Q F' + G U G' + Q(xv, u, dt, k)
and then once   P <- F P F' + Q.   Features do not move: only the robot's rows and columns change.

Source: Davison, Scene, eq. 2; Solà, toolbox, function `motion`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.carry import carried
from scene_core.filter.gaussian import FilterError, Rows, Workspace
from scene_core.filter.ports import Control, Frame, SourceError
from scene_core.filter.records import InternalUpdate
from scene_core.filter.world import Instrument, Robot, World
from scene_core.geometry.ellipses import chi2_gate
from scene_core.models.base import MotionModel, completed, words
from scene_core.models.registry import runs_on


@dataclass(frozen=True)
class Motion:
    """Prediction of one robot over a whole frame."""

    xv: Vec
    F: Mat
    """(n, n + nk): by the state and the calibration."""
    Q: Mat
    """(n, n)"""


def matched_controls(motion: MotionModel, control: Control) -> tuple[Vec, Mat]:
    """u and U in the model's order: by label; one nobody sent is zero, with the model's own
    "unknown" variance."""
    wanted = motion.control_labels
    u = np.zeros(len(wanted))
    given = {label: i for i, label in enumerate(control.labels)}
    mine = [i for i, label in enumerate(wanted) if label in given]
    theirs = [given[wanted[i]] for i in mine]
    u[mine] = control.u[theirs]
    if not mine:
        return u, motion.U_unknown(control.dt)
    if len(mine) == len(wanted) and control.U is None:
        return u, motion.U(u, control.dt)
    U = motion.U_unknown(control.dt).copy()
    source = motion.U(u, control.dt) if control.U is None else control.U[np.ix_(theirs, theirs)]
    U[mine, :], U[:, mine] = 0.0, 0.0
    U[np.ix_(mine, mine)] = source if control.U is not None else source[np.ix_(mine, mine)]
    return u, U


def robot_motion(robot: Robot, xv: Vec, k: Vec, controls: Sequence[Control]) -> Motion:
    """Compose the intervals of a frame; normalises after each."""
    model, n, nk = robot.motion, xv.size, k.size
    F, Q = np.eye(n, n + nk), np.zeros((n, n))
    for control in controls:
        u, U = matched_controls(model, control)
        dt = control.dt

        def value(v: Vec, w: Vec, c: Vec, dt: float = dt) -> tuple:
            return model.f(v, w, dt, c)

        fv, by_xv, by_u, by_k = completed(model.f(xv, u, dt, k), value, xv, u, k)
        assert by_xv is not None and by_u is not None and by_k is not None
        Qstep = by_u @ U @ by_u.T + model.Q(xv, u, dt, k)
        Fstep = by_xv @ F
        Fstep[:, n:] += by_k
        xv, J = model.normalise(fv)
        Q = by_xv @ Q @ by_xv.T + Qstep
        F = Fstep
        if J is not None:
            F, Q = J @ F, J @ Q @ J.T
    return Motion(xv, F, Q)


def predict(world: World, frame: Frame) -> tuple[World, dict[str, float]]:
    """All robots over the time since the last frame."""
    work = Workspace(world.gauss)
    numbers: dict[str, float] = {"dt": frame.dt}
    for robot in world.robots.values():
        given = frame.controls.get(robot.id, ())
        controls = given or ((Control(frame.dt),) if frame.dt > 0 else ())
        if not controls:
            continue
        block = work.layout[robot.block]
        k = world.robot_calib(robot.id)
        motion = robot_motion(robot, work.x[block.slice], k, controls)
        numbers[f"{robot.id}: trace P before"] = float(np.trace(work.P[block.slice, block.slice]))
        if robot.calib_block in work.layout:
            source = np.concatenate([block.indices, work.layout[robot.calib_block].indices])
            F = motion.F
        else:
            source, F = block.indices, motion.F[:, : block.size]
        work.transform(block.indices, source, F, motion.Q)
        work.x[block.slice] = motion.xv
        after, added = np.trace(work.P[block.slice, block.slice]), np.trace(motion.Q)
        numbers[f"{robot.id}: trace F P F'"] = float(after - added)
        numbers[f"{robot.id}: trace G U G' + Q"] = float(added)
        numbers[f"{robot.id}: trace P after"] = float(after)
    moved = replace(world, frame=frame.index, time=frame.time, gauss=work.seal())
    return moved, numbers


def normalise_robots(work: Workspace, world: World) -> None:
    """Put every robot and every estimated sensor pose back on its constraint, with the exact
    Jacobian."""
    for robot in world.robots.values():
        block = work.layout[robot.block]
        value, J = robot.motion.normalise(work.x[block.slice])
        work.set_block(block, value, J)
    for mount in world.mounts.values():
        if mount.pose_block in work.layout:
            block = work.layout[mount.pose_block]
            value, J = mount.sensor.space.normalise(work.x[block.slice])
            work.set_block(block, value, J)


def measure_internally(world: World, frame: Frame) -> tuple[World, tuple[InternalUpdate, ...]]:
    """Update with every internal measurement of the frame, one after the other, gated."""
    due = [i for i in world.instruments.values() if i.id in frame.internal]
    if not due:
        return world, ()
    work = Workspace(world.gauss)
    updates = tuple(
        _internal_update(work, world, instrument, frame.internal[instrument.id])
        for instrument in due
    )
    normalise_robots(work, world)
    return replace(world, gauss=work.seal()), updates


def check_reading(instrument: Instrument, zv: Vec) -> None:
    """Raise SourceError when a reading is not what the instrument's model measures."""
    wanted = instrument.model.measurement_size
    if np.shape(zv) != (wanted,) or not np.isfinite(zv).all():
        labels = ", ".join(instrument.model.labels)
        raise SourceError(
            f"instrument '{instrument.id}' was given {np.asarray(zv).tolist()}: "
            f"'{instrument.model.name}' needs {wanted} finite number{'s' * (wanted > 1)} ({labels})"
        )


def _internal_update(
    work: Workspace, world: World, instrument: Instrument, zv: Vec
) -> InternalUpdate:
    robot, model = world.robots[instrument.robot], instrument.model
    reason = runs_on(model, robot.motion)
    if reason:
        raise FilterError(
            f"instrument '{instrument.id}': {reason}; remove the instrument or swap the model"
        )
    check_reading(instrument, zv)
    start = work.layout[robot.block].start
    index = np.array([start + robot.motion.state_labels.index(need) for need in model.needs])
    needed = work.x[index]
    hv, dhv = completed(model.h(needed), model.h, needed)
    assert dhv is not None
    R = model.R(hv)
    nu = model.nu(hv, zv)
    S = dhv @ work.P[np.ix_(index, index)] @ dhv.T + R
    d2 = float(nu @ np.linalg.solve(S, nu))
    gate = chi2_gate(len(zv), world.policies.gate.confidence)
    fault = model.feasible(needed, hv)
    accepted = not fault and d2 < gate
    if accepted:
        axes = carried(world, robot.id, work.x)
        work.update([Rows(index, dhv[None])], nu, R)
        if axes is not None:
            axes.carry(work)
    why = words(fault) if fault else "" if accepted else f"d2 = {d2:.1f} > {gate:.2f}"
    return InternalUpdate(instrument.id, hv, zv, nu, S, d2, gate, accepted, why)
