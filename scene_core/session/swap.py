"""Edited settings brought into a running World: what can be kept is kept, the rest is said.

State components with equal label and unit keep their rows of x and P; the new motion model's
`lift` fills the others or refuses with a sentence. Landmark rows are untouched.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.fixed import lost
from scene_core.filter.gaussian import convert, drop
from scene_core.filter.world import Gaussian, Instrument, Robot, World
from scene_core.models.base import (
    FeatureModel,
    InternalMeasurementModel,
    MotionModel,
    completed,
)
from scene_core.params import ParamError
from scene_core.session.config import EstimatorSettings
from scene_core.session.estimated import with_estimated
from scene_core.session.markers import moved_markers
from scene_core.session.start import resting

WORDS: Mapping[str, str] = {"vx vy vz": "velocity", "wx wy wz": "turn rate", "phi": "heading"}
"""How groups of state components are called."""


@dataclass(frozen=True)
class Reconfigured:
    """A world under new settings, and sentences about what was kept and what restarted."""

    world: World
    notes: tuple[str, ...] = ()


def reconfigure(world: World, old: EstimatorSettings, new: EstimatorSettings) -> Reconfigured:
    """The same estimate under other settings. Raises ParamError where that has no meaning."""
    if old is new:
        return Reconfigured(world)
    if old.robots.keys() != new.robots.keys() or old.mounts.keys() != new.mounts.keys():
        raise ParamError("robots and sensors can not be added or removed while running: reset")
    notes: list[str] = []
    for robot, settings in new.robots.items():
        if settings.motion is not old.robots[robot].motion:
            world, said = with_motion(world, robot, settings.motion)
            notes += said
    for mount, settings in new.mounts.items():
        if settings.sensor is not old.mounts[mount].sensor:
            world, said = with_sensor(world, mount, old, new)
            notes += said
    world, said = with_estimated(world, old, new)
    notes += said
    world = moved_markers(world, old, new)
    if new.policies is not old.policies:
        world, said = with_policies(world, new)
        notes += said
    idle = resting(new)
    notes += [why for name, why in idle.items() if name in world.instruments]
    for robot, settings in new.robots.items():
        if settings.motion is not old.robots[robot].motion:
            check_directions(world, settings.motion)
    instruments = {
        name: Instrument(name, one.robot, one.model)
        for name, one in new.instruments.items()
        if name not in idle
    }
    for name, one in instruments.items():
        if name not in world.instruments:
            check_directions(world, one.model)
    return Reconfigured(replace(world, instruments=instruments), tuple(notes))


def check_directions(world: World, model: MotionModel | InternalMeasurementModel) -> None:
    """Raise ParamError when a model relies on a direction that new axes did not keep."""
    for word in model.world_fixed:
        if world.axes is not None and lost(world, word):
            raise ParamError(
                f"'{model.name}' relies on {word}, which is not where it was since the axes were "
                f"put at robot '{world.axes.robot}' in frame {world.axes.frame}: go back before it "
                "and edit there, or reset"
            )


def with_motion(world: World, robot: str, motion: MotionModel) -> tuple[World, list[str]]:
    """Another motion model, or the same one with other parameters, for a robot."""
    old = world.robots[robot].motion
    robots = {**world.robots, robot: Robot(robot, motion)}
    if type(old) is type(motion) and old.state_labels == motion.state_labels:
        return replace(world, robots=robots), []
    if old.space is not motion.space:
        raise ParamError(
            f"'{motion.name}' moves in {motion.space.d}-D and '{old.name}' in {old.space.d}-D: "
            "load a scenario of that dimension instead"
        )
    block = world.robots[robot].block
    xv, J, rest = lifted(old, motion, world.gauss.mean(block))
    gauss = _plus(convert(world.gauss, block, xv, J), block, rest)
    calib = world.robots[robot].calib_block
    gauss = _with_calib(gauss, calib, old.calib_labels, motion.calib_labels, motion.calib0, {})
    return replace(world, robots=robots, gauss=gauss), [swap_words(old, motion, xv, rest)]


def lifted(old: MotionModel, new: MotionModel, xv: Vec) -> tuple[Vec, Mat, Mat]:
    """State of `new` from that of `old`, its Jacobian by the old state, and the covariance of what
    the old state can not say."""
    xp, dxp_by_dxv = completed(old.xp(xv), old.xp, xv)
    assert dxp_by_dxv is not None
    rest = new.lift(xp)
    value, J, P = np.array(rest.xv), rest.dxv_by_dxp @ dxp_by_dxv, np.array(rest.P_rest)
    for i, j in _common(old, new):
        value[i], J[i] = xv[j], np.eye(len(xv))[j]
        P[i, :] = P[:, i] = 0.0
    return value, J, P


def _common(old: MotionModel, new: MotionModel) -> list[tuple[int, int]]:
    """Rows (new, old) of components with equal label and unit."""
    where = {pair: j for j, pair in enumerate(zip(old.state_labels, old.state_units, strict=True))}
    pairs = zip(new.state_labels, new.state_units, strict=True)
    return [(i, where[pair]) for i, pair in enumerate(pairs) if pair in where]


def swap_words(old: MotionModel, new: MotionModel, xv: Vec, rest: Mat) -> str:
    """E.g. pose and map kept; velocity restarted at 0 ± 1 m/s."""
    kept = {i for i, _ in _common(old, new)}
    pose = set(new.space.labels) <= {new.state_labels[i] for i in kept}
    out = ["pose and map kept" if pose else "position and map kept"]
    restarted: dict[tuple[str, float, float], list[str]] = {}
    for i, (label, unit) in enumerate(zip(new.state_labels, new.state_units, strict=True)):
        if i not in kept and label not in new.space.labels:
            key = (unit, round(float(xv[i]), 6), math.sqrt(rest[i, i]))
            restarted.setdefault(key, []).append(label)
    for (unit, mean, sd), labels in restarted.items():
        value = f"{mean:g} ± {sd:g} {unit}"
        if unit.startswith("rad"):
            value = f"{math.degrees(mean):g} ± {math.degrees(sd):.3g} {unit.replace('rad', 'deg')}"
        out.append(f"{_called(labels)} restarted at {value}")
    dropped = [s for s in old.state_labels if s not in new.state_labels + new.space.labels]
    if dropped:
        out.append(f"{' and '.join(_groups(dropped))} dropped")
    return "; ".join(out)


def _called(labels: Sequence[str]) -> str:
    return WORDS.get(" ".join(labels), ", ".join(labels))


def _groups(labels: Sequence[str]) -> list[str]:
    text, out = " ".join(labels), []
    for group, word in WORDS.items():
        if group in text:
            out.append(word)
            text = text.replace(group, "")
    return out + text.split()


def with_sensor(
    world: World, mount: str, old: EstimatorSettings, new: EstimatorSettings
) -> tuple[World, list[str]]:
    """Another sensor, or the same one with other parameters, for a mount."""
    before, after = old.mounts[mount].sensor, new.mounts[mount].sensor
    m = world.mounts[mount]
    mounts = {**world.mounts, mount: replace(m, sensor=after)}
    if type(before) is type(after) and before.calib_labels == after.calib_labels:
        return replace(world, mounts=mounts), []
    if before.labels != after.labels or before.space is not after.space:
        raise ParamError(
            f"'{after.name}' measures {', '.join(after.labels)} and '{before.name}' "
            f"{', '.join(before.labels)}: the same measurements make no sense to it"
        )
    sds = new.mounts[mount].calib_sd
    gauss = _with_calib(
        *(world.gauss, m.calib_block, before.calib_labels, after.calib_labels),
        *(after.calib0, sds),
    )
    return replace(world, mounts=mounts, gauss=gauss), ["poses and map kept"]


def _with_calib(
    gauss: Gaussian,
    block: str,
    old: tuple[str, ...],
    new: tuple[str, ...],
    calib0: Vec,
    sds: Mapping[str, float],
) -> Gaussian:
    """The calibration block for other labels: common ones keep their rows, the others start at
    calib0 with their sd; no block when nothing of it is left to estimate."""
    if block not in gauss.layout:
        return gauss
    common = [(i, old.index(label)) for i, label in enumerate(new) if label in old]
    if not common and not sds:
        return drop(gauss, [block])
    value, J = np.array(calib0, dtype=np.float64), np.zeros((len(new), len(old)))
    rest = np.diag([float(sds.get(label, 0.0)) ** 2 for label in new])
    for i, j in common:
        value[i], J[i, j], rest[i, i] = gauss.mean(block)[j], 1.0, 0.0
    return _plus(convert(gauss, block, value, J), block, rest)


def _plus(gauss: Gaussian, block: str, Q: Mat) -> Gaussian:
    """Q added to a diagonal block of P."""
    P = gauss.P.copy()
    at = gauss.layout[block].slice
    P[at, at] += Q
    return Gaussian(gauss.x, frozen(P), gauss.layout)


def with_policies(world: World, new: EstimatorSettings) -> tuple[World, list[str]]:
    """Other policies. Features keep their parametrisation; those of an edited one take over the
    fields that act at once (the others hold for new features only)."""
    before, after = world.policies, new.policies
    world = replace(world, policies=after)
    notes: list[str] = []
    for shape, old, now in (
        ("point", before.landmark, after.landmark),
        ("segment", before.line, after.line),
    ):
        if old is now:
            continue
        if now is not None and type(old) is type(now):
            world = with_edited(world, now)
            continue
        of_shape = [f for f in world.features.values() if f.model.shape == shape]
        n = sum(not f.known for f in of_shape)
        what = "features" if shape == "point" else "lines"
        begins = f"no new {what}" if now is None else f"new {what} by '{now.name}'"
        notes.append(f"{begins}; the {n} in the map stay as they are")
    return world, notes


def with_edited(world: World, edited: FeatureModel) -> World:
    """The features of a parametrisation with those of its new parameters that act at once."""
    models: dict[int, FeatureModel] = {}
    features = {}
    for label, feature in world.features.items():
        model = feature.model
        if type(model) is type(edited):
            # One value for all of them: features are batched by the identity of their model.
            model = models.setdefault(id(model), acting_at_once(model, edited))
        features[label] = replace(feature, model=model)
    return replace(world, features=features)


_T = TypeVar("_T", bound=Any)


def acting_at_once(old: _T, new: _T) -> _T:
    """`old` with those parameters of `new` that act from the next frame on."""
    changed = {
        f.name: getattr(new, f.name)
        for f in fields(new)
        if f.metadata.get("param", {}).get("effect") == "next frame"
    }
    return replace(old, **changed)
