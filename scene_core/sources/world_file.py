"""A simulated world from a file of the user's own."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.geometry.spaces import SPACES, Space
from scene_core.params import ParamError, param
from scene_core.sources.toml_text import parsed
from scene_core.sources.worlds import KnownPoint, SimulatedWorld
from scene_core.text_file import text_of

KEYS = ("points", "ids", "segments", "known", "sd")
FARTHEST = 1e5
"""m: no coordinate is larger."""
MOST = 20000
"""Points, and segments."""
EXAMPLE = "points = [[1.0, 2.0, 0.5], [3.0, 0.0, 1.0]]"


@dataclass(frozen=True)
class WorldFile(SimulatedWorld):
    """Points and segments from a TOML file, in m and in the axes of the simulation.

    points = [[x, y, z], ...]                    2-D: [z, x], 1-D: [z]
    ids = [1, 2, ...]                            optional: identities of the points
    segments = [[[x, y, z], [x, y, z]], ...]     optional: ends of straight lines
    known = true                                 optional: the estimator is given the points, or
                                                 those with these identities: known = [1, 2]
    sd = 0.01                                    optional: standard deviation of what it is given

    How many numbers a point has says whether the world is 1-D, 2-D or 3-D. The file is read when
    its path is given. Raises ParamError with one sentence about whatever does not fit.
    """

    name: ClassVar[str] = "world file"
    any_space: ClassVar[bool] = True
    path: str = param("", effect="on reset", label="World file")
    """Path of the file."""
    content: Content | None = field(init=False, repr=False, compare=False, default=None)
    """What was read; None without a path."""

    def __post_init__(self) -> None:
        if self.path:
            object.__setattr__(self, "content", read_world(self.path))

    @property
    def space(self) -> Space:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Of as many dimensions as the file's points have."""
        return SPACES[self._read().points.shape[1]]

    def points(self) -> tuple[np.ndarray, Vec]:
        content = self._read()
        return content.ids, content.points

    def segments(self) -> Mat:
        return self._read().segments

    def known(self) -> tuple[KnownPoint, ...]:
        return self._read().known

    def wanting(self) -> str:
        return "" if self.path else "give the path of its file"

    def version(self) -> Hashable:
        content = self._read()
        return content.ids.tobytes(), content.points.tobytes(), content.segments.tobytes()

    def _read(self) -> Content:
        if self.content is None:
            raise ParamError(
                f"the world '{self.name}' has no file: give the path of a TOML file with a line "
                f"like {EXAMPLE}"
            )
        return self.content


class Content(NamedTuple):
    """What a world file says."""

    ids: np.ndarray
    """(K,)."""
    points: Vec
    """(K, d) m."""
    segments: Mat
    """(M, 2, d) m."""
    known: tuple[KnownPoint, ...]


def read_world(path: str) -> Content:
    """The world in a TOML file; raises ParamError with one sentence about what does not fit."""
    content = _toml(Path(path))
    unknown = [key for key in content if key not in KEYS]
    if unknown:
        raise ParamError(f"{path}: there is no key '{unknown[0]}': a world has {', '.join(KEYS)}")
    rows = _list(path, "points", content.get("points", []))
    pairs = _list(path, "segments", content.get("segments", []))
    if not rows and not pairs:
        raise ParamError(f"{path}: the world is empty: give it a line like {EXAMPLE}")
    if not rows and not _is_pair(pairs[0]):
        raise ParamError(_no_pair(path, "segments, row 1", pairs[0]))
    first = rows[0] if rows else pairs[0][0]
    d = len(first) if isinstance(first, list) else 0
    if d not in SPACES:
        where = "points, row 1" if rows else "segments, row 1, end 1"
        raise ParamError(f"{path}: {where} is {_shown(first)}: give a list of 1, 2 or 3 numbers")
    points = [_place(path, f"points, row {i}", row, d) for i, row in enumerate(rows, 1)]
    segments = [_segment(path, f"segments, row {i}", pair, d) for i, pair in enumerate(pairs, 1)]
    ids = _ids(path, content.get("ids"), len(points))
    return Content(
        ids=np.array(ids, dtype=int),
        points=frozen(np.array(points, dtype=np.float64).reshape(-1, d)),
        segments=frozen(np.array(segments, dtype=np.float64).reshape(-1, 2, d)),
        known=_known(path, content, ids, points),
    )


