"""What the filter reaches on real and published recordings, against what others reached."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scene_core.arrays import Vec
from scene_core.filter.ports import EndOfData
from scene_core.filter.predict import predict
from scene_core.session import presets_identified as recorded
from scene_core.session import toml_io
from scene_core.session.config import Experiment
from scene_core.session.landmarks import landmark_errors
from scene_core.session.report import report
from scene_core.session.session import Session
from scene_core.session.start import initial_world

Recordings = Callable[[str], Path]


def played(experiment: Experiment) -> Session:
    session = Session(experiment)
    try:
        while True:
            session.advance()
    except EndOfData:
        return session


def map_errors(session: Session) -> Vec:
    assert session.trace is not None
    return landmark_errors(session.world, session.trace.frame.truth)


def dead_reckoning(experiment: Experiment) -> float:
    """Position rmse [m] of the prediction alone."""
    world, source, errors = initial_world(experiment), experiment.source, []
    (robot,) = world.robots.values()
    for k in range(experiment.frames or source.frame_count or 0):
        frame, _ = source.advance(None, k)
        world, _ = predict(world, frame)
        if frame.truth is not None and robot.id in frame.truth.xp:
            e = robot.motion.space.difference(frame.truth.xp[robot.id], world.xp(robot.id))
            errors.append(np.linalg.norm(e[: robot.motion.space.d]))
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize(
    ("log", "peer", "count"), [("kf-slam_demo", 0.0037, 70), ("kf-slam_6D_demo", 0.0102, 48)]
)
def test_mrpt_is_met_on_its_own_demonstrations(
    recordings: Recordings, log: str, peer: float, count: int
) -> None:
    """Mean landmark error of MRPT 2.5.8's kf-slam, which aligns nothing, with its own settings."""
    experiment = recorded.mrpt(str(recordings("mrpt_kfslam") / f"{log}.txt"))
    session = played(experiment)
    errors, figures = map_errors(session), report(session, 1.0)
    assert len(errors) == count and errors.mean() <= 1.05 * peer
    assert 0.9 < figures["nis_mean"] / figures["nis_dof"] < 1.1
    assert figures["pos_rmse_m"] < 0.05 * dead_reckoning(experiment)


def test_a_planar_robot_with_a_camera_beats_its_odometry(recordings: Recordings) -> None:
    experiment = recorded.planar_mono(str(recordings("planar_mono_slam")))
    session = played(experiment)
    figures, errors = report(session, 1.0), map_errors(session)
    assert figures["pos_rmse_m"] <= dead_reckoning(experiment) / 15
    assert 0.75 < figures["nis_mean"] / figures["nis_dof"] < 1.25
    assert figures["nees_mean"] < 1.4 * figures["nees_dof"]
    assert len(errors) > 100 and errors.mean() < 0.2 and errors.max() < 0.5


def test_a_stereo_camera_beats_its_rates(recordings: Recordings) -> None:
    experiment = recorded.starry_night(str(recordings("starry_night") / "dataset3.mat"))
    session = played(experiment)
    figures, errors = report(session, 1.0), map_errors(session)
    assert figures["pos_rmse_m"] <= dead_reckoning(experiment) / 3
    assert 0.75 < figures["nis_mean"] / figures["nis_dof"] < 1.25
    assert len(errors) == 20 and errors.mean() < 0.08 and errors.max() < 0.15


def test_four_corners_of_the_tag_box_are_enough(recordings: Recordings) -> None:
    """Against the poses of twelve known points, image by image; those are good to about 1 mm."""
    session = played(recorded.tagbox(str(recordings("mono_tagbox"))))
    figures, errors = report(session, 1.0), map_errors(session)
    assert figures["pos_rmse_m"] < 0.004 and figures["ori_rmse_deg"] < 0.4
    assert len(errors) == 8 and errors.max() < 0.005
    assert figures["landmarks"] == 48 and figures["nis_mean"] < 2.0


MADE: dict[str, tuple[Callable[[str], Experiment], str]] = {
    "mrpt": (recorded.mrpt, "mrpt_kfslam"),
    "planar_mono": (recorded.planar_mono, "planar_mono_slam"),
    "starry_night": (recorded.starry_night, "starry_night/dataset3.mat"),
    "tagbox": (recorded.tagbox, "mono_tagbox"),
}


@pytest.mark.parametrize("name", recorded.RECORDINGS)
def test_recordings_are_settings_files(recordings: Recordings, name: str) -> None:
    make, path = MADE[name]
    experiment = make(str(recordings(path)))
    assert experiment.name == name and experiment.about == recorded.ABOUT[name]
    assert toml_io.loads(toml_io.dumps(experiment)) == experiment
    assert toml_io.loads(toml_io.dumps(replace(experiment, frames=3))).frames == 3
