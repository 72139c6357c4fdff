"""Small worlds for the filter's tests: a camera with everything in the state, and a toy source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scene_core.arrays import Vec, frozen
from scene_core.filter.policies import Association, Management, Policies, Vision
from scene_core.filter.ports import Detection, Frame, Match, Occupied, Points, Query
from scene_core.filter.world import Feature, Gaussian, Layout, Mount, Robot, World
from scene_core.geometry.spaces import THREE_D
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.motion.impulse import Impulse
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.sources.points import detect_identities, match_identities

CAMERA_ON_FLU = np.array([0.05, -0.02, 0.1, 0.5, -0.5, 0.5, -0.5])


def camera_world(seed: int = 0, points: int = 4, rays: int = 3, whole: bool = True) -> World:
    """A hand-held camera looking along x at `points` Euclidean and `rays` inverse-depth features,
    with random correlations. `whole`: sensor pose and calibration are in the state too."""
    rng = np.random.default_rng(seed)
    motion, sensor = Impulse(), Pinhole()
    euclid, inverse = EuclideanPoint(), InverseDepth()
    sizes = {"robot:cam": motion.state_size}
    if whole:
        sizes |= {"mount:eye:pose": 7, "mount:eye:calib": len(sensor.calib_labels)}
    models = [euclid] * points + [inverse] * rays
    sizes |= {f"feature:{i + 1}": m.state_size for i, m in enumerate(models)}
    layout = Layout.of(sizes)
    x = np.zeros(layout.size)
    xv = np.concatenate([0.1 * rng.standard_normal(3), [1, 0, 0, 0], rng.standard_normal(6)])
    xv[3:7] += 0.05 * rng.standard_normal(4)
    x[layout["robot:cam"].slice] = motion.normalise(xv).value
    if whole:
        x[layout["mount:eye:pose"].slice] = CAMERA_ON_FLU
        x[layout["mount:eye:calib"].slice] = sensor.calib0
    for i, model in enumerate(models):
        block = layout[f"feature:{i + 1}"]
        if model is euclid:
            x[block.slice] = np.array([4.0, 0, 0]) + rng.uniform(-1, 1, 3)
        else:
            x[block.slice] = [*(0.1 * rng.standard_normal(3)), *rng.uniform(-0.3, 0.3, 2), 0.25]
    A = 0.02 * rng.standard_normal((layout.size, layout.size))
    xws = np.concatenate([[0, 0, 0], CAMERA_ON_FLU[3:]])
    features = {
        i + 1: Feature(i + 1, m, "eye", frozen(xws), frozen([0, 0]), i, 0)
        for i, m in enumerate(models)
    }
    return World(
        frame=0,
        time=0.0,
        gauss=Gaussian(frozen(x), frozen(A @ A.T), layout),
        robots={"cam": Robot("cam", motion)},
        mounts={"eye": Mount("eye", sensor, "cam", "base", frozen(CAMERA_ON_FLU))},
        instruments={},
        features=features,
        policies=Policies(landmark=inverse, association=Association("identity")),
        next_label=len(models) + 1,
    )


@dataclass(frozen=True)
class ToySource:
    """Points that are handed over as they are."""

    frame_count: int | None = None
    frame_rate: float = 30.0
    clicks: tuple[Detection, ...] = field(default=())

    def start(self) -> None:
        return None

    def advance(self, state: None, index: int) -> tuple[Frame, None]:
        raise NotImplementedError

    def search(self, frame: Frame, query: Query, vision: Vision) -> Sequence[Match]:
        raw = frame.raw[query.mount]
        assert isinstance(raw, Points)
        return match_identities(raw, query)

    def detect(
        self, frame: Frame, mount: str, occupied: Occupied, count: int, vision: Vision
    ) -> Sequence[Detection]:
        raw = frame.raw[mount]
        assert isinstance(raw, Points)
        return detect_identities(raw, occupied, count)

    def appearance_at(self, frame: Frame, mount: str, z: Vec, vision: Vision) -> Detection | None:
        return self.clicks[0] if self.clicks else None


def without_new(world: World) -> World:
    """The same world, never starting a feature."""
    management = replace(world.policies.management, keep_visible=0)
    return replace(world, policies=replace(world.policies, management=management))


def management(world: World, **changes: object) -> World:
    """The same world under other rules."""
    rules: Management = replace(world.policies.management, **changes)
    return replace(world, policies=replace(world.policies, management=rules))


def sensor_pose(world: World) -> Vec:
    xp = world.xp("cam")
    return THREE_D.compose(xp, world.mount_pose("eye")).x
