"""A hand-held camera round a box of AprilTags, whose corners are told apart by their tags.

Source: D. Scaramuzza, course *Vision Algorithms for Mobile Robotics*, ETH and University of
Zurich, exercise 2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.ports import SourceError
from scene_core.geometry import quaternion
from scene_core.params import param
from scene_core.sources.recorded import Log, Logged, by_frame, fixed, folder, needed
from scene_core.sources.reference import load_reference
from scene_core.sources.tables import fingerprint, read_numbers

FILES = ("K.txt", "p_W_corners.txt", "tag_corners.txt")
FOLDER = f"give the folder with {', '.join(FILES)} and, for the true path, poses_pnp.txt"
CORNERS = "frame tag u0 v0 u1 v1 u2 v2 u3 v3"
TAGS_OF_KNOWN = (24, 25, 26, 27, 16, 17, 18, 19, 21, 23, 20, 22)
"""Known point j is the second corner of tag TAGS_OF_KNOWN[j]."""
CENTIMETRE = 0.01


@dataclass(frozen=True)
class Tagbox(Logged):
    """Corners of the tags that were found in undistorted images, pixels (u, v).

    The identity of a corner is 4 tag + corner. World axes are the box's, in metres; the points of
    p_W_corners.txt (in centimetres) are the true landmarks.
    """

    path: str
    """Folder with K.txt, p_W_corners.txt, tag_corners.txt and, if there is one, poses_pnp.txt."""
    rate: float = param(30.0, unit="Hz", lo=0.1, hi=1000.0, soft=(1.0, 60.0), effect="on reset")
    """Images per second."""
    robot: str = "camera"
    """The robot's name."""
    mount: str = "camera"
    """The sensor's name."""

    @property
    def K(self) -> Mat:
        """(3, 3) calibration matrix, pixels."""
        return _calibration(self.path, self._prints())

    def known(self) -> Mapping[int, Vec]:
        """The points of p_W_corners.txt [m] by identity."""
        log = self._log()
        assert log.points is not None and log.point_ids is not None
        return dict(zip(log.point_ids.tolist(), log.points, strict=True))

    def start_pose(self) -> Vec:
        """Pose of the camera at frame 0 (7,), from all known points that it saw."""
        log, known = self._log(), self.known()
        sightings = zip(log.ids[0].tolist(), log.z[0], strict=True)
        seen = [(known[i], z) for i, z in sightings if i in known]
        if len(seen) < 6:
            raise SourceError(
                f"{self.path}: the first image shows {len(seen)} of the known points, 6 are needed "
                "to start: begin the recording at another image"
            )
        places, pixels = (np.array(part) for part in zip(*seen, strict=True))
        found, turn, shift = cv2.solvePnP(places, pixels, self.K, np.zeros(0))
        if not found:
            raise SourceError(
                f"{self.path}: no pose of the camera fits the known points in the first image; "
                "are p_W_corners.txt and tag_corners.txt of the same recording?"
            )
        # OpenCV's is the box seen from the camera.
        theta, t = frozen(turn[:, 0]), frozen(shift[:, 0])
        q = quaternion.conjugate(quaternion.from_rotation_vector(theta)[0])
        return frozen(np.concatenate([-quaternion.rotate(q, t).v, q]))

    def _prints(self) -> tuple:
        at = folder(self.path, FOLDER)
        files = [needed(at / name, FOLDER) for name in FILES]
        poses = [p for p in (at / "poses_pnp.txt",) if p.exists()]
        return tuple(fingerprint(p) for p in (*files, *poses))

    def _log(self) -> Log:
        return _load(self.path, self.rate, self._prints())


@lru_cache(maxsize=4)
def _calibration(path: str, _: tuple) -> Mat:
    file = Path(path) / "K.txt"
    K, _lines = read_numbers(file, 3, "a row of the calibration matrix K")
    if K.shape != (3, 3) or K[0, 0] <= 0 or K[1, 1] <= 0 or (K[2] != (0.0, 0.0, 1.0)).any():
        raise SourceError(f"{file}: expected 3 rows fu 0 u0, 0 fv v0, 0 0 1 with fu and fv > 0")
    return frozen(K)


@lru_cache(maxsize=4)
def _load(path: str, rate: float, _: tuple) -> Log:
    tags, places = (Path(path) / name for name in ("tag_corners.txt", "p_W_corners.txt"))
    corners, lines = read_numbers(tags, 10, CORNERS)
    at = corners[:, 0]
    for k in range(len(corners)):
        if at[k] < 1 or at[k] != int(at[k]) or (k and at[k] < at[k - 1]):
            raise SourceError(
                f"{tags}, line {lines[k]}: frame {at[k]:g}: frames are whole "
                "numbers from 1 and do not go back"
            )
    frames = int(at[-1])
    names = (4 * corners[:, 1:2] + np.arange(4)).reshape(-1, 1)
    at_corner = np.repeat(at - 1, 4)[:, None]
    rows = np.concatenate([at_corner, names, corners[:, 2:].reshape(-1, 2)], axis=1)
    z, ids = by_frame(rows, frames, slice(2, 4))
    points, _lines = read_numbers(places, 3, "x y z of a known point in cm")
    if len(points) != len(TAGS_OF_KNOWN):
        raise SourceError(f"{places} has {len(points)} points, expected {len(TAGS_OF_KNOWN)}")
    return Log(
        times=frozen(np.arange(frames) / rate),
        z=z,
        ids=ids,
        poses=_poses(Path(path) / "poses_pnp.txt", frames),
        points=frozen(CENTIMETRE * points),
        point_ids=fixed(4 * np.array(TAGS_OF_KNOWN) + 1),
    )


def _poses(path: Path, frames: int) -> Vec | None:
    """(F, 7) poses of the reference, NaN where it has none; None without the file."""
    if not path.exists():
        return None
    reference = load_reference(str(path), "rms")
    poses = [reference.near(k + 1, within=0.1) for k in range(frames)]
    unknown = np.full(7, np.nan)
    return frozen(np.array([unknown if pose is None else pose for pose in poses]))
