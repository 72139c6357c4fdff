"""What may be estimated besides robots and landmarks: calibrations and the poses of sensors.

Whatever has an initial standard deviation in the settings is a part of the state, now or from the
next frame on. Parts that come in are uncorrelated with everything; parts that go are as the
settings say again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.gaussian import Gaussian, augment, convert, drop
from scene_core.filter.world import Mount, Robot, World
from scene_core.geometry.spaces import Space
from scene_core.session.config import EstimatorSettings
from scene_core.session.start import ROTATION, check_sd, sd_labels


@dataclass(frozen=True)
class Estimable:
    """A calibration or a pose, and which of its components are estimated."""

    owner: str
    """Robot or mount it belongs to."""
    path: str
    """Of the standard deviations, below the experiment."""
    block: str
    """In the state, when something of it is estimated."""
    labels: tuple[str, ...]
    units: tuple[str, ...]
    """Of the labels: a pose is told on its tangent, x, y, z, rx, ry, rz."""
    sds: Mapping[str, float]
    """Initial standard deviation by label."""
    space: Space | None = None
    """Of a pose."""

    def tangent(self, x: Vec) -> Mat:
        """(len(labels), n): a small change of the block's mean x (n,) by label."""
        return np.eye(len(x)) if self.space is None else self.space.tangent_map(x)

    def from_tangent(self, x: Vec) -> Mat:
        """(n, len(labels)): the other way round."""
        return np.eye(len(x)) if self.space is None else self.space.from_tangent(x)


def estimables(settings: EstimatorSettings) -> tuple[Estimable, ...]:
    """Everything in the settings of which a component can be estimated, in their order."""
    out = []
    for name, robot in settings.robots.items():
        k = robot.motion
        path, block = f"estimator.robots.{name}.calib_sd", Robot(name, k).calib_block
        out.append(Estimable(name, path, block, k.calib_labels, k.calib_units, robot.calib_sd))
    for name, mount in settings.mounts.items():
        k, at = mount.sensor, f"estimator.mounts.{name}"
        here = Mount(name, k, mount.robot, mount.hook, np.asarray(mount.pose))
        labels = sd_labels(k.space.labels)
        known = dict(zip(k.space.labels, k.space.units, strict=True))
        units = tuple(known.get(label, "rad") for label in labels)
        pose = (labels, units, mount.pose_sd, k.space)
        out.append(Estimable(name, f"{at}.pose_sd", here.pose_block, *pose))
        calib = (k.calib_labels, k.calib_units, mount.calib_sd)
        out.append(Estimable(name, f"{at}.calib_sd", here.calib_block, *calib))
    return tuple(e for e in out if e.labels)


def nominal(world: World, block: str) -> Vec:
    """What the settings say of a calibration or a pose."""
    robots = {r.calib_block: r.motion.calib0 for r in world.robots.values()}
    poses = {m.pose_block: m.pose for m in world.mounts.values()}
    sensors = {m.calib_block: m.sensor.calib0 for m in world.mounts.values()}
    return np.asarray((robots | poses | sensors)[block], dtype=np.float64)


def with_estimated(
    world: World, old: EstimatorSettings, new: EstimatorSettings
) -> tuple[World, list[str]]:
    """The world with those blocks in its state that the new settings estimate, and a sentence
    about each component that came, was opened again, or went.

    Raises ParamError naming a label that there is not.
    """
    before = {e.block: e.sds for e in estimables(old)}
    notes: list[str] = []
    for e in estimables(new):
        check_sd(e.path, e.labels, e.sds)
        was = before.get(e.block, {})
        if dict(was) != dict(e.sds) or (e.block in world.gauss.layout) != bool(e.sds):
            after = _estimated(world.gauss, e, was, nominal(world, e.block))
            notes += _words(world, e, was)
            world = replace(world, gauss=after)
    return world, notes


def _estimated(gauss: Gaussian, e: Estimable, was: Mapping[str, float], x0: Vec) -> Gaussian:
    """Components with the same sd as before stay as they are; one with another sd starts anew
    about its present mean; one without is as in x0, and known."""
    here = e.block in gauss.layout
    if not e.sds:
        return drop(gauss, [e.block]) if here else gauss
    kept = [here and label in e.sds and was.get(label) == e.sds[label] for label in e.labels]
    fresh = [
        0.0 if stays else float(e.sds.get(label, 0.0))
        for label, stays in zip(e.labels, kept, strict=True)
    ]
    gone = {label for label in was if label not in e.sds}
    x = _mean(e, gauss.mean(e.block), x0, gone) if here else x0
    G = e.from_tangent(x)
    noise = G @ np.diag(np.square(fresh)) @ G.T
    if not here:
        return augment(gauss, e.block, x, {}, noise)
    J = G @ np.diag(np.array(kept, dtype=np.float64)) @ e.tangent(gauss.mean(e.block))
    rest = convert(gauss, e.block, x, J)
    P = rest.P.copy()
    at = rest.layout[e.block].slice
    P[at, at] += noise
    P.flags.writeable = False
    return Gaussian(rest.x, P, rest.layout)


def _mean(e: Estimable, x: Vec, x0: Vec, gone: set[str]) -> Vec:
    """x, with x0 for what is gone. An orientation goes back as a whole: once none of its three
    components is estimated any more."""
    labels = e.labels if e.space is None else e.space.labels
    turned_back = bool(gone & set(ROTATION)) and not any(label in e.sds for label in ROTATION)
    back = [label in gone or (label not in e.labels and turned_back) for label in labels]
    return np.where(back, x0, x)


def _words(world: World, e: Estimable, was: Mapping[str, float]) -> list[str]:
    out = []
    for label, unit in zip(e.labels, e.units, strict=True):
        sd, before = e.sds.get(label), was.get(label)
        if sd == before:
            continue
        name = f"{label} of {e.owner}"
        factor, shown = (180.0 / np.pi, unit.replace("rad", "deg")) if "rad" in unit else (1, unit)
        tail = f" {shown}" if shown else ""
        value = "" if sd is None else f"± {sd * factor:.3g}{tail}"
        if sd is None:
            out.append(f"{name} is no longer estimated: it is as the settings say again")
        elif before is None:
            out.append(f"{name} is estimated, from the settings' value {value}")
        else:
            out.append(f"{name} starts anew, at its present value {value}")
    return out
