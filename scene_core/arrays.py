"""Array aliases, and the one way an array becomes part of an immutable value."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vec = NDArray[np.float64]
"""A vector (n,), or a batch of vectors (..., n)."""
Mat = NDArray[np.float64]
"""A matrix (m, n), or a batch of matrices (..., m, n)."""


def frozen(a: ArrayLike) -> NDArray[np.float64]:
    """Return `a` as a read-only float64 array, copying only when `a` is still writeable.

    Everything that is published to another thread goes through here: a reader can
    never see a half-written state, and nobody needs a lock.
    """
    out = np.asarray(a, dtype=np.float64)
    if out.flags.writeable:
        out = out.copy()
        out.flags.writeable = False
    return out


def block_diag(blocks: Iterable[NDArray[Any]]) -> Mat:
    """Stack blocks (m_i, n_i) along the diagonal (empty input gives a 0x0 matrix)."""
    parts = [np.asarray(b, dtype=np.float64) for b in blocks]
    out = np.zeros((sum(len(b) for b in parts), sum(b.shape[1] for b in parts)))
    i = j = 0
    for b in parts:
        m, n = b.shape
        out[i : i + m, j : j + n] = b
        i, j = i + m, j + n
    return out
