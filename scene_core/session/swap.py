"""Edited settings brought into a running World: what can be kept is kept, the rest is said.

State components with equal label and unit keep their rows of x and P; the new motion model's
`lift` fills the others or refuses with a sentence. Landmark rows are untouched.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.fixed import lost
from scene_core.filter.gaussian import convert, drop
from scene_core.filter.world import Feature, Gaussian, Instrument, Label, Mount, Robot, World
from scene_core.models.base import (
    FeatureModel,
    InternalMeasurementModel,
    MotionModel,
    Sensor,
)
from scene_core.models.lifting import lifted
from scene_core.models.registry import observable
from scene_core.params import ParamError
from scene_core.session.config import EstimatorSettings
from scene_core.session.estimated import with_estimated
from scene_core.session.markers import moved_markers
from scene_core.session.start import check_names, resting
from scene_core.session.swap_words import swap_words


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
    check_names(new)
    notes: list[str] = []
    for robot, settings in new.robots.items():
        if settings.motion is not old.robots[robot].motion:
            world, said = with_motion(world, robot, settings.motion)
            notes += said
    for mount, settings in new.mounts.items():
        check_hook(new, mount)
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
        was = world.instruments.get(name)
        if was is None or was.model is not one.model:
            check_directions(world, one.model)
    return Reconfigured(replace(world, instruments=instruments), tuple(notes))


def check_hook(settings: EstimatorSettings, mount: str) -> None:
    """Raise ParamError when a sensor has nothing to hang on any more."""
    hook, motion = settings.mounts[mount].hook, settings.robots[settings.mounts[mount].robot].motion
    if hook not in motion.hooks:
        raise ParamError(
            f"sensor '{mount}' is mounted at the hook '{hook}', which '{motion.name}' does not "
            f"have: it has {', '.join(motion.hooks)}"
        )


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
    taken = lifted(old, motion, world.gauss.mean(block))
    gauss = _plus(convert(world.gauss, block, taken.xv, taken.by_xv), block, taken.P_rest)
    calib = world.robots[robot].calib_block
    gauss = _with_calib(gauss, calib, old.calib_labels, motion.calib_labels, motion.calib0, {})
    return replace(world, robots=robots, gauss=gauss), [swap_words(old, motion, taken)]


def with_sensor(
    world: World, mount: str, old: EstimatorSettings, new: EstimatorSettings
) -> tuple[World, list[str]]:
    """Another sensor, or the same one with other parameters, for a mount."""
    before, after = old.mounts[mount].sensor, new.mounts[mount].sensor
    m = world.mounts[mount]
    mounts = {**world.mounts, mount: replace(m, sensor=after)}
    if type(before) is type(after) and before.calib_labels == after.calib_labels:
        return replace(world, mounts=mounts), []
    if before.space is not after.space:
        raise ParamError(
            f"'{after.name}' measures {after.space.name} points and '{before.name}' "
            f"{before.space.name} ones: load a scenario of that dimension instead"
        )
    sds = new.mounts[mount].calib_sd
    gauss = _with_calib(
        *(world.gauss, m.calib_block, before.calib_labels, after.calib_labels),
        *(after.calib0, sds),
    )
    said = ["poses and map kept", *unseen(world, after)]
    if before.labels != after.labels:
        world = replace(world, features=unlearnt(world, mount))
    if new.mounts[mount].pose != old.mounts[mount].pose:
        mounts[mount], gauss = turned(mounts[mount], gauss, new.mounts[mount].pose)
    return replace(world, mounts=mounts, gauss=gauss), said


def turned(mount: Mount, gauss: Gaussian, pose: tuple[float, ...]) -> tuple[Mount, Gaussian]:
    """A sensor whose axes are other ones; what is estimated of its pose turns with them."""
    space = mount.sensor.space
    nominal = space.normalise(np.asarray(pose, dtype=np.float64))[0]
    if mount.pose_block in gauss.layout:
        change = space.compose(space.inverse(mount.pose).x, nominal).x
        moved = space.compose(gauss.mean(mount.pose_block), change)
        gauss = convert(gauss, mount.pose_block, moved.x, moved.by_a)
    return replace(mount, pose=frozen(nominal)), gauss


def unlearnt(world: World, mount: str) -> dict[Label, Feature]:
    """The features without what the measurements of a sensor taught their particles: it is told in
    components that another sensor does not have."""
    return {
        label: replace(f, learnt={m: past for m, past in f.learnt.items() if m != mount})
        for label, f in world.features.items()
    }


def unseen(world: World, sensor: Sensor) -> list[str]:
    """A sentence about features of the map that a sensor does not measure."""
    blind = [f for f in world.features.values() if observable(sensor, f.model)]
    if not blind:
        return []
    shapes = {f.model.shape for f in blind}
    what = {"point": "points", "segment": "lines"}[shapes.pop()] if len(shapes) == 1 else "features"
    return [f"the {len(blind)} {what} it can not measure stay in the map as they are"]


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
        notes.append(f"{begins}; the {n} in the map stay as they are" if n else begins)
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
