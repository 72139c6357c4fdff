"""Whether a value from outside fits a parameter: its type, its range, and why it does not."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

MOST_ROWS = 1000
MOST_COLUMNS = 16


class ParamError(ValueError):
    """A value from outside does not fit: the message says what, where, the range and the remedy."""


def check_value(path: str, value: Any, old: Any, meta: Mapping[str, Any]) -> Any:
    """`value` converted to the type of `old`; raises ParamError when it does not fit."""
    unit = f" {meta['unit']}" if meta["unit"] else ""
    if meta["choices"] is not None:
        if value not in meta["choices"]:
            raise ParamError(f"{path} = {value!r}: choose one of {', '.join(meta['choices'])}")
        return value
    if isinstance(old, bool):
        if not isinstance(value, bool):
            raise ParamError(f"{path} = {value!r}: give true or false")
        return value
    if isinstance(old, str):
        if not isinstance(value, str) or len(value) > 4096:
            raise ParamError(f"{path}: give a text of at most 4096 characters")
        return value
    if meta.get("rows") and isinstance(old, tuple):
        return _rows(path, value, meta, unit)
    if isinstance(old, tuple):
        if not isinstance(value, (list, tuple)) or len(value) != len(old):
            raise ParamError(f"{path} = {value!r}: give {len(old)} numbers")
        return tuple(_number(path, v, float, meta, unit) for v in value)
    return _number(path, value, int if isinstance(old, int) else float, meta, unit)


def _rows(
    path: str, value: Any, meta: Mapping[str, Any], unit: str
) -> tuple[tuple[float, ...], ...]:
    """A list of rows of numbers, all of one length."""
    value = rows_typed(value) if isinstance(value, str) else value
    rows = value if isinstance(value, (list, tuple)) else None
    if rows is None or len(rows) > MOST_ROWS:
        raise ParamError(
            f"{path}: give at most {MOST_ROWS} rows of numbers, as a list of lists or like "
            "1.5, 2; 0, -3"
        )
    for i, row in enumerate(rows, 1):
        if not isinstance(row, (list, tuple)) or not 0 < len(row) <= MOST_COLUMNS:
            raise ParamError(f"{path}, row {i} is {row!r:.60}: give a list of numbers")
        if len(row) != len(rows[0]):
            raise ParamError(
                f"{path}, row {i} has {len(row)} numbers and row 1 has {len(rows[0])}: give as "
                "many in every row"
            )
    return tuple(
        tuple(_number(f"{path}, row {i}", v, float, meta, unit) for v in row)
        for i, row in enumerate(rows, 1)
    )


def rows_text(rows: tuple[tuple[float, ...], ...], scale: float = 1.0) -> str:
    """Rows as people type them: 1.5, 2; 0, -3."""
    return "; ".join(", ".join(f"{v * scale:.6g}" for v in row) for row in rows)


def rows_typed(text: str, scale: float = 1.0) -> list[list[float]] | str:
    """What `rows_text` writes, read; a text that is none stays one, to be refused."""
    rows = [row.split(",") for row in text.split(";") if row.strip()]
    try:
        return [[float(v) / scale for v in row] for row in rows]
    except ValueError:
        return text


def _number(path: str, value: Any, kind: type, meta: Mapping[str, Any], unit: str) -> Any:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ParamError(f"{path} = {value!r}: give a number{unit and ' in' + unit}")
    if not abs(value) <= sys.float_info.max:
        shown = value if isinstance(value, float) else "an integer of that size"
        raise ParamError(f"{path} = {shown}: give a finite number")
    lo, hi = meta["lo"], meta["hi"]
    if (lo is not None and value < lo) or (hi is not None and value > hi):
        low = "-inf" if lo is None else f"{lo:g}"
        high = "inf" if hi is None else f"{hi:g}"
        raise ParamError(f"{path} = {value:g}{unit} is outside [{low}, {high}]{unit}")
    if kind is int and value != int(value):
        raise ParamError(f"{path} = {value:g}: give a whole number")
    return kind(value)
