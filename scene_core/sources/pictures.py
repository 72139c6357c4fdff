"""What a simulated camera delivers: rendered images, and patches whose true place is remembered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scene_core.arrays import Vec, frozen
from scene_core.filter.policies import Vision
from scene_core.filter.ports import Detection, Image, Match, Query, SourceError
from scene_core.geometry.spaces import THREE_D
from scene_core.models.base import Fault, Sensor
from scene_core.sources import noise
from scene_core.sources.corners import detect_corners
from scene_core.sources.pixel_rays import rays_of
from scene_core.sources.render import Rendering, render
from scene_core.sources.textured_scene import hit, scene_of
from scene_core.sources.vision import Patch, extract, search_patches
from scene_core.sources.worlds import SimulatedWorld


def photographable(world: SimulatedWorld) -> SimulatedWorld:
    """The same world. Raises SourceError when there is nothing in it to take pictures of."""
    if not world.surfaces():
        raise SourceError(
            f"the world '{world.name}' has no surfaces to render: choose one that has, such as "
            "'room', or leave the rendering out"
        )
    return world


def photographed(
    room: SimulatedWorld,
    sensor: Sensor,
    calib: Vec,
    poses: tuple[Vec, Vec],
    dt: float,
    how: Rendering,
    key: tuple[int, str, int],
) -> Image:
    """The image of a camera whose pose (7,) was poses[0] one frame ago and is poses[1] now."""
    rays = rays_of(sensor, tuple(calib.tolist()))
    before, now = poses
    return Image(render(scene_of(room), rays, now, before, dt, how, noise.rng(*key)))


def searched(
    image: Image, query: Query, vision: Vision, sensor: Sensor, calib: Vec, pose: Vec
) -> list[Match]:
    """Matches by correlation, each with where its landmark truly is in the image."""
    out = []
    for match, patch in zip(
        search_patches(image.pixels, query, vision), query.appearance, strict=True
    ):
        place = patch.place if isinstance(patch, Patch) else None
        if match.z is not None and place is not None:
            match = replace(match, true_z=projected(sensor, calib, pose, place))
        out.append(match)
    return out


def detected(
    image: Image,
    occupied: Vec,
    count: int,
    vision: Vision,
    key: tuple[int, int],
    where: tuple[SimulatedWorld, Sensor, Vec, Vec],
) -> list[Detection]:
    """New corners, each remembering its true place; `where` is room, camera, calibration, pose."""
    found = detect_corners(image.pixels, occupied, count, vision, key)
    return [_placed(d, *where) for d in found]


def pointed_at(
    image: Image, z: Vec, vision: Vision, where: tuple[SimulatedWorld, Sensor, Vec, Vec]
) -> Detection | None:
    """The patch around a pixel, remembering its true place."""
    found = extract(image.pixels, z, vision)
    return None if found is None else _placed(found, *where)


def patch_of(
    image: Image, place: Vec, name: str, sensor: Sensor, calib: Vec, pose: Vec, vision: Vision
) -> Patch:
    """The patch of a known place (3,) in an image taken from `pose`; its landmark is the place
    itself, not the middle of a pixel. Raises SourceError when the place is not in the image."""
    z = projected(sensor, calib, pose, place)
    found = None if z is None else extract(image.pixels, z, vision)
    if z is None or found is None:
        raise SourceError(
            f"the known landmark '{name}' is not in the first image: move the true start so that "
            "the camera sees it, or take the landmark out of the settings"
        )
    du, dv = (z - found.z).tolist()
    return replace(found.appearance, offset=(du, dv), place=frozen(place))


def projected(sensor: Sensor, calib: Vec, pose: Vec, place: Vec) -> Vec | None:
    """True pixel of a place (3,); None behind the camera."""
    X_W = np.append(place, 1.0)[None]
    X = THREE_D.to_local(pose, X_W).X
    h = sensor.project(X, calib).h
    fault = sensor.visibility(h, X, pose, pose[None], X_W)
    return None if fault[0] & Fault.BEHIND else h[0]


def known_places(room: SimulatedWorld, names: Sequence[str]) -> dict[str, Vec]:
    """Places (3,) by name; raises SourceError for a name the room does not have."""
    known = room.references()
    unknown = [n for n in names if n not in known]
    if unknown:
        there = ", ".join(known) or "none"
        raise SourceError(f"the {room.name} has no place '{unknown[0]}': it has {there}")
    return {n: known[n] for n in names}


def _placed(
    detection: Detection, room: SimulatedWorld, sensor: Sensor, calib: Vec, pose: Vec
) -> Detection:
    ray = sensor.backproject(detection.z[None], np.zeros((1, 1)), calib).X[0, :3]
    place = hit(scene_of(room), pose, ray)
    if place is None:
        return detection
    return replace(detection, appearance=replace(detection.appearance, place=frozen(place)))
