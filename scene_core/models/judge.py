"""The tools of the conformance check: reports, numerical Jacobians, awkward states, statistics."""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import wrap

Law = tuple[str, Callable[[], str]]
"""A law in words, and a test that returns what is wrong, or nothing."""
_LIBRARIES = [sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")]
_NOT_THE_USERS = (str(Path(__file__).parents[1]), *_LIBRARIES, "<")
COUNT = 12
"""Rows that batched functions are tried with."""
DRAWS = 1500
"""Draws that a noise is judged by."""
DT = 0.05
"""[s] The one interval that motion models are tried with."""


@dataclass(frozen=True)
class Line:
    """The verdict on one law."""

    law: str
    ok: bool
    detail: str
    """What is wrong, with the worst entry named; a remark when nothing is."""


@dataclass(frozen=True)
class Report:
    """The verdict on one model."""

    model: str
    kind: str
    lines: tuple[Line, ...]
    remarks: tuple[str, ...] = ()
    """What is no offence and good to know, e.g. which Jacobians are left to numbers."""

    @property
    def ok(self) -> bool:
        return all(line.ok for line in self.lines)

    def __str__(self) -> str:
        head = f"{self.model} ({self.kind}): {'conforms' if self.ok else 'does not conform'}"
        marks = [
            f"  {'ok  ' if line.ok else 'FAIL'} {line.law}{line.detail and ': ' + line.detail}"
            for line in self.lines
        ]
        return "\n".join([head, *marks, *(f"  note {remark}" for remark in self.remarks)])


def tried(trial: Any, laws: Sequence[tuple[str, Callable[[Any], str]]]) -> list[Law]:
    """Laws about anything, ready to be tried on this."""
    return [(law, partial(test, trial)) for law, test in laws]


def run(model: str, kind: str, laws: Sequence[Law]) -> Report:
    """Try every law; a model that raises breaks the law that made it raise."""
    lines = []
    for law, test in laws:
        try:
            wrong = test()
        except Exception as error:  # a user's model may raise anything
            wrong = raised(error)
        lines.append(Line(law, not wrong, wrong))
    return Report(model, kind, tuple(lines))


def raised(error: BaseException) -> str:
    """What a model raised, and where if it was in a file of the user's own: the innermost place
    outside of this package and of what is installed."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if not f.filename.startswith(_NOT_THE_USERS)]
    where = f"{Path(own[-1].filename).name}, line {own[-1].lineno}: " if own else ""
    return f"{where}raised {type(error).__name__}: {error}"


def numeric_jacobian(
    f: Callable[..., Vec], args: Sequence[Vec], which: int, angles: np.ndarray, scale: Vec
) -> Mat:
    """d f / d args[which] (m, n) by central differences of fourth order.

    D = (4 D(h) - D(2h)) / 3, h = 1e-4 scale; angles are differenced on the circle.
    """
    x = np.asarray(args[which], dtype=np.float64)
    columns = []
    for i in range(len(x)):
        slopes = []
        for h in (1e-4 * scale[i], 2e-4 * scale[i]):
            ends = []
            for sign in (1.0, -1.0):
                moved = x.copy()
                moved[i] += sign * h
                ends.append(np.asarray(f(*args[:which], moved, *args[which + 1 :])))
            slopes.append(difference(ends[0], ends[1], angles) / (2.0 * h))
        columns.append((4.0 * slopes[0] - slopes[1]) / 3.0)
    return np.stack(columns, axis=-1) if columns else np.zeros((len(f(*args)), 0))


def difference(a: Vec, b: Vec, angles: np.ndarray) -> Vec:
    """a - b, wrapped where `angles` (m,) bool says so."""
    return np.where(angles, wrap(a - b), a - b)


def judge_jacobians(
    names: Sequence[str],
    f: Callable[..., Any],
    args: Sequence[Vec],
    angles: np.ndarray,
    scales: Sequence[Vec] | None = None,
) -> str:
    """What is wrong with the Jacobians in f(*args) = (value, by the first, ...), or nothing.

    One that is None is left to numbers and not judged. `angles` (m,) marks the values that live on
    a circle; `scales` says how far each argument may move, its size or 1 by default.
    """
    if scales is None:
        scales = [np.maximum(1.0, np.abs(a)) for a in args]
    result = f(*args)
    return first(
        [
            _judge_jacobian(name, J, lambda *a: f(*a)[0], args, i, angles, scales[i])
            for i, (name, J) in enumerate(zip(names, result[1:], strict=True))
            if J is not None
        ]
    )


def _judge_jacobian(
    name: str,
    J: Mat,
    f: Callable[..., Vec],
    args: Sequence[Vec],
    which: int,
    angles: np.ndarray,
    scale: Vec,
) -> str:
    shape = (len(f(*args)), len(args[which]))
    J = np.asarray(J)
    if J.shape != shape:
        return f"{name} has shape {J.shape}, not {shape}"
    if not np.isfinite(J).all():
        return f"{name} is not finite"
    numeric = numeric_jacobian(f, args, which, angles, scale)
    # An entry is held against its own size, a small one against the largest change that any
    # argument causes when it moves by its scale.
    moves = np.abs(numeric) * scale
    allowed = 1e-5 * np.abs(numeric) + 1e-7 * np.maximum(1.0, moves.max(initial=0.0)) / scale
    excess = np.abs(J - numeric) / allowed
    if excess.size == 0 or excess.max() <= 1.0:
        return ""
    i, j = np.unravel_index(int(excess.argmax()), excess.shape)
    return f"{name}[{i}, {j}] is {J[i, j]:.6g}, central differences give {numeric[i, j]:.6g}"


def angles_of(units: Sequence[str]) -> np.ndarray:
    """Which components are angles, by their unit."""
    return np.array([unit == "rad" for unit in units], dtype=bool)


def not_covariance(name: str, P: Mat, n: int) -> str:
    """Why P is not a covariance matrix (..., n, n), or nothing."""
    P = np.asarray(P)
    if P.shape[-2:] != (n, n):
        return f"{name} has shape {P.shape}, not (..., {n}, {n})"
    if not np.isfinite(P).all():
        return f"{name} is not finite"
    size = max(np.abs(P).max(initial=0.0), 1e-300)
    if np.abs(P - np.swapaxes(P, -1, -2)).max(initial=0.0) > 1e-9 * size:
        return f"{name} is not symmetric"
    least = np.linalg.eigvalsh(P).min(initial=0.0)
    return f"{name} has the negative eigenvalue {least:.3g}" if least < -1e-9 * size else ""


def not_spread_like(samples: Vec, mean: Vec, P: Mat, angles: np.ndarray) -> str:
    """Why draws (N, n) do not look like N(mean, P), to 6 standard errors and 5 %, or nothing."""
    e = difference(samples, mean, angles)
    C = e.T @ e / len(e)
    sd = np.sqrt(np.maximum(np.diagonal(P), 0.0))
    allowed = 6.0 * np.sqrt((np.outer(sd, sd) ** 2 + P**2) / len(e)) + 0.05 * np.outer(sd, sd)
    # What is said to be free of noise may still move to second order.
    allowed = allowed + 1e-2 * P.max(initial=0.0)
    i, j = np.unravel_index(int((np.abs(C - P) - allowed).argmax()), P.shape)
    if abs(C[i, j] - P[i, j]) <= allowed[i, j]:
        return ""
    return f"covariance [{i}, {j}] of {len(e)} draws is {C[i, j]:.4g}, declared is {P[i, j]:.4g}"


def not_equal(
    name: str, a: Vec, b: Vec, angles: np.ndarray | None = None, tol: float = 1e-8
) -> str:
    """Why a and b differ, or nothing; angles are compared on the circle."""
    a, b = np.asarray(a), np.asarray(b)
    if a.shape != b.shape:
        return f"{name}: shape {a.shape}, not {b.shape}"
    if not np.isfinite(a).all():
        return f"{name} is not finite"
    off = np.abs(a - b if angles is None else difference(a, b, angles))
    worst = off.max(initial=0.0)
    return (
        f"{name} is off by {worst:.3g}"
        if worst > tol * max(1.0, np.abs(b).max(initial=0.0))
        else ""
    )


def not_batched_alike(
    name: str, function: Callable[..., Any], args: tuple[Vec, ...], batch: tuple[bool | int, ...]
) -> str:
    """Why a batch of COUNT gives something else than its rows one by one, or nothing; `batch` says
    which arguments have a row for each."""
    together = function(*args)
    problems = []
    for row in range(COUNT):
        alone = function(*(a[row] if b else a for a, b in zip(args, batch, strict=True)))
        for part, (whole, single) in enumerate(zip(together, alone, strict=True)):
            if whole is None or single is None:
                continue
            at_row = np.broadcast_to(whole, (COUNT, *np.shape(single)))[row]
            problems.append(not_equal(f"{name}, result {part}", at_row, single))
    return first(problems)


def first(problems: Sequence[str]) -> str:
    """The first problem, or nothing."""
    return next((p for p in problems if p), "")


def projectively_equal(name: str, A: Vec, B: Vec) -> str:
    """Why homogeneous points A and B (..., d+1) are different points, or nothing."""
    A = A / np.linalg.norm(A, axis=-1, keepdims=True)
    B = B / np.linalg.norm(B, axis=-1, keepdims=True)
    return not_equal(name, A, B, tol=1e-9)


def not_shaped(name: str, a: ArrayLike, shape: tuple[int, ...]) -> str:
    """Why an array has not this shape, or nothing."""
    return "" if np.shape(a) == shape else f"{name} has shape {np.shape(a)}, not {shape}"


def own_scale(k: Vec) -> Vec:
    """Steps for a calibration (nk,): its components have no common scale but their own."""
    return np.where(k == 0.0, 1e-2, np.abs(k))
