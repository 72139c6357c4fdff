"""The scenarios that play a recording: what is believed of it, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from scene_core import params
from scene_core.filter.policies import (
    Association,
    Management,
    Policies,
    Selection,
)
from scene_core.geometry.spaces import TWO_D
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_2d import Point2D
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.params import ParamError
from scene_core.session import presets_identified as identified
from scene_core.session.alignment import Alignment
from scene_core.session.config import (
    EstimatorSettings,
    Experiment,
    KnownFeature,
    MountSettings,
    RobotSettings,
)
from scene_core.session.presets_parts import ALL
from scene_core.sources.calibration import Calibration, load_calibration
from scene_core.sources.datasets import Mrclam
from scene_core.sources.images import ImageSequence, video_frame_rate

ABOUT: Mapping[str, str] = {
    "images": "A hand-held camera's recording: features are found, matched and forgotten in real "
    "images.",
    "mrclam": "A real robot's log with identified landmarks: dead reckoning is corrected, the true "
    "path lies beside the estimate.",
    **identified.ABOUT,
}
NEEDS: Mapping[str, str] = {
    "images": "--images DIR|FILE --calib FILE",
    "mrclam": "--mrclam DIR [--robot N]",
    **identified.NEEDS,
}
"""The flags that name the files of a scenario."""


IMAGE_START_SD: Mapping[str, float] = {
    **{"vx": 0.2, "vy": 0.2, "vz": 0.2},
    **{"wx": 0.3, "wy": 0.3, "wz": 0.3},
}
"""m/s and rad/s: somebody holds the camera when a recording says nothing about its start."""


def images(
    path: str,
    calibration: str,
    reference: str = "",
    reference_time: bool = False,
    align: Alignment = "none",
) -> Experiment:
    """Monocular SLAM on a folder of images or a video, at the calibration's frame rate or else the
    video's own."""
    own_rate = video_frame_rate(path)
    known = load_calibration(calibration, path)
    sensor, rate = known.sensor, known.frame_rate or own_rate
    source = ImageSequence(
        path=path,
        width=sensor.width,
        height=sensor.height,
        reference=reference,
        reference_time=reference_time,
    )
    if rate is not None:
        source = replace(source, frame_rate=rate)
    policies = Policies(
        landmark=InverseDepth(rho_mean=0.5, rho_sd=0.5, pole="y" if known.up == "y" else "z"),
        selection=Selection(budget=12),
        association=Association("search"),
        management=Management(max_new_first=1 if known.known else 12),
    )
    estimator = EstimatorSettings(
        robots={
            source.robot: RobotSettings(Impulse(), known.start, known.start_sd or IMAGE_START_SD)
        },
        mounts={source.mount: MountSettings(sensor, source.robot, known.pose)},
        policies=policies,
        known=tuple(KnownFeature(k.position, k.patch, k.sd) for k in known.known),
        up="y" if known.up == "y" else "z",
    )
    estimator = _with_settings(estimator, known, calibration)
    about = f"{ABOUT['images']} Here: {Path(path).name}."
    return Experiment("images", about, estimator, source, align=align)


def _with_settings(
    estimator: EstimatorSettings, known: Calibration, file: str
) -> EstimatorSettings:
    for path, value in known.settings.items():
        try:
            estimator = params.replace(estimator, path, value)
        except ParamError as e:
            raise ParamError(f"{file}, [estimator] {e}") from e
    return estimator


def mrclam(path: str, robot: int = 2) -> Experiment:
    """A log of the UTIAS MRCLAM data set, started at the true pose.

    Noise per odometry sample and per sighting is chosen for these logs: with it the trajectories
    of robots 2, 3 and 5 of data set 6 come within .41, .43 and .27 m rms after alignment.
    """
    source = params.replace(Mrclam(path=path), "robot_number", robot)
    start = {s: float(x) for s, x in zip(TWO_D.labels, source.start_pose(), strict=True)}
    sensor = RangeBearing(
        sd_range=0.2, sd_bearing=0.08, reach_min=0.05, reach_max=9.0, field_of_view=2.0
    )
    policies = Policies(
        landmark=Point2D(),
        selection=Selection(budget=50),
        # The cameras see 65 degrees; while the heading is uncertain more must be expected, so a
        # search in vain means nothing.
        management=Management(
            keep_visible=ALL,
            max_new=20,
            max_new_first=20,
            min_match_ratio=0.0,
            min_accept_ratio=0.0,
        ),
    )
    return Experiment(
        name="mrclam",
        about=ABOUT["mrclam"],
        estimator=EstimatorSettings(
            robots={source.robot: RobotSettings(PlanarUnicycle(sd_v=0.07, sd_w=0.35), start)},
            mounts={source.mount: MountSettings(sensor, source.robot, (0.0, 0.0, 0.0))},
            policies=policies,
            up="z",
        ),
        source=source,
        align="se2",
    )
