"""Three recordings with identified landmarks as frames, from files small enough for a hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from scene_core.filter.policies import Vision
from scene_core.filter.ports import Frame, Occupied, Points, SourceError
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D
from scene_core.sources.planar_mono import PlanarMono
from scene_core.sources.recorded import Recording
from scene_core.sources.starry_night import StarryNight
from scene_core.sources.tagbox import TAGS_OF_KNOWN, Tagbox


def frames(source: Recording) -> list[Frame]:
    return [source.advance(None, k)[0] for k in range(source.frame_count or 0)]


def points(frame: Frame) -> Points:
    (raw,) = frame.raw.values()
    assert isinstance(raw, Points)
    return raw


def complaint(source: Callable[[], Any]) -> str:
    with pytest.raises(SourceError) as error:
        source()
    return str(error.value)


TEN = " 0" * 10
PLANAR = {
    "camera.dat": "camera matrix:\n180 0 320\n0 170 240\n0 0 1\ncam_transform:\n"
    "0 0 1 0.2\n-1 0 0 0\n0 -1 0 0.1\n0 0 0 1\nz_near: 0\nz_far: 5\nwidth: 640\nheight: 480\n",
    "world.dat": f"3 1.0 2.0 0.5{TEN}\n8 4 5 6{TEN}\n",
    "trajectory.dat": "pose: 0 0 0 1.5707963267948966 0 0 0\npose: 1 -1 2 1.6 1 2 0.5\n",
    "meas-00000.dat": f"seq: 0\ngt_pose: 0 0 0\nodom_pose: 0 0 0\npoint 0 8 10 20{TEN}\n",
    "meas-00001.dat": "seq: 1\n",
}


@pytest.fixture
def planar(tmp_path: Path) -> PlanarMono:
    for name, text in PLANAR.items():
        (tmp_path / name).write_text(text)
    return PlanarMono(str(tmp_path))


def test_a_planar_camera_and_its_odometry(planar: PlanarMono) -> None:
    first, second = frames(planar)
    assert points(first).z.tolist() == [[10.0, 20.0]] and not second.raw
    (step,) = second.controls["robot"]
    # Heading along the world's y: two ahead, one to the left.
    np.testing.assert_allclose(step.u, [2.0, 1.0, 1.6 - np.pi / 2], atol=1e-12)
    assert step.labels == ("dz", "dx", "dphi")
    assert second.truth is not None and second.truth.ids.tolist() == [3, 8]
    np.testing.assert_array_equal(second.truth.xp["robot"], [1.0, 2.0, 0.5])
    np.testing.assert_array_equal(second.truth.points[1], [4.0, 5.0, 6.0])
    camera = planar.camera
    assert (camera.width, camera.height) == (640, 480) and camera.K[1, 1] == 170.0
    # What is ahead of the robot and level with the camera lies on its optical axis.
    ahead = THREE_D.to_local(camera.pose, np.array([2.2, 0.0, 0.1, 1.0])).X
    np.testing.assert_allclose(ahead, [0.0, 0.0, 2.0, 1.0], atol=1e-12)


def test_landmarks_are_offered_and_found_by_identity(planar: PlanarMono) -> None:
    first = frames(planar)[0]
    (new,) = planar.detect(first, "camera", Occupied(np.zeros((0, 2)), (3,)), 5, Vision())
    assert new.appearance == 8
    assert not planar.detect(first, "camera", Occupied(np.zeros((0, 2)), (8,)), 5, Vision())


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("camera.dat", "180 0 320", "180 0", "line 2: 2 fields, expected 3: camera matrix's row"),
        ("camera.dat", "width: 640\n", "", "the camera is not complete; expected camera matrix:"),
        ("camera.dat", "width: 640", "width: wide", "line 12: 'wide' is not a number"),
        ("camera.dat", "-1 0 0 0", "-2 0 0 0", "cam_transform are not a rotation"),
        ("trajectory.dat", "pose: 1", "pose: 2", "line 2: frame 2, expected 1"),
        ("trajectory.dat", "pose: 1", "pos: 1", "line 2: 'pos:' instead of"),
        ("trajectory.dat", " 0.5\n", " nan\n", "line 2: 'nan' is not finite"),
        ("world.dat", "8 4 5", "8 4", "line 2: 13 fields, expected 14"),
        ("meas-00000.dat", "point", "pint", "line 4: 'pint' is unknown"),
        ("meas-00000.dat", "8 10 20", "8 10 inf", "line 4: 'inf' is not finite"),
    ],
)
def test_broken_planar_files_are_named(
    planar: PlanarMono, name: str, old: str, new: str, words: str
) -> None:
    (Path(planar.path) / name).write_text(PLANAR[name].replace(old, new))
    text = complaint(lambda: (planar.camera, planar.start()))
    assert words in text and name in text


def test_a_missing_planar_file_is_named(planar: PlanarMono) -> None:
    (Path(planar.path) / "meas-00001.dat").unlink()
    assert "meas-00001.dat is missing: 2 poses" in complaint(planar.start)
    (Path(planar.path) / "world.dat").unlink()
    assert "world.dat is missing: give the folder with camera.dat" in complaint(planar.start)


def night() -> dict[str, np.ndarray]:
    y = np.full((4, 3, 2), -1.0)
    y[:, 1, 1] = 1.0, 2.0, 3.0, 4.0
    rates = np.array([[1.0, 3.0, 5.0]] * 3)
    return {
        **{"t": np.array([[5.0, 5.5, 6.0]]), "theta_vk_i": 0.1 * rates, "r_i_vk_i": rates},
        **{"w_vk_vk_i": -rates, "v_vk_vk_i": rates, "rho_i_pj_i": np.arange(6.0).reshape(3, 2)},
        **{"y_k_j": y, "C_c_v": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])},
        **{"rho_v_c_v": np.array([[0.1], [0.2], [0.3]]), "b": np.array([[0.24]])},
        **{name: np.array([[400.0]]) for name in ("fu", "fv", "cu", "cv")},
    }


def saved(folder: Path, **other: Any) -> StarryNight:
    arrays = {k: v for k, v in (night() | other).items() if v is not None}
    savemat(folder / "night.mat", arrays)
    return StarryNight(str(folder / "night.mat"))


def test_a_night_is_played_with_the_rates_between_its_frames(tmp_path: Path) -> None:
    source = saved(tmp_path)
    got = frames(source)
    assert [f.time for f in got] == [0.0, 0.5, 1.0] and [len(f.raw) for f in got] == [0, 1, 0]
    seen = points(got[1])
    assert seen.ids is not None and seen.ids.tolist() == [2]
    assert seen.z.tolist() == [[1.0, 2.0, 3.0, 4.0]]
    (held,) = got[2].controls["robot"]
    assert held.dt == 0.5 and held.u.tolist() == [4.0, 4.0, 4.0, -4.0, -4.0, -4.0]
    truth = got[1].truth
    assert truth is not None and truth.points[1].tolist() == [1.0, 3.0, 5.0]
    q = quaternion.from_rotation_vector(np.full(3, 0.3))[0]
    np.testing.assert_allclose(truth.xp["robot"], [3.0, 3.0, 3.0, *q])
    # p_c = C (p_v - rho): a point ahead of the vehicle lies on the optical axis.
    ahead = THREE_D.to_local(source.camera_pose, np.array([2.1, 0.2, 0.3, 1.0])).X
    np.testing.assert_allclose(ahead, [0.0, 0.0, 2.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"t": None}, "has no array of numbers 't' (1 x K)"),
        ({"b": "wide"}, "has no array of numbers 'b' (1 x 1)"),
        ({"v_vk_vk_i": np.ones((3, 2))}, "'v_vk_vk_i' is 3 x 2, expected 3 x K"),
        ({"y_k_j": np.ones((4, 3))}, "'y_k_j' is 4 x 3, expected 4 x K x L"),
        ({"r_i_vk_i": np.full((3, 3), np.nan)}, "'r_i_vk_i' is not finite at (1, 1)"),
        ({"t": np.array([[0.0, 2.0, 1.0]])}, "'t' does not grow at its element 3"),
    ],
)
def test_a_broken_night_is_named(tmp_path: Path, other: dict[str, Any], words: str) -> None:
    text = complaint(saved(tmp_path, **other).start)
    assert words in text and "night.mat" in text


def test_what_is_no_matlab_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.mat").write_text("stars")
    assert "is no MATLAB file" in complaint(StarryNight(str(tmp_path / "x.mat")).start)


K = np.array([[400.0, 0.0, 300.0], [0.0, 410.0, 200.0], [0.0, 0.0, 1.0]])
SPOTS = np.array([(10 * (j % 4), 8 * (j // 4), -5 * (j % 3)) for j in range(len(TAGS_OF_KNOWN))])
AT = np.array([0.1, 0.05, -0.8, *quaternion.from_rotation_vector(np.array([0.1, -0.2, 0.05]))[0]])


def box_files() -> dict[str, str]:
    X = np.concatenate([0.01 * SPOTS, np.ones((len(SPOTS), 1))], axis=1)
    p = THREE_D.to_local(AT, X).X[:, :3] @ K.T
    uv = (p[:, :2] / p[:, 2:]).tolist()
    tags = [f"{t} 1 2 {u!r} {v!r} 5 6 7 8" for t, (u, v) in zip(TAGS_OF_KNOWN, uv, strict=True)]
    return {
        "K.txt": "\n".join(" ".join(map(str, row)) for row in K.tolist()),
        "p_W_corners.txt": "\n".join(", ".join(map(str, p)) for p in SPOTS.tolist()),
        "tag_corners.txt": "# x\n" + "\n".join(f"1 {t}" for t in tags) + f"\n3 {tags[0]}\n",
    }


@pytest.fixture
def box(tmp_path: Path) -> Tagbox:
    for name, text in box_files().items():
        (tmp_path / name).write_text(text)
    return Tagbox(str(tmp_path))


def test_corners_of_tags_have_identities_and_give_the_first_pose(box: Tagbox) -> None:
    got = frames(box)
    assert [len(f.raw) for f in got] == [1, 0, 1] and got[0].truth is not None
    seen = points(got[0])
    assert seen.z.shape == (48, 2) and seen.ids is not None
    assert seen.ids[:4].tolist() == [96, 97, 98, 99] and seen.z[0].tolist() == [1.0, 2.0]
    np.testing.assert_allclose(box.known()[97], 0.01 * SPOTS[0])
    np.testing.assert_allclose(THREE_D.difference(box.start_pose(), AT), 0.0, atol=1e-5)
    assert not got[0].controls and not got[0].truth.xp


def test_the_path_of_the_box_is_read_where_it_is_given(box: Tagbox) -> None:
    (Path(box.path) / "poses_pnp.txt").write_text("1 1 2 3 0 0 0 1 0.5\n3 4 5 6 0 1 0 0 0.5\n")
    truths = [f.truth for f in frames(box)]
    assert [bool(t and t.xp) for t in truths] == [True, False, True]
    assert truths[2] is not None
    assert truths[2].xp["camera"].tolist() == [4.0, 5.0, 6.0, 0.0, 0.0, 1.0, 0.0]


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("K.txt", "0.0 0.0 1.0", "0.0 0.0 2.0", "expected 3 rows fu 0 u0, 0 fv v0, 0 0 1"),
        ("K.txt", "400.0 ", "", "line 1: 2 fields, expected 3"),
        ("p_W_corners.txt", "0, 0, 0\n", "", "has 11 points, expected 12"),
        ("tag_corners.txt", "\n3 24", "\n0 24", "line 14: frame 0: frames are whole numbers"),
        ("tag_corners.txt", "\n3 24", "\n3 24 7", "line 14: 11 fields, expected 10: frame tag"),
        ("tag_corners.txt", "1 24 1 2", "1 24 1 nan", "line 2: 'nan' is not finite"),
    ],
)
def test_broken_box_files_are_named(box: Tagbox, name: str, old: str, new: str, words: str) -> None:
    (Path(box.path) / name).write_text(box_files()[name].replace(old, new, 1))
    text = complaint(lambda: (box.K, box.start()))
    assert words in text and name in text


def test_a_box_that_can_not_be_started_says_why(box: Tagbox) -> None:
    corners = box_files()["tag_corners.txt"].splitlines()
    (Path(box.path) / "tag_corners.txt").write_text("\n".join(corners[:4]))
    assert "the first image shows 3 of the known points, 6 are needed" in complaint(box.start_pose)
    (Path(box.path) / "K.txt").unlink()
    assert "K.txt is missing: give the folder with K.txt" in complaint(box.start)
