"""Every calibration format gives the same camera, and every mistake in one a sentence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from scene_core.filter.ports import SourceError
from scene_core.geometry.spaces import THREE_D
from scene_core.sources.calibration import Calibration, load_calibration
from scene_core.sources.vision import load_patch

OPENCV = """%YAML:1.0
---
calibration_time: "Mon Nov 2 10:00:00 2026"
image_width: 640
image_height: 480
fps: 25.
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.3, 0.1, 0., 0., 0.02 ]
"""
CFG = """# SceneLib2 configuration
input.mode = 0;
cam.width = 320;
cam.height = 240;
cam.fku = 195;
cam.fkv = 195;
cam.u0 = 162;
cam.v0 = 125;
cam.kd1 = 9e-06;
cam.sd = 1;
params.delta_t = 0.04;
params.number_of_features_to_select = 11;
params.number_of_features_to_keep_visible = 13;
state.rw_x = 0.0;
state.rw_z = -0.60;
state.qwr_w = 1.0;
state.vw_z = -0.1;
state.pxx0_0 = 0.0004;
state.pxx0_1 = 0.0;
state.pxx5_5 = 0.000025;
state.pxx12_12 = 0.01;
f1.yi_x = 0.105;\t\t# feature position
f1.yi_y = 0.07425;
f1.yi_z = 0.0;
f1.identifier = ../../data/known_patch0.pgm;
"""
TOML = """
[camera]
model = "wide-angle"
frame_rate_hz = 25.0
width = 320
height = 240
u0 = 162.0
v0 = 125.0
f_u = 195.0
f_v = 195.0
kd1 = 9e-6
border = 20.0
[start]
position_m = [0.0, 0.0, -0.6]
[start_sd]
position_m = 0.02
rotation_rad = [0.0, 0.01, 0.0]
[[known_feature]]
position_m = [0.105, 0.07425, 0.0]
sd_m = 0.001
patch = "known_patch0.pgm"
[estimator.policies.selection]
budget = 11
[estimator.robots.camera.motion]
sd_accel = 2.0
"""


def write(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text)
    cv2.imwrite(str(tmp_path / "known_patch0.pgm"), np.eye(11, dtype=np.uint8) * 200)
    return path


def load(tmp_path: Path, name: str, text: str) -> Calibration:
    return load_calibration(write(tmp_path, name, text))


X = np.array([[0.3, -0.2, 1.0], [-0.5, 0.4, 1.6], [0.1, 0.2, 0.9]])
K = np.array([[500.0, 0, 320], [0, 510, 240], [0, 0, 1]])


@pytest.mark.parametrize("d", ["-0.3, 0.1, 0., 0., 0.02", "-0.3, 0.1, 2e-3, -1e-3, 0.02"])
def test_opencv_is_the_camera_it_calibrated(tmp_path: Path, d: str) -> None:
    c = load(tmp_path, "camera.yml", OPENCV.replace("-0.3, 0.1, 0., 0., 0.02", d))
    assert c.frame_rate == 25.0 and c.sensor.image_size == (640, 480)
    assert c.sensor.name == "opencv"
    coefficients = np.array([float(x) for x in d.split(",")])
    expected, _ = cv2.projectPoints(X, np.zeros(3), np.zeros(3), K, coefficients)
    h = c.sensor.project(np.column_stack([X, np.ones(3)]), c.sensor.calib0).h
    assert np.allclose(h, expected[:, 0], atol=1e-9)


@pytest.mark.parametrize(
    "word", ['distortion_model: "fisheye"', "distortion_model: equidistant", "fisheye_model: 1"]
)
def test_a_fisheye_says_that_it_is_one(tmp_path: Path, word: str) -> None:
    text = OPENCV.replace("fps: 25.", word).replace("cols: 5", "cols: 4")
    d = "-0.02, 0.004, -0.002, 0.0002"
    c = load(tmp_path, "camera.yml", text.replace("-0.3, 0.1, 0., 0., 0.02", d))
    assert c.sensor.name == "fisheye"
    coefficients = np.array([float(x) for x in d.split(",")])
    expected, _ = cv2.fisheye.projectPoints(X[:, None], np.zeros(3), np.zeros(3), K, coefficients)
    h = c.sensor.project(np.column_stack([X, np.ones(3)]), c.sensor.calib0).h
    assert np.allclose(h, expected[:, 0], atol=1e-9)


def test_four_coefficients_without_a_word_are_radial_and_tangential(tmp_path: Path) -> None:
    text = OPENCV.replace("fps: 25.", 'distortion_model: "plumb_bob"').replace("cols: 5", "cols: 4")
    c = load(tmp_path, "camera.yml", text.replace("0., 0., 0.02", "0.001, 0.002"))
    assert c.sensor.name == "opencv"
    assert np.array_equal(c.sensor.calib0[4:], [-0.3, 0.1, 0.001, 0.002, 0.0])


def test_opencv_without_distortion_or_rate(tmp_path: Path) -> None:
    text = OPENCV[: OPENCV.index("distortion")].replace("fps: 25.\n", "")
    c = load(tmp_path, "camera.yaml", text)
    assert c.frame_rate is None
    assert c.sensor.name == "pinhole" and len(c.sensor.calib0) == 4


def test_scenelib_is_read_as_it_is_meant(tmp_path: Path) -> None:
    c = load(tmp_path, "SceneLib2.cfg", CFG)
    assert c.sensor.name == "wide-angle"
    assert np.array_equal(c.sensor.calib0, [162, 125, 195, 195, 9e-6])
    assert c.frame_rate == pytest.approx(25.0)
    assert c.start == {"x": 0.0, "z": -0.6, "qw": 1.0, "vz": -0.1}
    assert c.start_sd == pytest.approx({"x": 0.02, "ry": 0.01, "wz": 0.1})
    assert c.settings == {"policies.selection.budget": 11, "policies.management.keep_visible": 13}
    (known,) = c.known
    assert known.position == (0.105, 0.07425, 0.0) and known.sd == 0.0
    assert load_patch(known.patch).template.shape == (11, 11)


def test_scenelibs_camera_looks_left_and_up(tmp_path: Path) -> None:
    """u = u0 - fku x / z, v = v0 - fkv y / z with x left and y up (SceneLib), by the mount."""
    c = load(tmp_path, "SceneLib2.cfg", CFG)
    X = THREE_D.to_local(np.array(c.pose), np.array([[0.001, 0.002, 1.0, 1.0]])).X
    h = c.sensor.project(X, c.sensor.calib0).h[0]
    assert np.allclose(h, [162 - 0.195, 125 - 0.39], atol=1e-4)


def test_our_own_format_says_the_same_as_scenelibs(tmp_path: Path) -> None:
    ours, theirs = load(tmp_path, "a.toml", TOML), load(tmp_path, "b.cfg", CFG)
    assert ours.sensor == theirs.sensor
    assert ours.pose == theirs.pose and ours.up == theirs.up == "y"
    assert ours.frame_rate == theirs.frame_rate
    assert ours.start["z"] == theirs.start["z"]
    assert ours.start_sd == {"x": 0.02, "y": 0.02, "z": 0.02, "rx": 0.0, "ry": 0.01, "rz": 0.0}
    assert ours.settings == {
        "policies.selection.budget": 11,
        "robots.camera.motion.sd_accel": 2.0,
    }


def test_a_patch_may_lie_beside_the_images(tmp_path: Path) -> None:
    (tmp_path / "calib").mkdir()
    (tmp_path / "recording" / "images").mkdir(parents=True)
    path = tmp_path / "calib" / "a.toml"
    path.write_text(TOML)
    for place in ("recording", "recording/images", "calib"):
        patch = tmp_path / place / "known_patch0.pgm"
        patch.write_bytes(b"")
        (known,) = load_calibration(path, tmp_path / "recording" / "images").known
        assert Path(known.patch) == patch
    for place in ("recording", "recording/images", "calib"):
        (tmp_path / place / "known_patch0.pgm").unlink()
    with pytest.raises(SourceError, match=r"known_feature 1.*no patch 'known_patch0.pgm'"):
        load_calibration(path, tmp_path / "recording" / "images")


def test_any_number_of_distortion_coefficients(tmp_path: Path) -> None:
    text = TOML.replace('"wide-angle"', '"pinhole"').replace(
        "kd1 = 9e-6", "distortion = [-0.1, 0.2]"
    )
    assert np.array_equal(load(tmp_path, "a.toml", text).sensor.calib0[4:], [-0.1, 0.2])


@pytest.mark.parametrize("name", ["opencv", "fisheye", "omnidirectional"])
def test_our_own_format_knows_every_lens(tmp_path: Path, name: str) -> None:
    lens = {
        "opencv": "k1 = -0.1\nk2 = 0.02\np1 = 0.001\np2 = 0.002\nk3 = 0.0",
        "fisheye": "k1 = -0.1\nk2 = 0.02\nk3 = 0.001\nk4 = 0.002\ntheta_max = 1.7",
        "omnidirectional": "polynomial = [150.0, -95.0, -1.0, 0.5, 0.1]\naffine_e = 0.01",
    }[name]
    text = TOML.replace('"wide-angle"', f'"{name}"').replace("kd1 = 9e-6", lens)
    if name == "omnidirectional":
        text = text.replace("f_u = 195.0\nf_v = 195.0\n", "")
    sensor = load(tmp_path, "a.toml", text).sensor
    assert sensor.name == name and sensor.image_size == (320, 240)
    stated = [float(x) for x in lens.split("\n")[0].split("=")[1].strip(" []").split(",")]
    assert np.isin(stated, sensor.calib0).all()


MISTAKES = [
    ("a.yaml", OPENCV.replace("cols: 5", "cols: 6"), "0.02 ]", "0.02, 0.3 ]", ["6", "0.3", "k3"]),
    ("a.yaml", OPENCV, "fps: 25.", "distortion_model: ftheta", ["ftheta", "known", "equidistant"]),
    ("a.yaml", OPENCV, "fps: 25.", "fisheye_model: 1", ["coefficient 5", "0.02", "k4"]),
    ("a.yaml", OPENCV, "camera_matrix", "kamera", ["camera_matrix"]),
    ("a.yaml", OPENCV, "image_width: 640", "image_width: -640", ["width", "-640", "[8"]),
    ("a.yaml", OPENCV, "image_width: 640", "image_width: wide", ["image_width", "number"]),
    ("a.yaml", OPENCV, "500., 0.,", "500., 2.,", ["skew"]),
    ("a.yaml", OPENCV, "rows: 3\n   cols: 3", "rows: 1\n   cols: 9", ["1 x 9", "3x3"]),
    ("a.yaml", OPENCV, OPENCV, "fku: 3\n", []),
    ("a.yaml", OPENCV, OPENCV, "", []),
    ("a.cfg", CFG, "cam.fku = 195;", "", ["no 'cam.fku'"]),
    ("a.cfg", CFG, "cam.fku = 195;", "cam.fku = wide;", ["line 5", "cam.fku", "'wide'"]),
    ("a.cfg", CFG, "cam.fku = 195;", "cam.fku 195", ["line 5", "key = value"]),
    ("a.cfg", CFG, "pxx0_1 = 0.0", "pxx0_1 = 0.1", ["line 19", "pxx0_1", "variances"]),
    ("a.cfg", CFG, "pxx0_0 = 0.0004", "pxx0_0 = -1", ["line 18", "no variance"]),
    ("a.cfg", CFG, "delta_t = 0.04", "delta_t = 0", ["delta_t"]),
    ("a.cfg", CFG, "known_patch0", "unknown", ["line 25", "no patch"]),
    ("a.toml", TOML, "[camera]", "[camera", ["TOML"]),
    ("a.toml", TOML, "[camera]", "[kamera]", ["kamera", "known are"]),
    ("a.toml", TOML, '"wide-angle"', '"fishy"', ["fishy", "choose one of", "wide-angle"]),
    ("a.toml", TOML, "f_u = 195.0", "f_u = -1.0", ["f_u", "-1", "[1,"]),
    ("a.toml", TOML, "f_u = 195.0", "focal = 195.0", ["[camera]"]),
    ("a.toml", TOML, "f_u = 195.0\n", "", ["f_u"]),
    ("a.toml", TOML, '"wide-angle"', '"depth camera"', ["depth camera", "choose one of"]),
    ("a.toml", TOML, '"wide-angle"', '"omnidirectional"', ["no polynomial"]),
    ("a.toml", TOML, "kd1 = 9e-6", "kd1 = nan", ["kd1", "finite"]),
    ("a.toml", TOML, "kd1 = 9e-6", f"kd1 = {'[' * 5000}{']' * 5000}", ["TOML", "nested"]),
    ("a.toml", TOML, "kd1 = 9e-6", f"kd1 = 1{'0' * 5000}", ["TOML", "thousands of digits"]),
    ("a.toml", TOML, "kd1 = 9e-6", "kd1 = 9e-6\nkd7 = 1", ["kd7"]),
    ("a.toml", TOML, "frame_rate_hz = 25.0", "frame_rate_hz = 0", ["frame_rate_hz", "[0.1, 1000]"]),
    ("a.toml", TOML, "[0.0, 0.0, -0.6]", "[0.0, 0.0]", ["[start] position_m", "3 finite numbers"]),
    ("a.toml", TOML, "[0.0, 0.0, -0.6]", "0.0", ["[start] position_m", "3 finite numbers"]),
    ("a.toml", TOML, "position_m = 0.02", "position_m = -0.02", ["[start_sd]", ">= 0"]),
    ("a.toml", TOML, "sd_m = 0.001", "sd_m = -0.001", ["known_feature 1", ">= 0"]),
    ("a.toml", TOML, "sd_m = 0.001", "sd = 0.001", ["known_feature 1", "sd_m"]),
    ("a.toml", TOML, "[start_sd]", '[world]\nup = "x"\n[start_sd]', ["up", "y; z"]),
    ("a.toml", TOML, "[start_sd]", '[mount]\naxes = "odd"\n[start_sd]', ["axes", "x left"]),
    ("a.txt", TOML, "", "", [".yaml", ".cfg", ".toml"]),
]


@pytest.mark.parametrize(("name", "text", "old", "new", "words"), MISTAKES)
def test_every_mistake_is_one_sentence(
    tmp_path: Path, name: str, text: str, old: str, new: str, words: list[str]
) -> None:
    changed = text.replace(old, new, 1) if old else text
    with pytest.raises(SourceError) as error:
        load(tmp_path, name, changed)
    message = str(error.value)
    assert str(tmp_path / name) in message
    assert all(word in message for word in words), message
    assert "\n" not in message.strip()


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"no calibration file .*camera.toml"):
        load_calibration(tmp_path / "camera.toml")


RECORDINGS = Path(__file__).resolve().parents[1] / "recordings"


def test_the_recordings_descriptions_can_be_read(recordings: Callable[[str], Path]) -> None:
    images = recordings("mono_scenelib_testseq") / "frames"
    testseq = load_calibration(RECORDINGS / "testseq.toml", images)
    assert len(testseq.known) == 4
    assert testseq.sensor.image_size == (320, 240)
    desk = load_calibration(RECORDINGS / "desk.toml")
    assert desk.known == () and desk.sensor.name == "Civera"
