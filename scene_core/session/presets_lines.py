"""Scenarios with straight lines: the toolbox's house, alone and with points on its walls.

Source: Solà, *An EKF-SLAM toolbox in Matlab*, its example with lines (`userDataLin`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from scene_core.filter.policies import Association, Gate, Management, Policies, Selection, Update
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.inverse_depth_line import InverseDepthLine
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.session.config import Experiment
from scene_core.session.presets_parts import (
    ALL,
    MountParts,
    Pose,
    RobotParts,
    Scenario,
    mount,
    robot,
    seen_from_anywhere,
    simulated,
)
from scene_core.sources.buildings import House
from scene_core.sources.drivers import ConstantControls

ABOUT: Mapping[str, str] = {
    "house": "A robot looks sideways at a house of 23 edges while it drives round it: watch lines "
    "of unknown distance fall into place, though nobody ever sees where they end.",
    "points_and_lines": "The same house with points on its walls: watch edges and points of one "
    "map hold each other, the most informative of both measured first.",
}
FRAMES = 400
"""A lap and a bit, as in the toolbox."""
CIRCLE = ConstantControls({"dx": 0.1, "az": math.radians(1.0)})
SIDEWAYS: Pose = (0.0, 0.0, 1.5, math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)
"""A camera 1.5 m up that looks to the left of a robot with x forward, y left, z up."""


def house() -> Experiment:
    """The toolbox's run round its house, with its odometry, camera and choices."""
    return simulated(
        "house",
        ABOUT["house"],
        House(x=-2.0, y=-2.0),
        {"robot": _robot()},
        {"camera": _camera()},
        _policies(Selection(budget=10, score="determinant")),
        frames=FRAMES,
    )


def points_and_lines() -> Experiment:
    """The same with 40 points on the walls."""
    return simulated(
        "points_and_lines",
        ABOUT["points_and_lines"],
        House(x=-2.0, y=-2.0, marks=40),
        {"robot": _robot()},
        {"camera": _camera()},
        # Determinants of points, in px^4, and of lines, in rad^4, do not compare.
        _policies(Selection(budget=12, score="information")),
        frames=FRAMES,
    )


def _robot() -> RobotParts:
    """To the left of the house, driving round it counter-clockwise."""
    start = {"x": -7.0, "qw": math.cos(math.pi / 4), "qz": -math.sin(math.pi / 4)}
    motion = Odometry3D(sd_position=0.002, sd_angle=math.radians(0.02))
    return robot(motion, CIRCLE, start, noise_on="controls")


def _camera() -> MountParts:
    camera = Pinhole(
        width=640, height=480, u0=320.0, v0=240.0, f_u=320.0, f_v=320.0, sd_px=0.2, border=0.0
    )
    parts = mount(seen_from_anywhere(camera), "robot", SIDEWAYS)
    return parts._replace(true=replace(parts.true, shortest=10.0))


def _policies(selection: Selection) -> Policies:
    """The toolbox's choices, but that both ends of a line may be nearer or farther than its."""
    return Policies(
        landmark=InverseDepth(rho_mean=0.1, rho_sd=0.5),
        line=InverseDepthLine(rho_mean=0.1, rho_sd=0.5),
        selection=selection,
        association=Association("identity"),
        gate=Gate(confidence=-math.expm1(-4.5)),
        update=Update("sequential"),
        management=Management(
            keep_visible=ALL,
            max_new=1,
            max_new_first=1,
            max_features=80,
            min_attempts=10,
            min_match_ratio=0.1,
            min_accept_ratio=0.5,
        ),
    )


SCENARIOS: Mapping[str, Scenario] = {
    "house": Scenario(house),
    "points_and_lines": Scenario(points_and_lines),
}
