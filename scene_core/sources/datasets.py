"""The log of a planar robot as a source: UTIAS MRCLAM.

Source: Leung, Halpern, Barfoot, Liu, *The UTIAS multi-robot cooperative localization and mapping
dataset*, IJRR 30(8), 2011.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.ports import Control, Frame, Points, SourceError, Truth
from scene_core.params import param
from scene_core.sources.recorded import Recording, fixed
from scene_core.sources.tables import fingerprint, read_numbers

ROBOT_SUBJECTS = 5
"""Subjects 1 to 5 are robots; the others are landmarks."""
SAME_TIME = 1e-3
"""Measurements nearer in time than this belong to one frame, seconds."""
LONGEST_GAP = 0.5
"""Ground truth is not interpolated over a longer gap than this, seconds."""


@dataclass(frozen=True)
class Mrclam(Recording):
    """One robot of an MRCLAM data set: odometry (v, w) held between its samples, range and bearing
    to landmarks that carry barcodes.

    A frame is a time at which landmarks were measured; where none was seen for `idle_s`, a frame
    without measurements is put in. Axes: the world's x and y are z and x of the planar state
    (z, x, phi), and phi turns from x towards y. Other robots and unknown barcodes are left out.
    """

    path: str
    """Folder with Barcodes.dat, Landmark_Groundtruth.dat and the three files of each robot."""
    robot_number: int = param(2, lo=1, hi=ROBOT_SUBJECTS, effect="on reset")
    """Which robot's log is played."""
    idle_s: float = param(1.0, unit="s", lo=0.05, hi=60.0, effect="on reset")
    """A frame comes at least this often, whether a landmark was seen or not."""
    robot: str = "robot"
    """The robot's name."""
    mount: str = "camera"
    """The sensor's name."""

    angles: ClassVar[tuple[int, ...]] = (1,)

    def start_pose(self) -> Vec:
        """True (z, x, phi) at frame 0: where the estimate may start."""
        log = self._log()
        pose = log.pose(float(log.times[0]))
        if pose is None:
            raise SourceError(f"{self.path}: there is no ground truth where the log starts")
        return pose

    def times(self) -> Vec:
        return self._log().times

    def frame(self, index: int) -> Frame:
        log = self._log()
        now = float(log.times[index])
        before = float(log.times[index - 1]) if index else now
        a, b = log.rows[index]
        return Frame(
            index=index,
            time=now - float(log.times[0]),
            dt=now - before,
            controls={self.robot: log.controls(before, now)},
            raw={self.mount: Points(log.z[a:b], log.ids[a:b])} if b > a else {},
            truth=self._truth(log, now),
        )

    def _log(self) -> _Log:
        return _load(self.path, self.robot_number, self.idle_s, _fingerprints(self))

    def _truth(self, log: _Log, now: float) -> Truth | None:
        pose = log.pose(now)
        return Truth(
            {self.robot: pose} if pose is not None else {}, {}, log.landmarks, log.subjects
        )


@dataclass(frozen=True)
class _Log:
    times: Vec
    """(F,) of the frames, Unix seconds."""
    rows: Mat
    """(F, 2) first and last (exclusive) measurement of each frame, int."""
    z: Vec
    """(M, 2) range m, bearing rad."""
    ids: Vec
    """(M,) subjects, int."""
    odometry: Vec
    """(K, 3) time, v m/s, w rad/s."""
    truth: Vec
    """(G, 4) time, z, x, phi (unwrapped)."""
    landmarks: Vec
    """(L, 2) z, x."""
    subjects: Vec
    """(L,) int."""

    def controls(self, start: float, end: float) -> tuple[Control, ...]:
        """The odometry samples in force between two times, in order."""
        t = self.odometry[:, 0]
        first = int(np.searchsorted(t, start, side="right")) - 1
        last = int(np.searchsorted(t, end, side="left"))
        out = []
        for k in range(first, last):
            begin = max(start, float(t[k])) if k >= 0 else start
            stop = min(end, float(t[k + 1])) if k + 1 < len(t) else end
            if stop > begin:
                u = self.odometry[k, 1:] if k >= 0 else np.zeros(2)
                out.append(Control(stop - begin, ("v", "w"), u))
        return tuple(out)

    def pose(self, now: float) -> Vec | None:
        """True (z, x, phi) by linear interpolation; None outside the log and in long gaps."""
        t = self.truth[:, 0]
        k = int(np.searchsorted(t, now))
        if k < len(t) and t[k] == now:
            k += k == 0
        if not 0 < k < len(t) or t[k] - t[k - 1] > LONGEST_GAP:
            return None
        s = (now - t[k - 1]) / (t[k] - t[k - 1])
        pose = (1.0 - s) * self.truth[k - 1, 1:] + s * self.truth[k, 1:]
        pose[2] = np.pi - np.mod(np.pi - pose[2], 2.0 * np.pi)
        return frozen(pose)


