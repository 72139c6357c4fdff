"""What a simulated camera measures of straight lines: the visible part of each true segment.

A segment is sampled along its length; the longest run of places that can be measured is its
visible part, whose ends are then found by bisection. Nothing hides anything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.ports import Detection, Match, Occupied, Points, Query
from scene_core.models import segments as seen_lines
from scene_core.models.base import Fault, Sensor
from scene_core.sources import noise, points
from scene_core.sources.truth import Disturbances, with_outliers
from scene_core.sources.worlds import SimulatedWorld, in_axes, lines

SAMPLES = 33
"""Places along a segment."""
HALVINGS = 16
"""Of a step between two of them: the ends of the visible part are right to a part in 2e6."""


class VisibleParts(NamedTuple):
    """The visible part of every segment that has one."""

    rows: np.ndarray
    """Which segments (K,)."""
    X_S: Mat
    """Its ends (K, 2, 4) in the frame of the sensor."""
    h: Vec
    """Their measurements (K, 4) without noise."""


@dataclass(frozen=True)
class LineOutlook:
    """A sensor of directions at its true place, and the segments as it would see them."""

    world: SimulatedWorld
    up: str
    sensor: Sensor
    calib: Vec
    """True calibration."""
    pose: Vec
    """True pose x_WS, in the sensor's space."""
    shortest: float
    """px: a shorter part is not measured."""

    @cached_property
    def ids(self) -> np.ndarray:
        """Identities (M,)."""
        return lines(self.world).ids

    @cached_property
    def parts(self) -> VisibleParts:
        """What is in view, where it is at least `shortest` long in the image."""
        M = len(self.ids)
        t = np.broadcast_to(np.linspace(0.0, 1.0, SAMPLES), (M, SAMPLES))
        visible = self._visible(np.arange(M)[:, None], t)
        rows = np.flatnonzero(visible.any(axis=1))
        first, last = _longest_runs(visible[rows])
        step = 1.0 / (SAMPLES - 1)
        inside = np.column_stack([first, last]) * step
        beyond = np.clip(inside + np.array([-step, step]), 0.0, 1.0)
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + beyond)
            seen = self._visible(rows[:, None], middle)
            inside, beyond = np.where(seen, middle, inside), np.where(seen, beyond, middle)
        # The very end of a segment is a place between no two.
        inside = np.where(self._visible(rows[:, None], beyond), beyond, inside)
        X_S = self._at(rows[:, None], inside)
        h = self.sensor.project(X_S, self.calib).h.reshape(-1, 4)
        long = lengths(h) >= self.shortest
        return VisibleParts(rows[long], X_S[long], h[long])

    def measured(self, wrong: Disturbances, key: tuple[int, str, int]) -> Points:
        """Noisy ends z (K, 4) with identities; key: seed, mount and frame.

        A segment's misses and outliers are keyed by its place in the world, so they do not depend
        on which others are seen.
        """
        seed, mount, index = key
        parts, count = self.parts, len(self.ids)
        keep = np.ones(len(parts.rows), dtype=bool)
        if wrong.misses > 0.0:
            found = noise.rng(seed, f"missed lines:{mount}", index).random(count)
            keep = found[parts.rows] >= wrong.misses
        rows, h = parts.rows[keep], parts.h[keep]
        if len(rows) == 0:
            return Points(np.zeros((0, 4)), np.zeros(0, dtype=int))
        rng = noise.rng(seed, f"lines:{mount}", index)
        z = self.sensor.h_noisy(parts.X_S[keep].reshape(-1, 4), self.calib, rng).reshape(-1, 4)
        if wrong.outliers > 0.0:
            R = seen_lines.noise(self.sensor, h)
            rng = noise.rng(seed, f"outliers of lines:{mount}", index)
            z = with_outliers(z, h, R, rows, count, wrong, rng)
        z, there = clipped(z, np.array(self.sensor.limits))
        ids = self.ids[rows][there]
        ids.flags.writeable = False
        return Points(frozen(z[there]), ids)

    @cached_property
    def _ends(self) -> Mat:
        """Homogeneous points (M, 2, 4) in the frame of the sensor, where w is 1 as in the world."""
        ends = in_axes(self.world, lines(self.world).ends, self.up)
        X_W = np.concatenate([ends, np.ones((*ends.shape[:-1], 1))], axis=-1)
        return self.sensor.space.to_local(self.pose, X_W).X

    def _at(self, rows: np.ndarray, t: Vec) -> Vec:
        """Homogeneous points (..., 4) in the frame of the sensor at the fractions t of segments."""
        first, last = self._ends[rows, 0], self._ends[rows, 1]
        return first + t[..., None] * (last - first)

    def _visible(self, rows: np.ndarray, t: Vec) -> np.ndarray:
        """Whether places can be measured (...,), from here as if for the first time: the truth has
        no other view."""
        X = self._at(rows, t).reshape(-1, 4)
        here = self.sensor.space.identity()
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            h = self.sensor.project(X, self.calib).h
            first = np.broadcast_to(here, (len(X), len(here)))
            fault = self.sensor.visibility(h, X, here, first, X)
        low, high = np.array(self.sensor.limits).T
        inside = ((h >= low) & (h <= high)).all(axis=-1)
        return ((fault == int(Fault.NONE)) & inside).reshape(t.shape)


