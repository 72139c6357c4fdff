"""Robots and sensors neither ancestor had."""

from __future__ import annotations

import math
from collections.abc import Mapping

from scene_core.geometry.spaces import TWO_D
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_2d import Point2D
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.motion.arm import Arm
from scene_core.models.motion.head_mounted import HeadMounted
from scene_core.models.motion.inertial import Inertial
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.sensors.depth_camera import DepthCamera
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.session.config import Experiment
from scene_core.session.presets_parts import (
    FORWARD,
    Scenario,
    identified,
    known_points,
    mount,
    robot,
    seen_from_anywhere,
    simulated,
)
from scene_core.sources.buildings import CorridorPlan
from scene_core.sources.drivers import ConstantControls, Waypoints
from scene_core.sources.manual import Manual
from scene_core.sources.scattered import RandomWorld
from scene_core.sources.worlds import ThickCloister

ABOUT: Mapping[str, str] = {
    "arm": "A camera in the hand of an arm that does not know its gears: watch the ellipse of the "
    "hand, a function of three joint angles, and the three gears settle.",
    "corridor": "A robot goes round a corridor and sees a few metres: watch all ellipses behind it "
    "shrink when it comes back to the first landmarks.",
    "inertial": "A camera with an accelerometer and a gyro, which drift: watch six biases go to "
    "their true values, and the scale of the map with them.",
    "head_mounted": "Somebody wears a depth camera and goes and looks where they like: watch the "
    "filter keep up with what nobody tells it, by a law of how people walk and glance.",
}
START_SD: Mapping[str, float] = {
    **dict.fromkeys(("x", "y", "z"), 0.01),
    **dict.fromkeys(("rx", "ry", "rz"), math.radians(0.5)),
}


def arm() -> Experiment:
    """Three joints at commanded rates, gears believed 1 +- 0.1; points all around."""
    foot = {f"foot:{label}": sd for label, sd in START_SD.items()}
    joints = {f"q{i}": 0.01 for i in (1, 2, 3)}
    reach = ((0.55, 0.3, 1.1), (0.5, -0.3, 1.3), (0.3, -0.45, 1.0), (0.6, 0.0, 0.9))
    return simulated(
        "arm",
        ABOUT["arm"],
        ThickCloister(x0=-2.4, x1=2.4, y0=-2.4, y1=2.4, h=1.8),
        {
            "arm": robot(
                Arm(),
                Waypoints(reach),
                {"foot:z": 1.0, "q2": -0.8, "q3": 1.2},
                foot | joints,
                calib_sd={f"gear {i}": 0.1 for i in (1, 2, 3)},
                true_calib={"gear 1": 1.12, "gear 2": 0.9, "gear 3": 1.07},
            )
        },
        {"camera": mount(_camera(), "arm", (0.0, 0.0, 0.0, *FORWARD))},
        identified(InverseDepth(rho_mean=0.4, rho_sd=0.3, linearity=0.05), 10, update="iterated"),
    )


def corridor() -> Experiment:
    """Laps of 52 m; the scanner reaches 4 m ahead and to the sides."""
    plan = CorridorPlan()
    corners = plan.corners()
    z, x = corners[0]
    return simulated(
        "corridor",
        ABOUT["corridor"],
        plan,
        {
            "robot": robot(
                PlanarUnicycle(sd_v=0.05, sd_w=0.03, cruise=1.0, arrive=0.5, turn_rate=0.8),
                Waypoints((*corners[1:], corners[0])),
                {"z": z, "x": x},
                dict.fromkeys(TWO_D.labels, 0.01),
            )
        },
        {
            "scanner": mount(
                RangeBearing(sd_range=0.03, sd_bearing=0.01, reach_max=4.0, field_of_view=math.pi),
                "robot",
                (0.0, 0.0, 0.0),
            )
        },
        identified(Point2D(), 20, new=10, first=20, features=150),
        up="z",
    )


def inertial() -> Experiment:
    """Round the cloister at 1 m/s by what accelerometer and gyro report; biases unknown, three
    columns known."""
    world = ThickCloister(h=1.5)
    biases = {**{f"ba{i}": 0.1 for i in "xyz"}, **{f"bg{i}": 0.01 for i in "xyz"}}
    return simulated(
        "inertial",
        ABOUT["inertial"],
        world,
        {
            "body": robot(
                Inertial(),
                Manual(forward=1.0, turn=0.25),
                {"y": -4.0, "z": 0.6, "vx": 1.0},
                {**START_SD, **dict.fromkeys(("vx", "vy", "vz"), 0.05), **biases},
            )
        },
        {"camera": mount(_camera(), "body", (0.0, 0.0, 0.0, *FORWARD))},
        identified(InverseDepth(rho_mean=0.2, rho_sd=0.2, linearity=0.05), 10, update="iterated"),
        known=known_points(world, (19, 24, 36, 55, 60, 72)),
        dt=0.05,
    )


def head_mounted() -> Experiment:
    """Scene's unknown outside influence: the wearer's way is drawn from the law the filter assumes.

    A camera without depth would have to find the size of the world in the wearer's first steps,
    which are known too badly for that.
    """
    motion = HeadMounted(sd_speed=0.5, sd_turn=0.3)
    moves = {**dict.fromkeys(("vx", "vy", "vz"), 0.05), **dict.fromkeys(("wx", "wy", "wz"), 0.05)}
    camera = DepthCamera(
        **{"width": 640, "height": 480, "u0": 320.0, "v0": 240.0, "f_u": 220.0, "f_v": 220.0},
        reach_max=15.0,
        border=0.0,
    )
    return simulated(
        "head_mounted",
        ABOUT["head_mounted"],
        RandomWorld(count=200, extent=7.0, height=6.0),
        {"wearer": robot(motion, ConstantControls(), {"z": 3.0}, {**START_SD, **moves})},
        {"camera": mount(seen_from_anywhere(camera), "wearer", (0.0, 0.0, 0.0, *FORWARD))},
        identified(EuclideanPoint(), 12, new=2, first=12),
        dt=1.0 / 30.0,
    )


def _camera() -> Pinhole:
    return seen_from_anywhere(
        Pinhole(width=640, height=480, u0=320.0, v0=240.0, f_u=320.0, f_v=320.0, border=0.0)
    )


SCENARIOS: Mapping[str, Scenario] = {
    "arm": Scenario(arm),
    "corridor": Scenario(corridor, frames=600),
    "inertial": Scenario(inertial),
    "head_mounted": Scenario(head_mounted),
}
