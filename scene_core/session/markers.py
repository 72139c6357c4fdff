"""Markers on robots, as the estimator believes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scene_core.arrays import frozen
from scene_core.filter.groups import groups
from scene_core.filter.observe import observe, sensor_state
from scene_core.filter.world import Feature, World
from scene_core.geometry.spaces import SPACES, Space
from scene_core.models.base import FeatureModel
from scene_core.models.registry import models
from scene_core.params import ParamError
from scene_core.session.config import EstimatorSettings, MarkerSettings


def plain_point(space: Space) -> FeatureModel:
    """The parametrisation of a space whose state is the point's coordinates."""
    kinds = (kind() for kind in models("features").values())
    return next(m for m in kinds if m.space is space and m.state_labels == space.labels[: space.d])


def with_markers(world: World, settings: EstimatorSettings) -> World:
    """The world with a feature for every marker, numbered after those it has.

    Raises ParamError naming the marker that nobody can see, or that is not on a robot.
    """
    for name, marker in settings.markers.items():
        at = f"estimator.markers.{name}"
        feature = _feature(world, at, marker)
        taken = {f.appearance for f in world.features.values() if isinstance(f.appearance, int)}
        if marker.identity in taken:
            raise ParamError(
                f"{at}.identity = {marker.identity}: another marker or landmark has it already"
            )
        features = {**world.features, feature.label: feature}
        world = replace(world, features=features, next_label=feature.label + 1)
    return world


def _feature(world: World, at: str, marker: MarkerSettings) -> Feature:
    if marker.robot not in world.robots:
        known = ", ".join(world.robots)
        raise ParamError(f"{at}.robot = '{marker.robot}': there is no such robot, only {known}")
    motion = world.robots[marker.robot].motion
    if marker.hook not in motion.hooks:
        raise ParamError(
            f"{at}.hook = '{marker.hook}': '{motion.name}' has the hooks {', '.join(motion.hooks)}"
        )
    space, own = SPACES.get(len(marker.position)), motion.space
    if space is None or space.d < own.d or not np.isfinite(marker.position).all():
        raise ParamError(
            f"{at}.position = {marker.position}: give {own.d} finite numbers, or 3 for sensors in "
            "space"
        )
    here = (marker.robot, marker.hook)
    others = (m for m in world.mounts.values() if (m.robot, m.hook) != here)
    mount = next((m.id for m in others if m.sensor.space is space), None)
    if mount is None:
        raise ParamError(
            f"{at}: no other robot has a sensor that measures {space.name} points, so nobody can "
            f"see it; leave it out, or give its position in as many dimensions as a sensor has"
        )
    seen_by = sensor_state(world, mount)
    feature = Feature(
        label=world.next_label,
        model=plain_point(space),
        mount=mount,
        pose0=frozen(seen_by.xws),
        z0=frozen(np.zeros(world.mounts[mount].sensor.measurement_size)),
        appearance=marker.identity,
        born=-1,
        known=True,
        carrier=marker.robot,
        offset=frozen(marker.position),
        hook=marker.hook,
    )
    alone = replace(world, features={feature.label: feature})
    h = observe(seen_by, groups(alone)[0], world.gauss.x).h[0]
    return replace(feature, z0=frozen(h))


def moved_markers(world: World, old: EstimatorSettings, new: EstimatorSettings) -> World:
    """The world with its markers where the new settings put them. Raises ParamError when they are
    others than before, or hang on nothing any more."""
    for name, marker in new.markers.items():
        motion = world.robots[marker.robot].motion if marker.robot in world.robots else None
        if motion is not None and marker.hook not in motion.hooks:
            raise ParamError(
                f"marker '{name}' is at the hook '{marker.hook}', which '{motion.name}' does not "
                f"have: it has {', '.join(motion.hooks)}"
            )
    if old.markers == new.markers:
        return world
    if [_fixed(m) for m in old.markers.values()] != [_fixed(m) for m in new.markers.values()]:
        raise ParamError("markers can not be added, removed or renamed while running: reset")
    labels = [label for label, f in world.features.items() if f.carrier]
    features = dict(world.features)
    for label, marker in zip(labels, new.markers.values(), strict=True):
        features[label] = replace(features[label], offset=frozen(marker.position))
    return replace(world, features=features)


def _fixed(marker: MarkerSettings) -> tuple[str, str, int, int]:
    return marker.robot, marker.hook, marker.identity, len(marker.position)
