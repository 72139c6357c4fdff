"""MRPT's logs as frames: signs, frames of reference, complaints with file and line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scene_core.filter.ports import EndOfData, Points, SourceError
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D
from scene_core.sources.mrpt import Mrpt, find_log

HEADER = "# max_range 6.0 fov_yaw 3.1 fov_pitch 3.1 std_range 0.01 std_yaw 0.002 std_pitch 0\n"
FLAT = (
    "SF 0\nOBS 0 7 2.0 0.5 0\nOBS 0 3 1.0 -0.5 -0\nODO 0 0.1 -0.02 0 0.3 0 0\n"
    "SF 1\nODO 1 0.2 0 0 0 0 0\n# so far\nSF 2\nOBS 2 3 1.5 0.1 0\nODO 2 9 9 9 9 0 0\n"
)
SOLID = "SF 0\nOBS 0 1 2 0.2 0.3\nODO 0 1 2 3 0.3 -0.2 0.1\nSF 1\nOBS 1 1 2 0 0\n"


def log(folder: Path, text: str, header: str = HEADER) -> Mrpt:
    (folder / "log.txt").write_text(header + text, encoding="utf-8")
    return Mrpt(str(folder / "log.txt"), rate=4.0)


def test_a_log_in_the_plane(tmp_path: Path) -> None:
    source = log(tmp_path, FLAT.replace("ODO 2 9 9 9 9", "ODO 2 9 9 0 9"))
    got = [source.advance(None, k)[0] for k in range(3)]
    assert source.is_planar and source.frame_count == 3 and source.frame_rate == 4.0
    assert source.header["std_range"] == 0.01
    assert [f.time for f in got] == [0.0, 0.25, 0.5] and [f.dt for f in got] == [0.0, 0.25, 0.25]
    first = got[0].raw["scanner"]
    assert isinstance(first, Points) and first.ids is not None
    np.testing.assert_array_equal(first.z, [[2.0, 0.5], [1.0, -0.5]])
    assert first.ids.tolist() == [7, 3] and not got[1].raw
    assert got[0].controls["robot"] == ()
    (step,) = got[1].controls["robot"]
    assert step.labels == ("dz", "dx", "dphi")
    np.testing.assert_array_equal(step.u, [0.1, -0.02, 0.3])
    assert got[0].truth is None
    with pytest.raises(EndOfData):
        source.advance(None, 3)


def test_a_log_in_space_turns_pitch_into_elevation_and_euler_angles_into_a_rotation(
    tmp_path: Path,
) -> None:
    source = log(tmp_path, SOLID)
    assert not source.is_planar
    first, second = (source.advance(None, k)[0] for k in range(2))
    seen = first.raw["scanner"]
    assert isinstance(seen, Points)
    np.testing.assert_array_equal(seen.z, [[2.0, 0.2, -0.3]])
    (step,) = second.controls["robot"]
    q = quaternion.from_rotation_vector(step.u[3:])[0]
    R = quaternion.matrix(q)
    # R = Rz(yaw) Ry(pitch) Rx(roll): the x axis turned by roll stays, then pitch, then yaw.
    axis = [np.cos(0.3) * np.cos(-0.2), np.sin(0.3) * np.cos(-0.2), -np.sin(-0.2)]
    np.testing.assert_allclose(R[:, 0], axis, atol=1e-14)
    np.testing.assert_allclose(R[2, 1:], np.cos(-0.2) * np.array([np.sin(0.1), np.cos(0.1)]))
    np.testing.assert_array_equal(step.u[:3], [1.0, 2.0, 3.0])


def test_the_truth_is_taken_from_beside_the_log(tmp_path: Path) -> None:
    source = log(tmp_path, SOLID)
    with pytest.raises(SourceError, match=r"log.txt: there is no true pose where the recording"):
        source.start_pose()
    (tmp_path / "log_ground_truth.txt").write_text("1 2 3 5 0 0 8\n")
    (tmp_path / "log_ground_truth_robot_path.txt").write_text("% x\n0 0 0 0 0 0\n1 0 0 0.5 0 0\n")
    truth = source.advance(None, 1)[0].truth
    assert truth is not None and truth.ids.tolist() == [8]
    np.testing.assert_array_equal(truth.points, [[1.0, 2.0, 3.0]])
    half = [1.0, 0.0, 0.0, np.cos(0.25), 0.0, 0.0, np.sin(0.25)]
    np.testing.assert_allclose(THREE_D.difference(truth.xp["robot"], np.array(half)), 0, atol=1e-14)
    np.testing.assert_allclose(source.start_pose(), THREE_D.identity())
    (tmp_path / "log_ground_truth_robot_path.txt").write_text("0 0 0 0 0 0\n")
    with pytest.raises(SourceError, match=r"has 1 poses and .* 2 frames: give one per frame"):
        source.start()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (FLAT.replace("SF 1", "ST 1"), "line 6: 'ST' is unknown; lines: SF frame"),
        (FLAT.replace("OBS 0 7 2.0", "OBS 0 7 nan"), "line 3: 'nan' is not finite"),
        (FLAT.replace("OBS 0 7 2.0", "OBS 0 7"), "line 3: 4 fields, expected 5: OBS frame landm"),
        (FLAT.replace("OBS 0 7 2.0", "OBS 0 7 -2"), "line 3: a range of -2 is not > 0"),
        (FLAT.replace("OBS 0 7", "OBS 4 7"), "line 3: frame 4, expected 0: frames are numbered"),
        (FLAT.replace("ODO 1 0.2 0 0 0 0 0\n", ""), "has no line ODO 1: give a complete log"),
        ("SF 0\n", "has no line OBS: give a complete log"),
    ],
)
def test_a_broken_log_is_named_with_its_line(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(SourceError) as error:
        log(tmp_path, text).start()
    assert complaint in str(error.value) and "log.txt" in str(error.value)


@pytest.mark.parametrize("header", ["", "# max_range 6\n", HEADER.replace("0.01", "x")])
def test_a_log_without_its_first_line_is_refused(tmp_path: Path, header: str) -> None:
    with pytest.raises(SourceError, match=r"log.txt, line 1: .*max_range VALUE"):
        _ = log(tmp_path, FLAT, header).header


def test_a_folder_means_its_planar_log(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"kf-slam_demo.txt is missing: give the folder"):
        find_log(str(tmp_path))
    (tmp_path / "kf-slam_demo.txt").touch()
    assert find_log(str(tmp_path)) == str(tmp_path / "kf-slam_demo.txt")
    assert find_log("x.txt") == "x.txt"