def _toml(path: Path) -> dict[str, Any]:
    try:
        text = text_of(path, f"a world file (TOML) like {EXAMPLE}")
    except ValueError as e:
        raise ParamError(str(e)) from e
    try:
        return parsed(text)
    except ValueError as e:
        raise ParamError(f"{path} is not valid TOML: {e}; a world file is like {EXAMPLE}") from e


def _list(path: str, key: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ParamError(f"{path}: {key} is {_shown(value)}: give a list of lists of numbers")
    if len(value) > MOST:
        raise ParamError(f"{path}: there are {len(value)} {key}: give at most {MOST}")
    return value


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2


def _no_pair(path: str, where: str, value: Any) -> str:
    return f"{path}: {where} is {_shown(value)}: give its two ends, [[...], [...]]"


def _place(path: str, where: str, row: Any, d: int) -> list[float]:
    if not isinstance(row, list) or len(row) != d:
        raise ParamError(
            f"{path}: {where} is {_shown(row)}: give {d} number{'s' * (d > 1)} in m, like the "
            "first one"
        )
    for value in row:
        _number(path, where, value, -FARTHEST, FARTHEST)
    return [float(value) for value in row]


def _segment(path: str, where: str, pair: Any, d: int) -> list[list[float]]:
    if not _is_pair(pair):
        raise ParamError(_no_pair(path, where, pair))
    ends = [_place(path, f"{where}, end {i}", end, d) for i, end in enumerate(pair, 1)]
    if ends[0] == ends[1]:
        raise ParamError(f"{path}: {where} has no length: give two different ends")
    return ends


def _ids(path: str, ids: Any, count: int) -> list[int]:
    if ids is None:
        return list(range(1, count + 1))
    if not isinstance(ids, list) or len(ids) != count:
        many = len(ids) if isinstance(ids, list) else _shown(ids)
        raise ParamError(f"{path}: ids: {many} for {count} points: give one for each point")
    seen: set[int] = set()
    for i, one in enumerate(ids, 1):
        if isinstance(one, bool) or not isinstance(one, int) or not 1 <= one <= 2**31 - 1:
            raise ParamError(
                f"{path}: ids, number {i} is {_shown(one)}: give a whole number from 1 to "
                "2147483647"
            )
        if one in seen:
            raise ParamError(f"{path}: ids: {one} occurs twice: give every point its own")
        seen.add(one)
    return ids


def _known(
    path: str, content: Mapping[str, Any], ids: list[int], points: list[list[float]]
) -> tuple[KnownPoint, ...]:
    given, sd = content.get("known", False), content.get("sd", 0.0)
    _number(path, "sd", sd, 0.0, FARTHEST)
    places = dict(zip(ids, points, strict=True))
    if isinstance(given, bool):
        chosen = ids if given else []
    elif isinstance(given, list) and all(type(one) is int for one in given):
        chosen = given
    else:
        raise ParamError(f"{path}: known is {_shown(given)}: give true, false or a list of ids")
    for i, one in enumerate(chosen):
        if one not in places or one in chosen[:i]:
            why = "no point has it" if one not in places else "it is there twice"
            raise ParamError(f"{path}: known has the id {one}, but {why}: give ids of points")
    return tuple(KnownPoint(one, tuple(places[one]), float(sd)) for one in chosen)


def _number(path: str, where: str, value: Any, lo: float, hi: float) -> None:
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not good or not lo <= value <= hi:
        raise ParamError(
            f"{path}: {where} has {_shown(value)}: give a finite number from {lo:g} to {hi:g} m"
        )


def _shown(value: Any) -> str:
    """A value as it stands in an error, not longer than a line."""
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
