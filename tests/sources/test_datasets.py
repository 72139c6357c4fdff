"""An MRCLAM log as frames: nothing lost, nothing invented, complaints with file and line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scene_core.filter.policies import Vision
from scene_core.filter.ports import EndOfData, Frame, Occupied, Points, SourceError
from scene_core.sources.datasets import Mrclam

FILES = {
    "Barcodes.dat": "# subject barcode\n 1 5\n 6 72\n 7 90\n",
    "Landmark_Groundtruth.dat": "6 4.0 1.0 0.01 0.01\n7 -1.0 2.0 0.01 0.01\n",
    "Robot2_Odometry.dat": "100.0 0.5 0.1\n100.4 0.6 0.0\n100.9 0.7 -0.1\n104.0 0.0 0.0\n",
    "Robot2_Measurement.dat": (
        "100.7 72 3.0 0.2\n100.7005 90 2.0 -0.4\n101.0 5 1.0 0.0\n101.0 33 9.0 0.0\n"
        "101.2 72 2.5 0.3\n105.0 72 1.0 0.0\n"
    ),
    "Robot2_Groundtruth.dat": (
        "99.9 1.0 2.0 3.1\n100.1 1.2 2.4 -3.1\n100.5 1.6 2.4 -3.0\n"
        "101.5 9 9 0\n103.9 2 2 0\n104.1 2 2 0\n"
    ),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def frames(source: Mrclam) -> list[Frame]:
    return [source.advance(None, k)[0] for k in range(source.frame_count or 0)]


def points(frame: Frame) -> Points:
    raw = frame.raw["camera"]
    assert isinstance(raw, Points)
    return raw


def test_a_frame_is_a_time_of_measurement_or_a_second_without(folder: Path) -> None:
    got = frames(Mrclam(str(folder)))
    assert np.allclose([f.time for f in got], [0.0, 0.7, 1.2, 2.2, 3.2])
    assert [len(f.raw) for f in got] == [0, 1, 1, 0, 0]
    assert [f.index for f in got] == list(range(5))
    with pytest.raises(EndOfData):
        Mrclam(str(folder)).advance(None, 5)


def test_barcodes_become_subjects_and_robots_and_strangers_are_left_out(folder: Path) -> None:
    got = frames(Mrclam(str(folder)))
    assert points(got[1]).ids is not None
    assert np.array_equal(points(got[1]).ids, [6, 7])  # type: ignore[arg-type]
    assert np.array_equal(points(got[1]).z, [[3.0, 0.2], [2.0, -0.4]])
    assert np.array_equal(points(got[2]).ids, [6])  # type: ignore[arg-type]


def test_odometry_holds_until_the_next_sample(folder: Path) -> None:
    got = frames(Mrclam(str(folder)))
    held = [(round(c.dt, 9), *c.u) for f in got for c in f.controls["robot"]]
    assert held[:5] == [
        (0.4, 0.5, 0.1), (0.3, 0.6, 0.0), (0.2, 0.6, 0.0), (0.3, 0.7, -0.1), (1.0, 0.7, -0.1)
    ]  # fmt: skip
    assert all(c.labels == ("v", "w") for f in got for c in f.controls["robot"])
    for f in got:
        assert np.isclose(sum(c.dt for c in f.controls["robot"]), f.dt)


def test_the_truth_is_interpolated_the_short_way_round(folder: Path) -> None:
    got = frames(Mrclam(str(folder)))
    assert got[0].truth is not None
    z, x, phi = got[0].truth.xp["robot"]
    assert np.allclose([z, x], [1.1, 2.2])
    assert abs(abs(phi) - np.pi) < 0.02
    assert np.array_equal(got[0].truth.points, [[4.0, 1.0], [-1.0, 2.0]])
    assert np.array_equal(got[0].truth.ids, [6, 7])
    # The motion capture is silent from 100.5 to 101.5 and longer: no truth is made up.
    assert [bool(f.truth and f.truth.xp) for f in got] == [True, False, False, False, False]


def test_it_starts_at_the_true_pose(folder: Path) -> None:
    source = Mrclam(str(folder))
    truth = source.advance(None, 0)[0].truth
    assert truth is not None
    assert np.array_equal(source.start_pose(), truth.xp["robot"])


def test_new_landmarks_are_those_not_mapped(folder: Path) -> None:
    source = Mrclam(str(folder))
    frame = source.advance(None, 1)[0]
    known = Occupied(np.zeros((0, 2)), (6,))
    assert [d.appearance for d in source.detect(frame, "camera", known, 9, Vision())] == [7]
    clicked = source.appearance_at(frame, "camera", np.array([2.9, 0.0]), Vision())
    assert clicked is not None and clicked.appearance == 6


BROKEN = [
    ("Robot2_Odometry.dat", "100.0 0.5\n", ["line 1", "2 fields", "expected 3", "time v w"]),
    ("Robot2_Odometry.dat", "100.0 0.5 nan\n", ["line 1", "'nan'", "finite"]),
    ("Robot2_Odometry.dat", "# only\n", ["no data"]),
    ("Robot2_Odometry.dat", "100 0 0\n99 0 0\n", ["line 2", "before"]),
    ("Robot2_Measurement.dat", "# x\n\n100.1 72 3.0 abc\n", ["line 3", "'abc'"]),
    ("Robot2_Measurement.dat", "100.1 5 3.0 0.1\n", ["no landmark"]),
    ("Robot2_Groundtruth.dat", "100 1 2 3 4\n", ["line 1", "5 fields", "expected 4"]),
    ("Barcodes.dat", "1 two\n", ["line 1", "'two'"]),
    ("Landmark_Groundtruth.dat", b"\xff\xfe\x00\x81".decode("latin-1"), ["line 1"]),
]


@pytest.mark.parametrize(("name", "text", "words"), BROKEN)
def test_a_broken_file_is_named_with_its_line(
    folder: Path, name: str, text: str, words: list[str]
) -> None:
    (folder / name).write_text(text, encoding="utf-8")
    with pytest.raises(SourceError) as error:
        Mrclam(str(folder)).start()
    assert all(word in str(error.value) for word in [name, *words]), error.value


def test_what_is_missing_is_named(folder: Path) -> None:
    with pytest.raises(SourceError, match=r"Robot4_Odometry.dat is missing.*robots 2"):
        replace(Mrclam(str(folder)), robot_number=4).start()
    with pytest.raises(SourceError, match="no folder"):
        Mrclam(str(folder / "nowhere")).start()


def test_a_changed_file_is_read_again(folder: Path) -> None:
    source = Mrclam(str(folder))
    assert source.frame_count == 5
    text = FILES["Robot2_Measurement.dat"] + "\n"
    (folder / "Robot2_Measurement.dat").write_text(text.replace("101.2 72", "101.9 72"))
    assert np.isclose(source.advance(None, 3)[0].time, 1.9)


@pytest.mark.parametrize(("robot", "dead_reckoning"), [(2, 2.08), (3, 3.05), (5, 1.14)])
def test_the_real_log_is_all_there(
    recordings: Callable[[str], Path], robot: int, dead_reckoning: float
) -> None:
    """Path length in time, barcodes, and the dead reckoning of the recording's description."""
    source = Mrclam(str(recordings("mrclam_dataset6")), robot)
    pose, path, truth, seen = source.start_pose().copy(), [], [], set()
    for frame in frames(source):
        for c in frame.controls["robot"]:
            (v, w), middle = c.u, pose[2] + 0.5 * c.u[1] * c.dt
            pose += np.array([v * np.cos(middle), v * np.sin(middle), w]) * c.dt
        if frame.truth is not None and frame.truth.xp:
            path.append(pose[:2].copy())
            truth.append(frame.truth.xp["robot"][:2])
        seen |= set(points(frame).ids.tolist()) if frame.raw else set()  # type: ignore[union-attr]
        assert frame.dt <= 1.0 + 1e-9
    a, b = np.array(path) - np.mean(path, axis=0), np.array(truth) - np.mean(truth, axis=0)
    U, _, Vt = np.linalg.svd(b.T @ a)
    R = U @ np.diag([1.0, np.linalg.det(U @ Vt)]) @ Vt
    rmse = np.sqrt(((a @ R.T - b) ** 2).sum(1).mean())
    assert seen == set(range(6, 21))
    assert abs(rmse - dead_reckoning) < 0.1
