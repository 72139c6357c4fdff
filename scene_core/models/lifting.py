"""A robot's state told in the components of another motion model.

Components with equal label and unit are the same thing and keep their values; the others follow
from the position state, xv' = lift(xp(xv)), as far as it says something about them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.models.base import MotionModel, completed


class Taken(NamedTuple):
    """A state xv (n',) of the new model."""

    xv: Vec
    by_xv: Mat
    """(n', n): by the old state."""
    P_rest: Mat
    """(n', n'): covariance of what the old state can not say."""


def lifted(old: MotionModel, new: MotionModel, xv: Vec) -> Taken:
    """State of `new` from the state xv (n,) of `old`; both move in the same space."""
    xp, dxp_by_dxv = completed(old.xp(xv), old.xp, xv)
    assert dxp_by_dxv is not None
    rest = new.lift(xp)
    value, J, P = np.array(rest.xv), rest.dxv_by_dxp @ dxp_by_dxv, np.array(rest.P_rest)
    for i, j in common(old, new):
        value[i], J[i] = xv[j], np.eye(len(xv))[j]
        P[i, :] = P[:, i] = 0.0
    return Taken(value, J, P)


def common(old: MotionModel, new: MotionModel) -> list[tuple[int, int]]:
    """Rows (new, old) of components with equal label and unit."""
    where = {pair: j for j, pair in enumerate(zip(old.state_labels, old.state_units, strict=True))}
    pairs = zip(new.state_labels, new.state_units, strict=True)
    return [(i, where[pair]) for i, pair in enumerate(pairs) if pair in where]
