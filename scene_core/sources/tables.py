"""Text files of numbers in columns, read so that every complaint names file and line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.ports import SourceError


def fingerprint(path: str | Path) -> tuple:
    """What tells that a file is still the one that was read: path, size, time of change."""
    try:
        s = Path(path).stat()
    except OSError as e:
        raise SourceError(f"{path} can not be opened: {e.strerror or e}") from e
    return str(path), s.st_size, s.st_mtime_ns


def read_numbers(path: Path, columns: int, expected: str) -> tuple[Vec, list[int]]:
    """The numbers (K, columns) of a file, and the line number of each row.

    `#` or `%` starts a comment; columns are separated by blanks, tabs or commas.

    Raises SourceError naming file and line for a wrong number of fields, for what is not a number
    or not finite, and for a file without numbers; `expected` names the columns.
    """
    rows: list[list[float]] = []
    lines: list[int] = []
    for number, line in text_lines(path, expected):
        fields = line.replace("%", "#").split("#", 1)[0].replace(",", " ").split()
        if fields:
            rows.append(row(path, number, fields, columns, expected))
            lines.append(number)
    if not rows:
        raise SourceError(f"{path} has no data: expected lines '{expected}'")
    return np.array(rows), lines


def text_lines(path: Path, expected: str) -> Iterator[tuple[int, str]]:
    """The lines of a text file with their numbers, from 1. Raises SourceError when it can not be
    opened or is no text; `expected` says what should be in it."""
    try:
        with path.open(encoding="utf-8") as file:
            yield from enumerate(file, start=1)
    except OSError as e:
        raise SourceError(f"{path} can not be opened: {e.strerror or e}") from e
    except UnicodeDecodeError as e:
        raise SourceError(f"{path} is not a text file: expected lines '{expected}'") from e


def row(path: Path, number: int, fields: Sequence[str], columns: int, expected: str) -> list[float]:
    """The fields of one line as finite numbers. Raises SourceError naming file and line."""
    if len(fields) != columns:
        raise SourceError(
            f"{path}, line {number}: {len(fields)} fields, expected {columns}: {expected}"
        )
    try:
        values = [float(field) for field in fields]
    except ValueError:
        bad = next(field for field in fields if not _is_number(field))
        raise SourceError(
            f"{path}, line {number}: '{bad}' is not a number; expected {expected}"
        ) from None
    for field, value in zip(fields, values, strict=True):
        if not math.isfinite(value):
            raise SourceError(
                f"{path}, line {number}: '{field}' is not finite: correct or remove the line"
            )
    return values


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
