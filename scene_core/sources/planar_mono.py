"""A planar robot with odometry and a camera among identified points: Grisetti's course project.

Source: G. Grisetti, course *Probabilistic Robotics*, Sapienza, project "Planar Monocular SLAM".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.ports import SourceError
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import TWO_D, relative
from scene_core.params import param
from scene_core.sources.recorded import Log, Logged, by_frame, fixed, folder, needed
from scene_core.sources.tables import fingerprint, read_numbers, row, text_lines

CAMERA = "camera matrix: and cam_transform: with their rows, width: W, height: H"
POINT = "point index identity u v and ten numbers"
POSE = "pose: frame x y theta x y theta, by odometry and true"


@dataclass(frozen=True)
class PlanarCamera:
    """What camera.dat says."""

    K: Mat
    """(3, 3)"""
    pose: Vec
    """(7,) x, y, z, qw, qx, qy, qz of the camera on the robot, x forward, z up."""
    width: int
    height: int


@dataclass(frozen=True)
class PlanarMono(Logged):
    """Odometry and pixels of identified points, frame by frame.

    The controls are the increments dz, dx, dphi of the odometry's pose; the world's x and y are z
    and x of the planar state. The points of world.dat are the true landmarks.
    """

    path: str
    """Folder with camera.dat, trajectory.dat, world.dat and meas-00000.dat, meas-00001.dat, ..."""
    rate: float = param(10.0, unit="Hz", lo=0.1, hi=1000.0, soft=(1.0, 60.0), effect="on reset")
    """Frames per second: the recording has no times."""
    robot: str = "robot"
    """The robot's name."""
    mount: str = "camera"
    """The sensor's name."""

    @property
    def camera(self) -> PlanarCamera:
        """The camera and where it sits."""
        file = needed(folder(self.path, FOLDER) / "camera.dat", FOLDER)
        return _camera(str(file), fingerprint(file))

    def _log(self) -> Log:
        at = folder(self.path, FOLDER)
        named = [needed(at / name, FOLDER) for name in ("trajectory.dat", "world.dat")]
        # Hundreds of files: the folder's own time says when one was put there or replaced.
        return _load(self.path, self.rate, tuple(fingerprint(p) for p in (at, *named)))


FOLDER = "give the folder with camera.dat, trajectory.dat, world.dat and meas-00000.dat, ..."


@lru_cache(maxsize=4)
def _load(path: str, rate: float, _: tuple) -> Log:
    at = Path(path)
    told = _trajectory(at / "trajectory.dat")
    frames = len(told)
    files = [needed(at / f"meas-{k:05d}.dat", f"{frames} poses") for k in range(frames)]
    seen = np.concatenate([_points(k, file) for k, file in enumerate(files)])
    z, ids = by_frame(seen, frames, slice(2, 4))
    points, _lines = read_numbers(at / "world.dat", 14, "identity x y z and ten numbers")
    odometry = told[:, 1:4]
    steps = [relative(TWO_D, a, b).x for a, b in pairwise(odometry)]
    return Log(
        times=frozen(np.arange(frames) / rate),
        z=z,
        ids=ids,
        labels=("dz", "dx", "dphi"),
        u=frozen(np.array([np.zeros(3), *steps])),
        poses=frozen(told[:, 4:]),
        points=frozen(points[:, 1:4]),
        point_ids=fixed(points[:, 0].astype(int)),
    )


def _trajectory(path: Path) -> Mat:
    """Rows (F, 7): frame, pose by odometry, true pose."""
    rows = []
    for number, line in text_lines(path, POSE):
        fields = line.split()
        if fields:
            if fields[0] != "pose:":
                raise SourceError(f"{path}, line {number}: '{fields[0]}' instead of '{POSE}'")
            rows.append(row(path, number, fields[1:], 7, POSE))
            if rows[-1][0] != len(rows) - 1:
                raise SourceError(
                    f"{path}, line {number}: frame {rows[-1][0]:g}, expected {len(rows) - 1}: "
                    "frames are numbered from 0, one line each"
                )
    if not rows:
        raise SourceError(f"{path} has no data: expected lines '{POSE}'")
    return np.array(rows)


def _points(frame: int, path: Path) -> Mat:
    """Rows (k, 4): frame, identity, u, v."""
    rows = []
    for number, line in text_lines(path, POINT):
        fields = line.split()
        if fields[:1] == ["point"]:
            values = row(path, number, fields[1:], 14, POINT)
            rows.append([frame, *values[1:4]])
        elif fields and fields[0] not in ("seq:", "gt_pose:", "odom_pose:"):
            raise SourceError(f"{path}, line {number}: '{fields[0]}' is unknown; lines: {POINT}")
    return np.array(rows).reshape(-1, 4)


@lru_cache(maxsize=4)
def _camera(path: str, _: tuple) -> PlanarCamera:
    """K and the camera's pose from the rows below their headings, the rest by name."""
    rows: dict[str, list[list[float]]] = {"camera matrix:": [], "cam_transform:": []}
    sizes: dict[str, float] = {}
    size, at, last = 0, "", 0
    for number, line in text_lines(Path(path), CAMERA):
        last, text = number, line.strip()
        if text in rows:
            at, size = text, 3 if text == "camera matrix:" else 4
        elif text and text[0].isalpha():
            name, *rest = text.split()
            sizes[name] = row(Path(path), number, rest, 1, f"{name} and one number")[0]
        elif text and at:
            rows[at].append(row(Path(path), number, text.split(), size, f"{at[:-1]}'s row"))
    K, T = (np.array(r) for r in rows.values())
    missing = [name for name in ("width:", "height:") if name not in sizes]
    if K.shape != (3, 3) or T.shape != (4, 4) or missing:
        raise SourceError(f"{path}, line {last}: the camera is not complete; expected {CAMERA}")
    return PlanarCamera(frozen(K), _pose(path, T), int(sizes["width:"]), int(sizes["height:"]))


def _pose(path: str, T: Mat) -> Vec:
    """Position and quaternion of a homogeneous transform."""
    R = T[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-3 or np.linalg.det(R) < 0:
        raise SourceError(f"{path}: the first three columns of cam_transform are not a rotation")
    return frozen(np.concatenate([T[:3, 3], quaternion.from_matrix(R)]))
