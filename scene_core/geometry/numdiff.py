"""Central differences: stand in for a Jacobian nobody wrote, and judge those somebody did."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from scene_core.arrays import Mat, Vec

STEEP = 1e-4
"""Part of a value by which it may change over a step: curvature then costs the square of this."""
TARGET = 1e-5
"""Part of a value by which it changes when the step is chosen anew."""
TRIES = 6
FINEST = 1e-9
"""Part of |x|, or of 1e-6, below which a step would be lost in its rounding."""


def central_differences(
    f: Callable[..., Vec], args: Sequence[Vec], which: int, step: float = 1e-6
) -> Mat:
    """d f(*args) / d args[which] by (f(x + h) - f(x - h)) / 2h, h = step * max(1, |x|), and less
    where f is so steep that it changes by more than `STEEP` (a distortion [1/px^2] of 1e-6).

    Batched: args of shape (..., n) and values (..., m) give (..., m, n); an argument that is the
    same for the whole batch (n,) is perturbed for all of them at once.
    """
    x = np.asarray(args[which], dtype=np.float64)

    def either_side(i: int, h: Vec) -> tuple[Vec, Vec]:
        values = []
        for sign in (+1.0, -1.0):
            moved = x.copy()
            moved[..., i] += sign * h
            values.append(np.asarray(f(*args[:which], moved, *args[which + 1 :])))
        return values[0], values[1]

    columns = [
        _slope(lambda h, i=i: either_side(i, h), np.abs(x[..., i]), step)
        for i in range(x.shape[-1])
    ]
    if not columns:
        value = np.asarray(f(*args))
        return np.zeros((*value.shape, 0))
    return np.stack(columns, axis=-1)


def _slope(either_side: Callable[[Vec], tuple[Vec, Vec]], size: Vec, step: float) -> Vec:
    """(f(x + h) - f(x - h)) / 2h (..., m), each row with the first h at which it is not steep.

    One that stays steep however small h becomes jumps there: it has its first h, as all others.
    """
    h = step * np.maximum(1.0, size)
    slope, steep = _divided(*either_side(h), h)
    open_ = steep > STEEP
    for _ in range(TRIES):
        if not open_.any():
            break
        # One step for rows that share the argument, else each row's own.
        less = np.where(open_, TARGET / np.where(open_, steep, 1.0), 1.0)
        less = less if less.shape == np.shape(h) else less.min()
        h = np.maximum(h * less, FINEST * np.maximum(1e-6, size))
        again, steep = _divided(*either_side(h), h)
        good = open_ & (steep <= STEEP)
        slope = np.where(good[..., None], again, slope)
        open_ = open_ & ~good
    return slope


def _divided(ahead: Vec, behind: Vec, h: Vec) -> tuple[Vec, Vec]:
    """The slope (..., m), and the part (...,) of its size by which the value changes."""
    change = ahead - behind
    size = np.maximum(1.0, np.abs(ahead).max(axis=-1, initial=0.0))
    steep = np.abs(change).max(axis=-1, initial=0.0) / size
    return change / (2.0 * np.asarray(h)[..., None]), steep
