"""Every scenario starts, runs, and keeps the promises its sentence makes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from scene_core import params
from scene_core.filter.ports import SourceError
from scene_core.geometry.spaces import THREE_D
from scene_core.params import ParamError
from scene_core.session import presets
from scene_core.session.config import KnownFeature, MountSettings, RobotSettings
from scene_core.session.edits import set_param, with_seed
from scene_core.session.session import Session
from scene_core.session.start import initial_world

TESTSEQ = str(Path(__file__).parents[1] / "recordings" / "testseq.toml")


@pytest.mark.parametrize("name", presets.loadable())
def test_scenarios_start_and_run(name: str) -> None:
    experiment = presets.build(name)
    assert experiment.name == name and experiment.about == presets.ABOUT[name]
    session = Session(experiment)
    for _ in range(5):
        session.advance()
    assert session.metrics.totals()["accepted"] > 4
    assert np.linalg.eigvalsh(session.world.gauss.P).min() > -1e-9


@pytest.mark.parametrize("name", presets.loadable())
def test_truth_and_estimate_share_no_settings(name: str) -> None:
    """An edit of the truth leaves the estimator alone, and the other way round."""
    experiment = presets.build(name)
    for root, other in (("estimator", "source"), ("source", "estimator")):
        for spec in params.schema(getattr(experiment, root), root):
            if isinstance(spec.value, float) and spec.hi is not None:
                # A hair is enough, and keeps a smallest value below its largest.
                edited = set_param(experiment, spec.path, math.nextafter(spec.value, spec.hi))
                assert getattr(edited, other) is getattr(experiment, other)


def test_the_cloister_is_the_toolboxs() -> None:
    experiment = presets.build("cloister")
    assert experiment.frames == 400
    start = initial_world(experiment).gauss
    np.testing.assert_array_equal(start.x, [0.0, -5.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    assert not start.P.any()
    camera = experiment.estimator.mounts["camera"].sensor
    np.testing.assert_array_equal(camera.calib0, [320, 240, 320, 320, -0.3, 0.1])
    gate = experiment.estimator.policies.gate.confidence
    assert -2.0 * math.log1p(-gate) == pytest.approx(9.0)


def test_the_house_is_the_toolboxs_and_its_lines_are_mapped() -> None:
    session = Session(presets.build("house"))
    for _ in range(40):
        session.advance()
    features = session.world.features.values()
    assert len(features) > 12 and {f.model.shape for f in features} == {"segment"}
    assert session.metrics.totals()["accepted"] > 200
    error = session.metrics.series().robots["robot"].error
    assert error is not None and np.linalg.norm(error[-1, :3]) < 0.03


def test_points_and_lines_are_mapped_and_measured_together() -> None:
    session = Session(presets.build("points_and_lines"))
    kinds: set[str] = set()
    for _ in range(20):
        trace = session.advance()
        kinds |= {
            trace.world.features[a.label].model.shape
            for a in trace.associations()
            if a.verdict == "accepted"
        }
    assert kinds == {"point", "segment"}


def test_the_room_starts_from_the_poster_and_is_rendered() -> None:
    session = Session(presets.build("room"))
    assert sorted(session.world.features) == [1, 2, 3, 4]
    for _ in range(12):
        session.advance()
    assert session.world.features[1].known and session.world.features[1].updates > 4
    error = session.metrics.series().robots["hand"].error
    assert error is not None and np.linalg.norm(error[-1, :3]) < 0.05


def test_the_nomad_finds_its_velocity_scale() -> None:
    session = Session(presets.build("nomad"))
    for _ in range(80):
        session.advance()
    mean, sd, true = session.metrics.series().calibrations["robot:nomad:calib speed scale"]
    assert true is not None and true[-1] == 0.9
    assert sd[-1] < 0.03 and abs(mean[-1] - 0.9) < 3.5 * sd[-1]


def test_recorded_images_start_from_the_known_target(recordings: Callable[[str], Path]) -> None:
    folder = recordings("mono_scenelib_testseq")
    experiment = presets.images(str(folder / "frames"), TESTSEQ)
    session = Session(with_seed(experiment, 2))
    for _ in range(4):
        session.advance()
    assert [f.known for f in session.world.features.values()][:4] == [True] * 4
    assert session.world.features[1].updates >= 3


CAMERA = '[camera]\nmodel = "pinhole"\nwidth = 96\nheight = 64\nu0 = 48.0\n'
CAMERA += "v0 = 32.0\nf_u = 80.0\nf_v = 80.0\n"


def test_a_video_runs_at_its_own_rate_unless_the_calibration_says_another(tmp_path: Path) -> None:
    video, calib = tmp_path / "grey.avi", tmp_path / "camera.toml"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 12.5, (96, 64))
    if not writer.isOpened():
        pytest.skip("OpenCV can not write videos here")
    for _ in range(3):
        writer.write(np.full((64, 96, 3), 90, np.uint8))
    writer.release()
    calib.write_text(CAMERA)
    assert presets.images(str(video), str(calib)).source.frame_rate == 12.5
    calib.write_text(f"{CAMERA}frame_rate_hz = 20.0\n")
    assert presets.images(str(video), str(calib)).source.frame_rate == 20.0


def test_a_missing_folder_of_images_is_named_before_what_was_expected_in_it() -> None:
    with pytest.raises(SourceError, match=r"^/nowhere can not be read"):
        presets.images("/nowhere", TESTSEQ)


def test_a_log_starts_at_its_true_pose(recordings: Callable[[str], Path]) -> None:
    experiment = presets.mrclam(str(recordings("mrclam_dataset6")), 3)
    session = Session(experiment)
    trace = session.advance()
    assert trace.frame.truth is not None and experiment.align == "se2"
    start = initial_world(experiment).gauss.mean("robot:robot")
    np.testing.assert_allclose(start, trace.frame.truth.xp["robot"])


@pytest.mark.parametrize(
    ("path", "value", "complaint"),
    [
        ("robots", {"nomad": {"start": {"qq": 1.0}}}, "start has no component 'qq'"),
        ("robots", {"nomad": {"start": {"z": math.nan}}}, "give finite numbers"),
        ("robots", {"nomad": {"start_sd": {"rx": 1.0}}}, "start_sd has no component 'rx'"),
        ("robots", {"nomad": {"start_sd": {"z": -1.0}}}, "a standard deviation is finite"),
        ("robots", {"nomad": {"calib_sd": {"v": 1.0}}}, "calib_sd has no component 'v'"),
        ("mounts", {"scanner": {"robot": "cat"}}, "there is no such robot, only nomad"),
        ("mounts", {"scanner": {"hook": "roof"}}, "'planar nomad' has the hooks base"),
        ("mounts", {"scanner": {"pose": (0.0,)}}, "give 3 finite numbers"),
        ("mounts", {"scanner": {"pose_sd": {"w": 1.0}}}, "pose_sd has no component 'w'"),
        ("known", (KnownFeature((1.0,), 1),), "known 1.position: give 2 finite numbers"),
    ],
)
def test_settings_that_do_not_fit_together(path: str, value: object, complaint: str) -> None:
    estimator = presets.build("nomad").estimator
    if isinstance(value, dict):
        old: dict[str, RobotSettings | MountSettings] = dict(getattr(estimator, path))
        value = {k: dataclasses.replace(old[k], **v) for k, v in value.items()}
    broken = dataclasses.replace(estimator, **{path: value})
    experiment = dataclasses.replace(presets.build("nomad"), estimator=broken)
    with pytest.raises(ParamError, match=complaint):
        initial_world(experiment)


def test_orientation_sd_becomes_quaternion_covariance() -> None:
    """P of the quaternion maps back to the rotation vector's, whatever the orientation."""
    experiment = presets.build("cloister")
    robot = experiment.estimator.robots["robot"]
    sd = {"x": 0.1, "rx": 0.02, "ry": 0.03, "rz": 0.04}
    start = {**robot.start, "qw": 0.5, "qx": -0.5, "qy": 0.5, "qz": 0.5}
    robots = {"robot": dataclasses.replace(robot, start=start, start_sd=sd)}
    estimator = dataclasses.replace(experiment.estimator, robots=robots)
    gauss = initial_world(dataclasses.replace(experiment, estimator=estimator)).gauss
    J = THREE_D.tangent_map(gauss.x)
    expected = np.diag([0.01, 0.0, 0.0, 0.0004, 0.0009, 0.0016])
    np.testing.assert_allclose(J @ gauss.P @ J.T, expected, atol=1e-15)
