"""Scene's ladder of robots: on a line, in the plane, on undulating ground."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from scene_core.models.base import InternalMeasurementModel
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_1d import Point1D
from scene_core.models.features.point_2d import Point2D
from scene_core.models.internal.roll_pitch import RollPitch
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.nomad_3d import TerrainNomad
from scene_core.models.motion.velocity_1d import Velocity1D
from scene_core.models.sensors.distance_1d import Distance1D
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.models.sensors.stereo_head import StereoHead
from scene_core.session.config import Experiment
from scene_core.session.presets_parts import OWN_AXES, Scenario, identified, mount, robot, simulated
from scene_core.sources.drivers import Shuttle, Waypoints
from scene_core.sources.terrain import Terrain, on_ground
from scene_core.sources.worlds import Field, Line

ABOUT: Mapping[str, str] = {
    "line": "A cart on a line measures six landmarks: the smallest SLAM there is; watch the "
    "covariance matrix fill.",
    "nomad": "A planar robot finds out that it is slower than it believes: its velocity scale is "
    "part of the state and goes from 1.0 to 0.9.",
    "terrain": "Scene's robot with its stereo head on undulating ground, where every step tilts "
    "it: watch roll, pitch and height stay uncertain between the landmarks.",
    "terrain_roll_pitch": "The same drive with an inclinometer: watch roll and pitch pinned "
    "down, and the height with them.",
}
IN_PLANE = (0.0, 0.0, 0.0)
"""Where a planar sensor sits that is the robot's own."""


def line() -> Experiment:
    """Scene's one-dimensional tutorial world."""
    return simulated(
        "line",
        ABOUT["line"],
        Line(),
        {"robot": robot(Velocity1D(), Shuttle(), {"z": 0.0})},
        {"range": mount(Distance1D(), "robot", (0.0,))},
        identified(Point1D(), 10, new=2, first=10),
    )


def nomad() -> Experiment:
    """Scene's planar robot with its velocity scale in the state: truth 0.9, belief 1.0 +- 0.2."""
    corners = ((3.2, 2.4), (3.2, -2.4), (-3.2, -2.4), (-3.2, 2.4))
    return simulated(
        "nomad",
        ABOUT["nomad"],
        Field(),
        {
            "nomad": robot(
                PlanarNomad(),
                Waypoints(corners),
                {"z": 3.2, "x": 2.4, "S": -math.pi / 2, "T": -math.pi / 2},
                calib_sd={"speed scale": 0.2},
                true_calib={"speed scale": 0.9},
            )
        },
        {
            "scanner": mount(
                RangeBearing(sd_range=0.05, sd_bearing=0.02, reach_max=4.0), "nomad", IN_PLANE
            )
        },
        identified(Point2D(), 20, new=5, first=20, features=60),
        up="y",
    )


def terrain() -> Experiment:
    """Scene's Nomad in space, with nothing but its head to tell it how it leans."""
    return _on_terrain("terrain", {})


def terrain_roll_pitch() -> Experiment:
    """The same with Scene's inclinometer."""
    return _on_terrain("terrain_roll_pitch", {"inclinometer": ("nomad", RollPitch(up="y"))})


def _on_terrain(name: str, felt: Mapping[str, tuple[str, InternalMeasurementModel]]) -> Experiment:
    """The true ground is smooth; the filter takes it for a random fold at every step."""
    # The ground is smoother than Scene's, whose folds of 0.5 rad/m would be cautious: here it folds
    # by 0.04 rad/m about each axis, and on in the same sense for a metre and more.
    world, motion = Terrain(), TerrainNomad(cruise=0.4, slope=0.12, sd_v=0.05)
    standing = np.array([4.0, 0.0, -3.5, 1.0, 0.0, 0.0, 0.0, 0.0])
    start = dict(
        zip(motion.state_labels, on_ground(world, "y", motion, standing).tolist(), strict=True)
    )
    course = ((4.0, 0.0, 3.5), (-3.5, 0.0, 4.0), (-4.0, 0.0, -3.5), (3.5, 0.0, -4.0))
    return simulated(
        name,
        ABOUT[name],
        world,
        {
            "nomad": robot(
                motion,
                Waypoints(course),
                start,
                # The ground gives the height and the lean of a place that is 0.01 m unsure.
                {
                    **dict.fromkeys(("x", "z", "ry"), 0.01),
                    **dict.fromkeys(("y", "rx", "rz"), 0.001),
                },
                on_ground=True,
            )
        },
        # Beyond a limit of the vergence only the too large ones would be measured.
        {
            "head": mount(
                StereoHead(max_scale=0.0, max_angle=0.0, reach_max=50.0), "nomad", HEAD_POSE
            )
        },
        identified(
            InverseDepth(linearity=0.1, pole="y"),
            8,
            new=1,
            features=100,
            update="iterated",
            invariant=True,
        ),
        felt=felt,
        up="y",
    )


HEAD_POSE = (0.0, 0.8, *OWN_AXES[2:])
"""The head 0.8 m above the ground, its axes those of the turret."""

SCENARIOS: Mapping[str, Scenario] = {
    "line": Scenario(line, frames=300),
    "nomad": Scenario(nomad, frames=600),
    "terrain": Scenario(terrain),
    "terrain_roll_pitch": Scenario(terrain_roll_pitch),
}
