"""The recordings whose landmarks say who they are: what is believed of each, and why."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from scene_core.arrays import Mat, Vec
from scene_core.filter.policies import (
    Association,
    Management,
    Policies,
    Selection,
    Update,
)
from scene_core.geometry.spaces import THREE_D, TWO_D
from scene_core.models.base import FeatureModel
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_2d import Point2D
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.motion.body_rates import BodyRates
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.increments_2d import PlanarIncrements
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.models.sensors.range_bearing_3d import RangeBearingElevation
from scene_core.models.sensors.stereo_pair import StereoPair
from scene_core.session.config import (
    EstimatorSettings,
    Experiment,
    KnownFeature,
    MountSettings,
    RobotSettings,
)
from scene_core.session.presets_parts import ALL
from scene_core.sources.mrpt import Mrpt, find_log
from scene_core.sources.planar_mono import PlanarMono
from scene_core.sources.starry_night import StarryNight
from scene_core.sources.tagbox import Tagbox

ABOUT: Mapping[str, str] = {
    "mrpt": "MRPT's own EKF-SLAM demonstration, in the plane or in space: watch ellipses of 4 cm "
    "shrink to millimetres round the true landmarks.",
    "planar_mono": "Odometry and a camera on a planar robot, a thousand points: watch rays shrink "
    "while the path keeps to the true one and dead reckoning would be 1.3 m off.",
    "starry_night": "A real stereo camera with measured body rates: watch twenty landmarks hold "
    "the path that the rates alone would lose by 1.6 m.",
    "tagbox": "A real hand-held camera round a box of tags, started from four known corners: "
    "watch the other 44 take their places to 2 mm.",
}
NEEDS: Mapping[str, str] = {
    "mrpt": "--mrpt DIR|FILE",
    "planar_mono": "--planar-mono DIR",
    "starry_night": "--starry-night FILE",
    "tagbox": "--tagbox DIR",
}
"""The flags that name the files of a scenario."""


def _mapping(landmark: FeatureModel, budget: int = ALL, most: int = ALL) -> Policies:
    """Identified landmarks are all mapped and all measured, and a search in vain means nothing."""
    return Policies(
        landmark=landmark,
        selection=Selection(budget=budget),
        association=Association("identity"),
        management=Management(
            keep_visible=ALL,
            max_new=100,
            max_new_first=200,
            max_features=most,
            min_match_ratio=0.0,
            min_accept_ratio=0.0,
        ),
    )


def mrpt(path: str) -> Experiment:
    """A log of MRPT's kf-slam demonstration, in the plane or in space.

    The sensor's noise and reach are those in the log's first line; that of the odometry is what
    the increments differ from the true path: 4 cm and .01 degrees in the plane, 6 cm and .1 degrees
    in space, per step. As in MRPT, nothing is aligned: both start at the origin.
    """
    source = Mrpt(path=find_log(path))
    told, own_axes = source.header, (0.0, 0.0, 0.0)
    reach = 1.1 * told["max_range"]
    common = {"sd_range": told["std_range"], "reach_min": 0.01, "reach_max": reach}
    # The last sighting at the edge may be expected outside.
    field = min(1.1 * told["fov_yaw"], 2.0 * math.pi)
    if source.is_planar:
        motion = PlanarIncrements(sd_ahead=0.04, sd_across=0.04, sd_turn=math.radians(0.01))
        sensor = RangeBearing(**common, sd_bearing=told["std_yaw"], field_of_view=field)
        landmark = Point2D()
    else:
        motion = Odometry3D(sd_position=0.06, sd_angle=math.radians(0.1))
        sensor = RangeBearingElevation(
            **common,
            sd_azimuth=told["std_yaw"],
            sd_elevation=told["std_pitch"],
            field_of_view=field,
            elevation_max=min(0.55 * told["fov_pitch"], 1.5),
        )
        landmark, own_axes = EuclideanPoint(), (*own_axes, 1.0, 0.0, 0.0, 0.0)
    return Experiment(
        name="mrpt",
        about=ABOUT["mrpt"],
        estimator=EstimatorSettings(
            robots={source.robot: RobotSettings(motion, {})},
            mounts={source.mount: MountSettings(sensor, source.robot, own_axes)},
            policies=_mapping(landmark),
            up="z",
        ),
        source=source,
    )


def planar_mono(path: str) -> Experiment:
    """A planar robot with odometry that carries a camera, started at its true pose.

    The odometry differs from the true increments by 2.2 cm ahead, .3 cm across and .022 rad. The
    pixels have no noise (they fit the truth to .02 px); 1.3 px stands for the linearisation, as a
    first step moves points by ten. One match after the other corrects the step before the next is
    linearised: .059 m and NEES 1.9 for .21 m and 35 with all at once, iterated. Points are first
    seen 2 to 10 m away: rho .16 +- .064.
    """
    source = PlanarMono(path=path)
    camera = source.camera
    sensor = replace(_pinhole(camera.K, camera.width, camera.height), sd_px=1.3)
    start = dict(zip(TWO_D.labels, source.start_pose().tolist(), strict=True))
    motion = PlanarIncrements(sd_ahead=0.0225, sd_across=0.003, sd_turn=0.0225)
    policies = _mapping(InverseDepth(rho_mean=0.2, rho_sd=0.12, linearity=0.02), most=300)
    # A landmark whose depth went wrong is started again.
    management = replace(
        policies.management, max_new=1, max_new_first=1, min_attempts=3, min_accept_ratio=0.6
    )
    policies = replace(policies, management=management, update=Update("sequential"))
    return Experiment(
        name="planar_mono",
        about=ABOUT["planar_mono"],
        estimator=EstimatorSettings(
            robots={source.robot: RobotSettings(motion, start)},
            mounts={source.mount: MountSettings(sensor, source.robot, _tuple(camera.pose))},
            policies=policies,
            up="z",
        ),
        source=source,
    )


def starry_night(path: str) -> Experiment:
    """A stereo camera whose velocity and turn rate are measured, started at its true pose.

    With the pose of every frame fitted to the true landmarks, pixels scatter by 1 px (7 to 12
    against the motion capture's pose, which errs alike for all of them). The rates differ from
    those of the motion capture by .02 to .05 m/s and .08 to .40 rad/s. So unsure turns want the
    axes carried (4.6 deg of orientation for 6.2, NEES 70 for 133); what is left of the NEES is
    the motion capture's own error, which the filter does not know of.
    """
    source = StarryNight(path=path)
    camera = source.camera
    sensor = StereoPair(
        width=800,
        height=600,
        u0=camera["cu"],
        v0=camera["cv"],
        f_u=camera["fu"],
        f_v=camera["fv"],
        baseline=camera["b"],
        sd_px=1.0,
        # Identities are read from any distance and direction.
        max_scale=0.0,
        max_angle=0.0,
        border=0.0,
    )
    start = dict(zip(THREE_D.labels, source.start_pose().tolist(), strict=True))
    return Experiment(
        name="starry_night",
        about=ABOUT["starry_night"],
        estimator=EstimatorSettings(
            robots={source.robot: RobotSettings(BodyRates(sd_v=0.05, sd_w=0.4), start)},
            mounts={source.mount: MountSettings(sensor, source.robot, _tuple(source.camera_pose))},
            policies=replace(_mapping(EuclideanPoint()), update=Update("iterated", invariant=True)),
            up="z",
        ),
        source=source,
    )


def tagbox(path: str) -> Experiment:
    """A hand-held camera round a box of tags, started from four of their corners.

    The corners, triangulated from the reference poses, fit to .38 px (two coordinates together).
    The pose at the start is that of twelve known points, good to 1 cm and 1 degree. The reference
    poses err by some millimetres themselves, more than the filter's sd: their NEES says nothing.
    """
    source = Tagbox(path=path)
    sensor = replace(_pinhole(source.K, 752, 480), sd_px=0.4)
    start = dict(zip(THREE_D.labels, source.start_pose().tolist(), strict=True))
    known = list(source.known().items())[:4]
    return Experiment(
        name="tagbox",
        about=ABOUT["tagbox"],
        estimator=EstimatorSettings(
            robots={
                source.robot: RobotSettings(
                    Impulse(sd_accel=1.0, sd_ang_accel=3.0), start, TAGBOX_START_SD
                )
            },
            mounts={source.mount: MountSettings(sensor, source.robot, (0, 0, 0, 1.0, 0, 0, 0))},
            policies=replace(
                _mapping(InverseDepth(rho_mean=2.0, rho_sd=0.7, linearity=0.05, pole="y")),
                update=Update("iterated"),
            ),
            known=tuple(KnownFeature(_tuple(place), identity) for identity, place in known),
            up="y",
        ),
        source=source,
    )


TAGBOX_START_SD: Mapping[str, float] = {
    **dict.fromkeys(("x", "y", "z"), 0.01),
    **dict.fromkeys(("rx", "ry", "rz"), 0.02),
    **dict.fromkeys(("vx", "vy", "vz"), 0.1),
    **dict.fromkeys(("wx", "wy", "wz"), 0.3),
}
"""m, rad, m/s and rad/s."""


def _pinhole(K: Mat, width: int, height: int) -> Pinhole:
    """A camera without distortion, with the calibration matrix K (3, 3)."""
    return Pinhole(
        width=width,
        height=height,
        u0=K[0, 2].item(),
        v0=K[1, 2].item(),
        f_u=K[0, 0].item(),
        f_v=K[1, 1].item(),
        # Identities are read from any distance and direction.
        max_scale=0.0,
        max_angle=0.0,
        border=0.0,
    )


def _tuple(a: Vec) -> tuple[float, ...]:
    return tuple(a.tolist())


RECORDINGS: Mapping[str, Callable[[str], Experiment]] = {
    "mrpt": mrpt,
    "planar_mono": planar_mono,
    "starry_night": starry_night,
    "tagbox": tagbox,
}
"""Scenarios that need one path, given by the flag of the same name."""