def measures_lines(sensor: Sensor) -> bool:
    """Whether a simulated sensor looks for segments: a camera does."""
    return sensor.pane == "image" and seen_lines.seen_by(sensor) is None


def match_lines(raw: Points, query: Query) -> list[Match]:
    """One match per queried label: the segment that carries the landmark's identity."""
    measured = raw.lines if raw.lines is not None else Points(np.zeros((0, 4)), _NONE)
    return points.match_identities(measured, query)


def detect_lines(raw: Points, occupied: Occupied, count: int, shortest: float) -> list[Detection]:
    """Up to `count` segments that are not in the map and at least `shortest` px long, lowest
    identity first."""
    if raw.lines is None or raw.lines.ids is None:
        return []
    long = lengths(raw.lines.z) >= shortest
    R = None if raw.lines.R is None else raw.lines.R[long]
    measured = Points(raw.lines.z[long], raw.lines.ids[long], R)
    found = points.detect_identities(measured, occupied, count)
    return [replace(one, shape="segment") for one in found]


def lengths(z: Vec) -> Vec:
    """Lengths (...,) in px of segments z = (u1, v1, u2, v2) (..., 4)."""
    return np.linalg.norm(z[..., 2:] - z[..., :2], axis=-1)


def clipped(z: Vec, limits: Mat) -> tuple[Vec, np.ndarray]:
    """Segments z (K, 4) cut to the image's limits (2, 2), and which have a part inside (K,).

    An end that noise carried over the border slides back along its segment: the straight line
    stays as it was measured. Source: Liang, Barsky, *A new concept and method for line clipping*,
    ACM TOG 1984.
    """
    first, way = z[:, :2], z[:, 2:] - z[:, :2]
    low, high = limits.T
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        to_low, to_high = (low - first) / way, (high - first) / way
    along = way != 0.0
    enter = np.where(along, np.minimum(to_low, to_high), -np.inf)
    leave = np.where(along, np.maximum(to_low, to_high), np.inf)
    t0, t1 = np.maximum(enter.max(axis=1), 0.0), np.minimum(leave.min(axis=1), 1.0)
    beside = ~along & ((first < low) | (first > high))
    there = (t0 < t1) & ~beside.any(axis=1)
    t = np.where(there[:, None], np.column_stack([t0, t1]), (0.0, 1.0))
    ends = np.where(
        t[..., None] == 0.0, first[:, None], first[:, None] + t[..., None] * way[:, None]
    )
    ends = np.where(t[..., None] == 1.0, z[:, None, 2:], ends)
    ends = np.where(there[:, None, None], np.clip(ends, low, high), ends)
    return ends.reshape(-1, 4), there


_NONE = np.zeros(0, dtype=int)


def _longest_runs(visible: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last index of the longest run of True in each row (K, n) that has one; of equally
    long ones the first."""
    count = np.zeros(visible.shape, dtype=int)
    running = np.zeros(len(visible), dtype=int)
    for i in range(visible.shape[1]):
        running = np.where(visible[:, i], running + 1, 0)
        count[:, i] = running
    last = np.argmax(count, axis=1)
    length = np.take_along_axis(count, last[:, None], axis=1)[:, 0]
    return last - length + 1, last
