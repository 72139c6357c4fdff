"""The logs of MRPT's kf-slam demonstrations: range, bearing and odometry, in the plane or in space.

Source: J.-L. Blanco et al., *Mobile Robot Programming Toolkit*, application kf-slam.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.ports import SourceError
from scene_core.geometry import quaternion
from scene_core.params import param
from scene_core.sources.recorded import Log, Logged, by_frame, fixed, needed
from scene_core.sources.tables import fingerprint, read_numbers, row, text_lines

WORDS = {
    "SF": (1, "SF frame"),
    "OBS": (5, "OBS frame landmark range yaw pitch"),
    "ODO": (7, "ODO frame x y z yaw pitch roll"),
}
EXPECTED = "SF frame | OBS frame landmark range yaw pitch | ODO frame x y z yaw pitch roll"
HEADER = ("max_range", "fov_yaw", "fov_pitch", "std_range", "std_yaw", "std_pitch")
FLAT = 1e-6
"""Pitches smaller than this are rounding, rad."""


@dataclass(frozen=True)
class Mrpt(Logged):
    """A log as text: lines `SF k`, `OBS k id range yaw pitch` and `ODO k x y z yaw pitch roll`, the
    last being the increment from frame k to k + 1.

    Where no pitch and no height occurs, the log is planar: z = (range, yaw), controls dz, dx, dphi.
    Otherwise z = (range, azimuth, elevation), elevation = -pitch (MRPT's is positive down), and
    controls dx to az. The true map and path are read from FILE_ground_truth.txt and
    FILE_ground_truth_robot_path.txt where they lie beside FILE.txt.
    """

    path: str
    """The log, a text file."""
    rate: float = param(10.0, unit="Hz", lo=0.1, hi=1000.0, soft=(1.0, 60.0), effect="on reset")
    """Frames per second: the log has no times."""
    robot: str = "robot"
    """The robot's name."""
    mount: str = "scanner"
    """The sensor's name."""

    angles: ClassVar[tuple[int, ...]] = (1,)

    @property
    def is_planar(self) -> bool:
        """Whether the robot of this log stays in the plane."""
        return self._log().labels == PLANAR

    @property
    def header(self) -> dict[str, float]:
        """Reach, fields of view and noise of the sensor, from the log's first line."""
        return _header(self.path, fingerprint(self.path))

    def _log(self) -> Log:
        beside = [p for p in _truth_files(self.path) if p.exists()]
        return _load(self.path, self.rate, tuple(fingerprint(p) for p in (self.path, *beside)))


PLANAR = ("dz", "dx", "dphi")
SPATIAL = ("dx", "dy", "dz", "ax", "ay", "az")


def find_log(path: str) -> str:
    """The log that a path means: the file itself, or the planar one in a folder."""
    if not Path(path).is_dir():
        return path
    return str(
        needed(
            Path(path) / "kf-slam_demo.txt",
            "give the folder that holds this log, or a log itself, e.g. kf-slam_6D_demo.txt",
        )
    )


def _truth_files(path: str) -> tuple[Path, Path]:
    stem = Path(path).with_suffix("")
    return Path(f"{stem}_ground_truth.txt"), Path(f"{stem}_ground_truth_robot_path.txt")


@lru_cache(maxsize=4)
def _header(path: str, _: tuple) -> dict[str, float]:
    first = next(iter(text_lines(Path(path), EXPECTED)), (1, ""))[1]
    words = first.lstrip("#").split()
    expected = "# " + " ".join(f"{name} VALUE" for name in HEADER)
    if not first.startswith("#") or tuple(words[::2]) != HEADER:
        raise SourceError(f"{path}, line 1: expected the sensor's description, '{expected}'")
    values = row(Path(path), 1, words[1::2], len(HEADER), expected)
    return dict(zip(HEADER, values, strict=True))


@lru_cache(maxsize=4)
def _load(path: str, rate: float, _: tuple) -> Log:
    frames, seen, moved = _lines(Path(path))
    planar = bool((np.abs(seen[:, 4]) < FLAT).all() and (np.abs(moved[:, [2, 4, 5]]) < FLAT).all())
    seen[:, 4] *= -1.0
    z, ids = by_frame(seen, frames, slice(2, 4 if planar else 5))
    points, point_ids, poses = _truth(path, frames, planar)
    return Log(
        times=frozen(np.arange(frames) / rate),
        z=z,
        ids=ids,
        labels=PLANAR if planar else SPATIAL,
        u=frozen(moved[:, [0, 1, 3]] if planar else _increments(moved)),
        poses=poses,
        points=points,
        point_ids=point_ids,
    )


def _lines(path: Path) -> tuple[int, Mat, Mat]:
    """Number of frames F, measurements (M, 5) and the increments (F, 6) that lead to each frame."""
    frames, seen, moved = 0, [], {}
    for number, line in text_lines(path, EXPECTED):
        fields = line.split("#", 1)[0].split()
        if not fields:
            continue
        columns, expected = WORDS.get(fields[0], (0, ""))
        if not columns:
            raise SourceError(f"{path}, line {number}: '{fields[0]}' is unknown; lines: {EXPECTED}")
        values = row(path, number, fields[1:], columns, expected)
        frames += fields[0] == "SF"
        if values[0] != frames - 1:
            raise SourceError(
                f"{path}, line {number}: frame {values[0]:g}, expected {frames - 1}: frames are "
                "numbered from 0 and their lines stand together"
            )
        if fields[0] == "ODO":
            moved[frames] = values[1:]
        elif fields[0] == "OBS":
            if values[2] <= 0.0:
                raise SourceError(f"{path}, line {number}: a range of {values[2]:g} is not > 0")
            seen.append(values)
    missing = next((k for k in range(1, frames) if k not in moved), None)
    if not seen or missing is not None:
        what = "no line OBS" if not seen else f"no line ODO {(missing or 1) - 1}"
        raise SourceError(f"{path} has {what}: give a complete log, lines: {EXPECTED}")
    return frames, np.array(seen), np.array([moved.get(k, [0.0] * 6) for k in range(frames)])


def _increments(moved: Mat) -> Mat:
    """(dx, dy, dz) and rotation vector (F, 6) of rows x y z yaw pitch roll."""
    q = np.array([quaternion.from_euler(*r[:2:-1]) for r in moved])
    turns = [quaternion.to_rotation_vector(a)[0] for a in q]
    return np.concatenate([moved[:, :3], turns], axis=1)


def _truth(
    path: str, frames: int, planar: bool
) -> tuple[Vec | None, np.ndarray | None, Vec | None]:
    """Points (L, d), their identities and the true poses (F, n), where files give them."""
    of_map, of_path = _truth_files(path)
    points = ids = poses = None
    if of_map.exists():
        rows, _ = read_numbers(of_map, 7, "x y z 5 0 0 landmark")
        points, ids = frozen(rows[:, : 2 if planar else 3]), fixed(rows[:, 6].astype(int))
    if of_path.exists():
        rows, _ = read_numbers(of_path, 6, "x y z yaw pitch roll")
        if len(rows) != frames:
            raise SourceError(
                f"{of_path} has {len(rows)} poses and {path} {frames} frames: give one per frame"
            )
        q = np.array([quaternion.from_euler(*r[:2:-1]) for r in rows])
        poses = frozen(rows[:, [0, 1, 3]] if planar else np.concatenate([rows[:, :3], q], axis=1))
    return points, ids, poses
