"""Markers on true robots: where they are, and which can not be."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.ports import SourceError
from scene_core.geometry.embedding import embed
from scene_core.geometry.spaces import Space
from scene_core.sources.truth import TrueMarker, TrueRobot, check_hook


def places(
    markers: Mapping[str, TrueMarker],
    robots: Mapping[str, TrueRobot],
    xv: Mapping[str, Vec],
    seen_from: tuple[str, str],
    space: Space,
    up: str,
) -> dict[int, Vec]:
    """Places (d,) in the world, by identity, of the markers that a sensor of a space can see at
    `seen_from`, a robot and its hook: those of the same space anywhere else on robots at xv."""
    out = {}
    for marker in markers.values():
        if (marker.robot, marker.hook) == seen_from or len(marker.position) != space.d:
            continue
        motion = robots[marker.robot].motion
        xp = motion.xp(xv[marker.robot], marker.hook).xp
        if motion.space is not space:
            xp = embed(xp, motion.space, up, space)[0]
        out[marker.identity] = space.to_world(xp, np.array([*marker.position, 1.0])).X[: space.d]
    return out


def check(
    markers: Mapping[str, TrueMarker], robots: Mapping[str, TrueRobot], landmarks: Collection[int]
) -> None:
    """Raise SourceError for a marker without a robot or a place on it, or whose identity one of
    the landmarks has."""
    taken = {int(identity) for identity in landmarks}
    for name, marker in markers.items():
        at = f"source.markers.{name}"
        if marker.robot not in robots:
            raise SourceError(f"{at}: there is no true robot '{marker.robot}'")
        motion = robots[marker.robot].motion
        check_hook(at, marker.hook, motion)
        d = motion.space.d
        if not d <= len(marker.position) <= 3:
            raise SourceError(f"{at}.position: give {d} numbers, or 3 for sensors in space")
        if marker.identity in taken:
            raise SourceError(
                f"{at}.identity = {marker.identity}: another marker or landmark has it already"
            )
        taken.add(marker.identity)
