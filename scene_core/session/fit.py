"""A camera of another model that sees the same images: its calibration by least squares."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from scene_core import params
from scene_core.arrays import Vec
from scene_core.models.base import Sensor, completed
from scene_core.params import ParamError

GRID = 15
"""Rays along each side of the image."""
DISTORTION_TERMS = 3
"""Radial coefficients of a camera that can have any number and is given none."""
BAD_FIT = 0.02
"""Of the width of the image: a camera that fits worse than this sees other images."""


def fitted(old: Sensor, new: Sensor) -> tuple[Sensor, float]:
    """`new` with the calibration that predicts, in the least-squares sense, the same measurement
    as `old` for the rays through a grid over its limits; and the rms of what remains.

    Everything else `new` has by the same name (image size, noise, limits) is taken from `old`.
    Raises ParamError when there is no such calibration.
    """
    if type(old) is type(new):
        return old, 0.0
    with_calib = getattr(new, "with_calib", None)
    if with_calib is None or old.labels != new.labels or old.space is not new.space:
        raise ParamError(
            f"'{new.name}' can not take over from '{old.name}': it measures "
            f"{', '.join(new.labels)}, not {', '.join(old.labels)}"
        )
    new = with_same_fields(old, new)
    z, X = _seen(old)

    def residual(k: Vec) -> Vec:
        return (new.project(X, k).h - z).ravel()

    def jacobian(k: Vec) -> Vec:
        J = completed(new.project(X, k), new.project, X, k).dh_by_dk
        assert J is not None
        return J.reshape(-1, len(k))

    def solution(start: Vec) -> Any:
        # scipy's own annotation of `jac` lacks the callable it documents.
        return least_squares(residual, start, jacobian, x_scale="jac")  # pyright: ignore

    fit = min((solution(start) for start in _starts(old, new)), key=lambda s: s.cost)
    sensor = _in_range(new.with_calib(fit.x))  # type: ignore[attr-defined]
    rms = float(np.sqrt(np.mean(residual(sensor.calib0).reshape(z.shape) ** 2)))
    if not (np.isfinite(rms) and rms < BAD_FIT * (old.limits[0][1] - old.limits[0][0])):
        raise ParamError(
            f"'{new.name}' can not see the same images as '{old.name}': the best calibration is "
            f"off by {rms:.1f} px rms; bring the distortion nearer to zero first"
        )
    return sensor, rms


def with_same_fields(old: Any, new: Any) -> Any:
    """`new` with the values of `old` in all fields of equal name; open tuples get some terms."""
    there = {f.name for f in fields(old)}
    shared = {f.name: getattr(old, f.name) for f in fields(new) if f.name in there}
    new = replace(new, **shared)
    empty = {f.name: (0.0,) * DISTORTION_TERMS for f in fields(new) if getattr(new, f.name) == ()}
    return replace(new, **empty)


def _in_range(sensor: Any) -> Any:
    """With every parameter that the fit left outside its range, be it by rounding, at the nearest
    end of it: settings with any other could not be read again."""
    nearest: dict[str, Any] = {}
    for spec in params.schema(sensor):
        lo = -np.inf if spec.lo is None else spec.lo
        hi = np.inf if spec.hi is None else spec.hi
        if isinstance(spec.value, float):
            nearest[spec.path] = min(max(spec.value, lo), hi)
        elif isinstance(spec.value, tuple):
            nearest[spec.path] = tuple(min(max(x, lo), hi) for x in spec.value)
    return replace(sensor, **nearest)


def _seen(sensor: Sensor) -> tuple[Vec, Vec]:
    """Measurements (N, 2) all over the limits, and the rays they are of."""
    z = _grid(sensor)
    X = sensor.backproject(z, np.zeros((len(z), len(sensor.unmeasured))), sensor.calib0).X
    # Outside the circle that a wide lens shows no ray belongs to a pixel.
    shown = np.abs(sensor.project(X, sensor.calib0).h - z).max(axis=1) < 1e-3
    return z[shown], X[shown]


def _grid(sensor: Sensor) -> Vec:
    """Measurements (GRID^2, 2), half a step inside the limits."""
    axes = [np.linspace(lo, hi, 2 * GRID + 1)[1::2] for lo, hi in sensor.limits]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _starts(old: Sensor, new: Sensor) -> list[Vec]:
    """Components of equal label from `old`; the others zero, which is no distortion where k are
    coefficients of it, or what `new` has, for a lens that is nothing but its coefficients."""
    known = dict(zip(old.calib_labels, old.calib0, strict=True))
    own = zip(new.calib_labels, new.calib0, strict=True)
    both = np.array([(known.get(label, 0.0), known.get(label, k)) for label, k in own])
    return [both[:, 0]] if np.array_equal(*both.T) else list(both.T)
