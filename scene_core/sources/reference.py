"""Reference trajectories of recordings: where the robot really was, as far as somebody knows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from scene_core.arrays import Vec, frozen
from scene_core.filter.ports import SourceError
from scene_core.sources.tables import fingerprint, read_numbers


@dataclass(frozen=True)
class Reference:
    """Poses of the robot at some frames or times."""

    at: Vec
    """(K,) frame numbers or seconds since the first frame, increasing."""
    poses: Vec
    """(K, 7) x y z qw qx qy qz."""

    def near(self, at: float, within: float) -> Vec | None:
        """The pose given for a frame or time no farther than `within`, or None."""
        if len(self.at) == 0:
            return None
        k = int(np.searchsorted(self.at, at))
        near = min(
            (j for j in (k - 1, k) if 0 <= j < len(self.at)), key=lambda j: abs(self.at[j] - at)
        )
        return self.poses[near] if abs(self.at[near] - at) <= within else None


def load_reference(path: str, more: str = "") -> Reference:
    """Read lines `frame x y z qx qy qz qw` (or with a time first); `#` starts a comment. `more`
    names further columns, which are not used.

    Raises SourceError with file and line where a line is not eight numbers, the first column does
    not grow, or a quaternion is not of unit length to 1 %.
    """
    return _load(path, more, fingerprint(path))


@lru_cache(maxsize=8)
def _load(path: str, more: str, _: tuple) -> Reference:
    columns = 8 + len(more.split())
    rows, lines = read_numbers(Path(path), columns, f"frame x y z qx qy qz qw {more}".rstrip())
    at, q = rows[:, 0], rows[:, [7, 4, 5, 6]]
    length = np.linalg.norm(q, axis=1)
    for k in range(len(rows)):
        if abs(length[k] - 1.0) > 0.01:
            raise SourceError(
                f"{path}, line {lines[k]}: the quaternion has length {length[k]:.3g}, expected 1; "
                "the columns are frame x y z qx qy qz qw"
            )
        if k and at[k] <= at[k - 1]:
            raise SourceError(
                f"{path}, line {lines[k]}: {at[k]:g} in the first column does not come after "
                f"{at[k - 1]:g}: sort the file"
            )
    poses = np.concatenate([rows[:, 1:4], q / length[:, None]], axis=1)
    return Reference(frozen(at), frozen(poses))
