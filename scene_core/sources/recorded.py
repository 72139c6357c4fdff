"""What recordings with identified landmarks share: frames out of tables, answers by identity."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from scene_core.arrays import Vec, frozen
from scene_core.filter.policies import Vision
from scene_core.filter.ports import (
    Control,
    Detection,
    EndOfData,
    Frame,
    Match,
    Occupied,
    Points,
    Query,
    SourceError,
    Truth,
)
from scene_core.geometry.spaces import wrap
from scene_core.sources.points import detect_identities, match_points, nearest_identity


@dataclass(frozen=True)
class Log:
    """A recording of one robot with one sensor, frame by frame."""

    times: Vec
    """(F,) seconds since the first frame."""
    z: tuple[Vec, ...]
    """Measurements (k, m) of every frame; none: the sensor did not fire."""
    ids: tuple[np.ndarray, ...]
    """Their landmarks' identities (k,), int."""
    labels: tuple[str, ...] = ()
    """What the controls are."""
    u: Vec | None = None
    """(F, nu) controls that lead from the frame before to each; the first row is not used."""
    poses: Vec | None = None
    """(F, n) true position states, NaN where unknown."""
    points: Vec | None = None
    """(L, d) true landmarks."""
    point_ids: np.ndarray | None = None
    """(L,) int."""

    def frame(self, index: int, robot: str, mount: str) -> Frame:
        """Frame `index` of the recording."""
        dt = float(self.times[index] - self.times[index - 1]) if index else 0.0
        controls = {}
        if self.u is not None:
            steps = (Control(dt, self.labels, self.u[index]),) if index else ()
            controls[robot] = steps
        z, ids = self.z[index], self.ids[index]
        return Frame(
            index=index,
            time=float(self.times[index]),
            dt=dt,
            controls=controls,
            raw={mount: Points(z, ids)} if len(z) else {},
            truth=self._truth(index, robot),
        )

    def _truth(self, index: int, robot: str) -> Truth | None:
        known = self.poses is not None and np.isfinite(self.poses[index]).all()
        xp = {robot: self.poses[index]} if known and self.poses is not None else {}
        if self.points is None or self.point_ids is None:
            return Truth(xp) if xp else None
        return Truth(xp, {}, self.points, self.point_ids)


class Recording(ABC):
    """A source that plays a recording whose measurements say whose they are."""

    angles: ClassVar[tuple[int, ...]] = ()
    """Components of a measurement that are angles."""

    @abstractmethod
    def times(self) -> Vec:
        """Times (F,) of the frames in seconds."""

    @abstractmethod
    def frame(self, index: int) -> Frame:
        """Frame `index`, which exists."""

    @property
    def frame_count(self) -> int | None:
        """Frames of the recording."""
        return len(self.times())

    @property
    def frame_rate(self) -> float:
        """Mean number of frames per second."""
        times = self.times()
        return (len(times) - 1) / float(times[-1] - times[0]) if len(times) > 1 else 1.0

    def start(self) -> None:
        """A recording has no state. Raises SourceError when it can not be read."""
        self.times()

    def advance(self, state: None, index: int) -> tuple[Frame, None]:
        """Frame `index`; EndOfData past the last."""
        if not 0 <= index < len(self.times()):
            raise EndOfData
        return self.frame(index), None

    def search(self, frame: Frame, query: Query, vision: Vision) -> Sequence[Match]:
        """Measurements by identity, or by the nearest one in the gate."""
        return match_points(_points(frame, query.mount), query, self._innovation)

    def detect(
        self, frame: Frame, mount: str, occupied: Occupied, count: int, vision: Vision
    ) -> Sequence[Detection]:
        """Landmarks that are not mapped yet."""
        return detect_identities(_points(frame, mount), occupied, count)

    def appearance_at(self, frame: Frame, mount: str, z: Vec, vision: Vision) -> Detection | None:
        """The measurement nearest to where somebody pointed."""
        return nearest_identity(_points(frame, mount), z)

    def _innovation(self, h: Vec, z: Vec) -> Vec:
        nu = z - h
        for i in self.angles:
            nu[..., i] = wrap(nu[..., i])
        return nu


class Logged(Recording):
    """A recording of one robot with one sensor, all of which is in one `Log`."""

    path: str
    robot: str
    mount: str

    @abstractmethod
    def _log(self) -> Log:
        """The recording. Raises SourceError when it can not be read."""

    def times(self) -> Vec:
        return self._log().times

    def frame(self, index: int) -> Frame:
        return self._log().frame(index, self.robot, self.mount)

    def start_pose(self) -> Vec:
        """The true position state (n,) at frame 0, where the estimate may start."""
        poses = self._log().poses
        if poses is None or not np.isfinite(poses[0]).all():
            raise SourceError(f"{self.path}: there is no true pose where the recording starts")
        return poses[0]


def _points(frame: Frame, mount: str) -> Points:
    raw = frame.raw[mount]
    assert isinstance(raw, Points), f"{mount} sent no points in frame {frame.index}"
    return raw


def by_frame(rows: Vec, frames: int, columns: slice) -> tuple[tuple[Vec, ...], tuple[Vec, ...]]:
    """Measurements and identities of every frame, from rows (M, 2 + m): frame, identity, ..."""
    order = np.argsort(rows[:, 0], kind="stable")
    rows = rows[order]
    cuts = np.searchsorted(rows[:, 0], np.arange(1, frames))
    z = tuple(frozen(part) for part in np.split(rows[:, columns], cuts))
    ids = tuple(fixed(part.astype(int)) for part in np.split(rows[:, 1], cuts))
    return z, ids


def fixed(a: np.ndarray) -> np.ndarray:
    """The same array, read-only."""
    a.flags.writeable = False
    return a


def needed(path: Path, what: str) -> Path:
    """The same path. Raises SourceError unless it is there; `what` says what to give."""
    if not path.exists():
        raise SourceError(f"{path} is missing: {what}")
    return path


def folder(path: str, what: str) -> Path:
    """The path of a folder. Raises SourceError unless it is one."""
    if not Path(path).is_dir():
        raise SourceError(f"there is no folder {path}: {what}")
    return Path(path)