def _files(path: str, robot: int) -> Mapping[str, Path]:
    folder = Path(path)
    return {
        "barcodes": folder / "Barcodes.dat",
        "landmarks": folder / "Landmark_Groundtruth.dat",
        "odometry": folder / f"Robot{robot}_Odometry.dat",
        "measurements": folder / f"Robot{robot}_Measurement.dat",
        "truth": folder / f"Robot{robot}_Groundtruth.dat",
    }


def _fingerprints(source: Mrclam) -> tuple:
    folder = Path(source.path)
    if not folder.is_dir():
        raise SourceError(f"there is no folder {folder}: give the folder of an MRCLAM data set")
    for file in _files(source.path, source.robot_number).values():
        if not file.exists():
            robots = sorted(p.name[5:-13] for p in folder.glob("Robot*_Odometry.dat"))
            raise SourceError(
                f"{file} is missing; the folder has the logs of robots "
                f"{', '.join(robots) or 'none'}"
            )
    return tuple(fingerprint(f) for f in _files(source.path, source.robot_number).values())


@lru_cache(maxsize=4)
def _load(path: str, robot: int, idle_s: float, _: tuple) -> _Log:
    files = _files(path, robot)
    barcodes, _lines = read_numbers(files["barcodes"], 2, "subject barcode")
    subject = {int(code): int(s) for s, code in barcodes}
    landmarks, _lines = read_numbers(files["landmarks"], 5, "subject x y sd_x sd_y")
    odometry = _in_order(files["odometry"], 3, "time v w")
    measured = _in_order(files["measurements"], 4, "time barcode range bearing")
    truth = _in_order(files["truth"], 4, "time x y theta")
    truth[:, 3] = np.unwrap(truth[:, 3])
    ids = np.array([subject.get(int(code), 0) for code in measured[:, 1]])
    start = max(odometry[0, 0], truth[0, 0])
    end = odometry[-1, 0]
    keep = (ids > ROBOT_SUBJECTS) & (measured[:, 0] >= start) & (measured[:, 0] <= end)
    measured, ids = measured[keep], ids[keep]
    if not len(ids):
        raise SourceError(f"{files['measurements']}: no landmark was measured during the odometry")
    times, rows = _frames(measured[:, 0], float(start), float(end), idle_s)
    return _Log(
        times=frozen(times),
        rows=rows,
        z=frozen(measured[:, 2:]),
        ids=fixed(ids),
        odometry=frozen(odometry),
        truth=frozen(truth),
        landmarks=frozen(landmarks[:, 1:3]),
        subjects=fixed(landmarks[:, 0].astype(int)),
    )


def _in_order(path: Path, columns: int, expected: str) -> Vec:
    rows, lines = read_numbers(path, columns, expected)
    back = np.flatnonzero(np.diff(rows[:, 0]) < 0.0)
    if len(back):
        k = int(back[0]) + 1
        raise SourceError(
            f"{path}, line {lines[k]}: time {rows[k, 0]:.3f} comes before the line above: sort it"
        )
    return rows


def _frames(at: Vec, start: float, end: float, idle_s: float) -> tuple[Vec, np.ndarray]:
    """Times (F,) of the frames and their measurements (F, 2), from the times `at` (M,) of the
    measurements: one frame per distinct time, the start, and fillers in between."""
    heads = np.flatnonzero(np.concatenate([[True], np.diff(at) > SAME_TIME]))
    tails = np.concatenate([heads[1:], [len(at)]])
    first = at[heads[0]] - start <= SAME_TIME
    times, rows = ([], []) if first else ([start], [(0, 0)])
    for a, b in zip(heads.tolist(), tails.tolist(), strict=True):
        fillers = _between(times[-1], float(at[a]), idle_s) if times else []
        times += [*fillers, float(at[a])]
        rows += [(0, 0)] * len(fillers) + [(a, b)]
    fillers = _between(times[-1], end, idle_s)
    return np.array(times + fillers), fixed(np.array(rows + [(0, 0)] * len(fillers)))


def _between(start: float, end: float, step: float) -> list[float]:
    """start + step, start + 2 step, ... before end."""
    return [start + k * step for k in range(1, int(np.ceil((end - start) / step)))]
