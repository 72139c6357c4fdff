"""Robots and cameras that calibrate themselves: what is wrong with them is in the state."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from scene_core.filter.policies import Gate
from scene_core.geometry.spaces import TWO_D
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_2d import Point2D
from scene_core.models.internal.steering_encoder import SteeringEncoder
from scene_core.models.internal.wheel_speed import WheelSpeed
from scene_core.models.motion.ackermann import PlanarAckermann
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.session.config import Experiment
from scene_core.session.edits import with_seed
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
from scene_core.sources.drivers import ConstantControls, Waypoints
from scene_core.sources.worlds import Field, ThickCloister

ABOUT: Mapping[str, str] = {
    "car": "A car whose speedometer and steering are both wrong: watch two scales in the state "
    "find by how much, while encoders narrow each prediction.",
    "calibration": "A robot with a badly calibrated camera: watch focal lengths, centre and "
    "distortion find their values while the map is made.",
}


def car() -> Experiment:
    """A car on a course round a park: both scales believed 1 +- 0.05, truly 0.88 and 1.12."""
    return simulated(
        "car",
        ABOUT["car"],
        Field(step=5.0),
        {
            "car": robot(
                PlanarAckermann(sd_accel=0.2, sd_steer_rate=0.05, sd_slip=0.005),
                Waypoints(((12.0, 8.0), (12.0, -8.0), (-12.0, -8.0), (-12.0, 8.0))),
                {"z": 12.0, "x": 8.0, "phi": -math.pi / 2},
                {**dict.fromkeys(TWO_D.labels, 0.02), "v": 0.02, "delta": 0.01},
                calib_sd={"speed scale": 0.05, "steering scale": 0.05},
                true_calib={"speed scale": 0.88, "steering scale": 1.12},
            )
        },
        {
            "scanner": mount(
                RangeBearing(sd_range=0.1, sd_bearing=0.01, reach_max=15.0), "car", (0.0, 0.0, 0.0)
            )
        },
        identified(Point2D(), 10, new=5, first=20, features=60),
        felt={"wheel": ("car", WheelSpeed()), "steering": ("car", SteeringEncoder())},
        up="y",
    )


def calibration() -> Experiment:
    """The cloister's robot, which knows six points; all six numbers of its camera are in the
    state. The true ones are drawn, another lens for every seed."""
    image = {"width": 640, "height": 480, "u0": 320.0, "v0": 240.0, "border": 0.0}
    camera = Pinhole(**image, f_u=320.0, f_v=320.0, distortion=(-0.3, 0.1))
    lens_sd = {"u0": 5.0, "v0": 5.0, "fu": 8.0, "fv": 8.0, "d2": 0.02, "d4": 0.01}
    world, circle = ThickCloister(), ConstantControls({"dx": 0.08, "az": math.radians(0.9)})
    experiment = simulated(
        "calibration",
        ABOUT["calibration"],
        world,
        {"robot": robot(Odometry3D(), circle, {"y": -5.0}, noise_on="controls")},
        {
            "camera": mount(
                seen_from_anywhere(camera),
                "robot",
                (0.0, 0.0, 0.6, *FORWARD),
                calib_sd=lens_sd,
                true_calib_sd=lens_sd,
            )
        },
        replace(
            identified(
                InverseDepth(rho_mean=0.2, rho_sd=0.2, linearity=0.05), 10, update="iterated"
            ),
            gate=Gate(0.9999),
        ),
        # Without them the calibration converges all the same, but with a NEES of 13 for 6: the
        # map is made while nearly nothing is known of the lens.
        known=known_points(world, (19, 24, 36, 55, 60, 72), sd=0.002),
        frames=400,
    )
    return with_seed(experiment, 1)  # where the drawn lens is 1 to 2 sd from the believed one


SCENARIOS: Mapping[str, Scenario] = {
    "car": Scenario(car),
    "calibration": Scenario(calibration),
}
