"""The toolbox's cloister with more than one robot, more than one camera, or a wider view.

Source: Solà, *An EKF-SLAM toolbox in Matlab*, its examples of two robots, of two cameras on one
robot, and of an omnidirectional camera. There the simulated extrinsics are those the estimator
starts with; here they are not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from scene_core.filter.policies import Association, Gate, Management, Policies, Selection, Update
from scene_core.models.base import FeatureModel
from scene_core.models.features.anchored_homogeneous import AnchoredHomogeneous
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.sensors.omnidirectional import Omnidirectional
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.session.config import Experiment
from scene_core.session.presets_parts import (
    ALL,
    FORWARD,
    Pose,
    RobotParts,
    Scenario,
    mount,
    off,
    robot,
    seen_from_anywhere,
    simulated,
)
from scene_core.sources.drivers import ConstantControls
from scene_core.sources.worlds import ThickCloister

ABOUT: Mapping[str, str] = {
    "cloister": "The toolbox's robot drives a circle among 72 points: watch rays shrink to "
    "ellipsoids, and the error stay inside its bounds.",
    "two_robots": "Two robots on one circle share a map: watch what one has mapped hold the other, "
    "and how the second finds out where its camera points.",
    "two_cameras": "One robot with two cameras: watch the orientation of the second, 1.5 degrees "
    "unsure at first, be found within seconds.",
    "omnidirectional": "The robot of the cloister with a camera that sees 190 degrees: watch "
    "points stay in view until they are behind it.",
}
FRAMES = 400
"""A lap, as in the toolbox."""
CAMERA_POSE: Pose = (0.0, 0.0, 0.6, *FORWARD)
CIRCLE = ConstantControls({"dx": 0.08, "az": math.radians(0.9)})
UNSURE = math.radians(1.5)
"""How well the orientation of a camera is known that is estimated."""
GATE = -math.expm1(-4.5)
"""The toolbox's gate of two degrees of freedom, d2 < 9."""
NEAR = InverseDepth(rho_mean=0.2, rho_sd=0.2, linearity=0.1, pole="z")
"""The toolbox's prior, 0.01 +- 0.5, has half of its weight behind the camera."""
ASTRAY = (UNSURE, -0.8 * UNSURE, 1.1 * UNSURE)
"""How far off it really is: as much as was to be expected."""


def cloister() -> Experiment:
    """The default experiment of Solà's toolbox (`userData`): a circle in a cloister of 72 points.

    Source: An EKF-SLAM toolbox in Matlab, section 4 and appendix (userData.m).
    """
    return simulated(
        "cloister",
        ABOUT["cloister"],
        ThickCloister(),
        {"robot": _robot()},
        # New landmarks keep 1/25 of the width from the border, as in the toolbox.
        {"camera": mount(_camera(-0.3, 0.1), "robot", CAMERA_POSE, margin=640 / 25)},
        _policies(InverseDepth(rho_mean=0.01, rho_sd=0.5, linearity=0.1, pole="z"), GATE),
        frames=FRAMES,
    )


def two_robots() -> Experiment:
    """Opposite each other on the circle; the second robot's camera has its orientation in the
    state, and both see what either has mapped."""
    astray = off(CAMERA_POSE, ASTRAY)
    return simulated(
        "two_robots",
        ABOUT["two_robots"],
        ThickCloister(),
        {"first": _robot(), "second": _robot(0.0, 5.0, math.pi)},
        {
            "camera 1": mount(_camera(), "first", CAMERA_POSE, margin=640 / 25),
            "camera 2": mount(
                _camera(),
                "second",
                CAMERA_POSE,
                pose_sd=dict.fromkeys(("rx", "ry", "rz"), UNSURE),
                true_pose=astray,
                margin=640 / 25,
            ),
        },
        _policies(NEAR),
        frames=FRAMES,
    )


def two_cameras() -> Experiment:
    """Side by side and both ahead; the orientation of the right one is in the state."""
    left, right = ((0.0, y, 0.6, *FORWARD) for y in (0.2, -0.2))
    return simulated(
        "two_cameras",
        ABOUT["two_cameras"],
        ThickCloister(),
        {"robot": _robot()},
        {
            "left": mount(_camera(), "robot", left, margin=640 / 25),
            "right": mount(
                _camera(),
                "robot",
                right,
                pose_sd=dict.fromkeys(("rx", "ry", "rz"), UNSURE),
                true_pose=off(right, ASTRAY),
                margin=640 / 25,
            ),
        },
        _policies(NEAR),
        frames=FRAMES,
    )


def omnidirectional() -> Experiment:
    """Its axis ahead: all that is not behind the robot is in view."""
    return simulated(
        "omnidirectional",
        ABOUT["omnidirectional"],
        ThickCloister(),
        {"robot": _robot()},
        {
            "camera": mount(
                seen_from_anywhere(Omnidirectional()), "robot", CAMERA_POSE, margin=1280 / 25
            )
        },
        # It sees points beside it, 0.85 and 1.2 m away: 3 and 5 sd off a prior of 0.2 +- 0.2.
        _policies(AnchoredHomogeneous(rho_mean=0.4, rho_sd=0.6, linearity=0.1)),
        frames=FRAMES,
    )


def _robot(x: float = 0.0, y: float = -5.0, heading: float = 0.0) -> RobotParts:
    """Driving round the circle exactly as commanded, its odometry noisy."""
    start = {"x": x, "y": y, "z": 0.0}
    if heading:
        start |= {"qw": math.cos(heading / 2), "qz": math.sin(heading / 2)}
    return robot(Odometry3D(), CIRCLE, start, noise_on="controls")


def _camera(*distortion: float) -> Pinhole:
    return seen_from_anywhere(
        Pinhole(
            width=640,
            height=480,
            u0=320.0,
            v0=240.0,
            f_u=320.0,
            f_v=320.0,
            distortion=distortion,
            sd_px=1.0,
            border=0.0,
        )
    )


def _policies(landmark: FeatureModel, confidence: float = 0.9999) -> Policies:
    """The toolbox's choices, but for the update: stacked, it is over-confident. Its gate, d2 < 9,
    rejects one good match in ninety, and so does harm where every match is good."""
    return Policies(
        landmark=landmark,
        selection=Selection(budget=10, score="determinant"),
        association=Association("identity"),
        gate=Gate(confidence=confidence),
        update=Update("iterated"),
        management=Management(
            keep_visible=ALL,
            max_new=1,
            max_new_first=5,
            max_features=73,
            min_attempts=10,
            min_match_ratio=0.1,
            min_accept_ratio=0.5,
        ),
    )


SCENARIOS: Mapping[str, Scenario] = {
    "cloister": Scenario(cloister),
    "two_robots": Scenario(two_robots),
    "two_cameras": Scenario(two_cameras),
    "omnidirectional": Scenario(omnidirectional),
}
