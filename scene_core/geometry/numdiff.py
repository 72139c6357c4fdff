"""Central differences: stand in for a Jacobian nobody wrote, and judge those somebody did."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from scene_core.arrays import Mat, Vec


def central_differences(
    f: Callable[..., Vec], args: Sequence[Vec], which: int, step: float = 1e-6
) -> Mat:
    """d f(*args) / d args[which] by (f(x + h) - f(x - h)) / 2h, h = step * max(1, |x|).

    Batched: args of shape (..., n) and values (..., m) give (..., m, n); an argument that is the
    same for the whole batch (n,) is perturbed for all of them at once.
    """
    x = np.asarray(args[which], dtype=np.float64)
    columns = []
    for i in range(x.shape[-1]):
        h = step * np.maximum(1.0, np.abs(x[..., i]))
        values = []
        for sign in (+1.0, -1.0):
            moved = x.copy()
            moved[..., i] += sign * h
            values.append(np.asarray(f(*args[:which], moved, *args[which + 1 :])))
        columns.append((values[0] - values[1]) / (2.0 * np.asarray(h)[..., None]))
    if not columns:
        value = np.asarray(f(*args))
        return np.zeros((*value.shape, 0))
    return np.stack(columns, axis=-1)
