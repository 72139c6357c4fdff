"""What several kinds of models return, and how the Jacobians that nobody wrote are filled in."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

from scene_core.arrays import Mat, Vec
from scene_core.geometry.numdiff import central_differences


class Redefined(NamedTuple):
    """A state in new axes, with Jacobians by the old state and by the pose of the new origin."""

    value: Vec
    by_state: Mat | None = None
    by_xpdef: Mat | None = None


class Normalised(NamedTuple):
    """A state on its constraint, with the exact Jacobian of the normalisation."""

    value: Vec
    jacobian: Mat | None = None


_Result = TypeVar("_Result", bound=tuple)


def completed(result: _Result, function: Any, *args: Vec) -> _Result:
    """`result` with every Jacobian that is None replaced by central differences of `function`.

    The Jacobian fields of a result follow its value in the order of `args`.
    """
    if all(part is not None for part in result):
        return result
    filled = list(result)
    for i in range(1, len(filled)):
        if filled[i] is None:
            filled[i] = central_differences(lambda *a: function(*a)[0], args, i - 1)
    return type(result)(*filled)
