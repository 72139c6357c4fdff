"""Everything the filter believes about its features, ready to be drawn in 3-D world axes.

Points are ellipsoids; lines are segments with an ellipsoid at either end; partial features are the
particles that carry what is not known yet.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass, replace

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.groups import Group, groups, moments
from scene_core.filter.world import Label, Layout, World
from scene_core.geometry.ellipses import ellipsoids, sigma
from scene_core.geometry.embedding import embed_covariances as embed_P
from scene_core.geometry.embedding import embed_points
from scene_core.geometry.numdiff import central_differences
from scene_core.models.base import FeatureModel
from web_panels.bodies import NO_LINES, NO_SWARM, Bodies, Lines, Swarm

NO_ENDS = 1e-3
"""An ellipsoid held within its ray keeps at least this size, m."""


@dataclass(frozen=True)
class Cloud:
    """All features of a world in 3-D world axes, in the order of the state."""

    labels: tuple[Label, ...]
    positions: Vec
    """(N, 3); the middle of a segment, the mean of particles."""
    scales: Vec
    """(N, 3) half-axes of the ellipsoids at the stated confidence, m; 0 for what is none."""
    wxyz: Vec
    """(N, 4)"""
    ends: Vec
    """(N, 2, 3) near and far end of a depth that is still uncertain; NaN for plain points."""
    lines: Lines = NO_LINES
    swarm: Swarm = NO_SWARM


class Clouds:
    """Clouds of successive worlds; remembers where the features are while the layout stays."""

    def __init__(self) -> None:
        self._of: tuple[Layout, list[FeatureModel]] | None = None
        self._groups: list[Group] = []

    def _groups_of(self, world: World) -> list[Group]:
        layout, models = world.gauss.layout, [f.model for f in world.features.values()]
        known = self._of is not None and layout is self._of[0] and len(models) == len(self._of[1])
        # Editing a parameter of a landmark replaces its model and leaves the layout alone.
        if not known or not all(map(operator.is_, models, self._of[1])):  # type: ignore[index]
            self._groups = groups(world)
            self._of = layout, models
        return [_refreshed(group, world) for group in self._groups]

    def of(self, world: World, confidence: float, thinnest: float, farthest: float = 1e3) -> Cloud:
        """The cloud of a world.

        No ellipsoid is thinner than `thinnest` (m): it could not be seen, and in the plane or on a
        line it has no thickness at all. Nothing is farther than `farthest` (m) from the origin:
        lines and rays may reach infinity.
        """
        parts, lines, swarms, count = [], [], [], 0
        for group in self._groups_of(world):
            y, P = moments(group, world.gauss.x, world.gauss.P)
            rows = count + np.arange(len(group.labels))
            count += len(rows)
            if group.model.shape == "segment":
                lines.append(_lines(group, rows, y, P, world.up, confidence, farthest))
                parts.append((group.labels, _middles(lines[-1])))
            elif group.partial:
                swarms.append(_swarm(group, rows, y, world.up, farthest))
                parts.append((group.labels, _means(group, swarms[-1], y, P, world.up)))
            else:
                parts.append(
                    (group.labels, _points(group.model, y, P, world, confidence, thinnest))
                )
        if not parts:
            none = np.zeros((0, 3))
            return Cloud((), none, none, np.zeros((0, 4)), np.zeros((0, 2, 3)))
        labels = tuple(label for some, _ in parts for label in some)
        at, scales, wxyz, ends = (
            np.concatenate(c) for c in zip(*(p for _, p in parts), strict=True)
        )
        joined = _joined_lines(lines, thinnest), _joined_swarms(swarms)
        return Cloud(labels, at, scales, wxyz, ends, *joined)


_Drawn = tuple[Vec, Vec, Vec, Vec]
"""Positions, scales, wxyz and ends."""


def _refreshed(group: Group, world: World) -> Group:
    """A remembered group with what changes although the layout stays."""
    if group.extents is None and not group.partial and group.carrier is None:
        return group
    kin = [world.features[label] for label in group.labels]
    return replace(
        group,
        particles=tuple(f.particles for f in kin if f.particles is not None),
        extents=None if group.extents is None else np.array([f.extent for f in kin]),
        carrier=None if group.carrier is None else world.robots[group.carrier.id],
        offsets=None if group.carrier is None else np.array([f.offset for f in kin]),
    )


def _points(
    model: FeatureModel, y: Vec, P: Mat, world: World, confidence: float, thinnest: float
) -> _Drawn:
    glyphs, space, up = model.graphics(y, P), model.space, world.up
    mean = embed_points(glyphs.mean, space, up)
    sd, wxyz = ellipsoids(embed_P(glyphs.cov, space, up))
    scales = sigma(space.d, confidence) * sd
    if glyphs.ends is None:
        ends = np.full((len(mean), 2, 3), np.nan)
    else:
        ends = embed_points(glyphs.ends, space, up)
        mean, scales = within_ray(mean, scales, ends)
    return mean, np.maximum(scales, thinnest), wxyz, ends


def within_ray(mean: Vec, scales: Vec, ends: Vec) -> tuple[Vec, Vec]:
    """Means (N, 3) and half-axes (N, 3) of ellipsoids held within their rays (N, 2, 3).

    A first-order ellipsoid of a depth that is hardly known reaches far behind the camera: its
    longest axis is cut where its ray begins and ends.
    """
    start, ray = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(ray, axis=1)
    along = np.linalg.norm(mean - start, axis=1)
    longest = scales.max(axis=1)
    inside = along <= length
    low = np.where(inside, np.maximum(along - longest, 0.0), 0.0)
    high = np.where(inside, np.minimum(along + longest, length), length)
    way = np.where(inside[:, None], mean - start, ray)
    way /= np.maximum(np.where(inside, along, length), 1e-12)[:, None]
    held = start + (0.5 * (low + high))[:, None] * way
    return held, np.minimum(scales, np.maximum(0.5 * (high - low), NO_ENDS)[:, None])


def places(X: Vec, farthest: float) -> Vec:
    """Euclidean points (..., d) of homogeneous ones (..., d+1), held within `farthest` of the
    origin: a point at infinity is drawn in its direction."""
    m, w = X[..., :-1], X[..., -1:]
    length = np.maximum(np.linalg.norm(m, axis=-1, keepdims=True), 1e-12)
    return m / np.maximum(w, length / farthest)


def _lines(
    group: Group, rows: np.ndarray, y: Vec, P: Mat, up: str, confidence: float, farthest: float
) -> Lines:
    """Both ends of every segment, with first-order ellipsoids: P_end = J P_yy J'."""
    model, d, extents = group.model, group.model.space.d, group.extents
    assert extents is not None

    def ends_of(y: Vec) -> Vec:
        X = model.ends(y, extents).reshape(*y.shape[:-1], 2, d + 1)
        return places(X, farthest).reshape(*y.shape[:-1], 2 * d)

    J = central_differences(ends_of, (y,), 0).reshape(len(y), 2, d, -1)
    cov = J @ P[:, None] @ np.swapaxes(J, -1, -2)
    at = embed_points(ends_of(y).reshape(-1, 2, d), model.space, up)
    cov = embed_P((0.5 * (cov + np.swapaxes(cov, -1, -2))).reshape(-1, d, d), model.space, up)
    sd, wxyz = ellipsoids(cov)
    # As along a ray: no ellipsoid reaches back to where the line was seen from.
    seen_from = embed_points(group.pose0[:, :d], model.space, up)
    away = np.linalg.norm(at - seen_from[:, None], axis=-1).reshape(-1, 1)
    scales = np.minimum(sigma(d, confidence) * sd, np.maximum(0.5 * away, NO_ENDS))
    keys = tuple((label, end) for label in group.labels for end in (0, 1))
    balls = Bodies(keys, at.reshape(-1, 3), scales, wxyz, np.repeat(rows, 2))
    return Lines(rows, at, balls)


def _middles(lines: Lines) -> _Drawn:
    n = len(lines.rows)
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    return lines.ends.mean(axis=1), np.zeros((n, 3)), upright, np.full((n, 2, 3), np.nan)


def _swarm(group: Group, rows: np.ndarray, y: Vec, up: str, farthest: float) -> Swarm:
    counts = [len(p.w) for p in group.particles]
    each = np.repeat(np.arange(len(rows)), counts)
    lam = np.concatenate([p.lam for p in group.particles])
    at = places(group.model.point(y[each], lam).X, farthest)
    weights = np.concatenate([p.w / max(p.w.max(), 1e-300) for p in group.particles])
    keys = tuple((group.labels[i], k) for i, n in enumerate(counts) for k in range(n))
    return Swarm(keys, rows[each], embed_points(at, group.model.space, up), weights)


def _means(group: Group, swarm: Swarm, y: Vec, P: Mat, up: str) -> _Drawn:
    """The weighted means of the particles, and the rays they lie on."""
    n = len(group.labels)
    own = swarm.rows - swarm.rows.min()
    total = np.bincount(own, swarm.weights, n)[:, None]
    mean = np.stack(
        [np.bincount(own, swarm.weights * swarm.positions[:, i], n) for i in range(3)], axis=1
    )
    glyphs = group.model.graphics(y, P)
    ends = np.full((n, 2, 3), np.nan)
    if glyphs.ends is not None:
        ends = embed_points(glyphs.ends, group.model.space, up)
    return mean / total, np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)), ends


def _joined_lines(lines: list[Lines], thinnest: float) -> Lines:
    if not lines:
        return NO_LINES
    balls = [x.balls for x in lines]
    return Lines(
        np.concatenate([x.rows for x in lines]),
        np.concatenate([x.ends for x in lines]),
        Bodies(
            tuple(label for b in balls for label in b.labels),
            np.concatenate([b.positions for b in balls]),
            np.maximum(np.concatenate([b.scales for b in balls]), thinnest),
            np.concatenate([b.wxyz for b in balls]),
            np.concatenate([b.rows for b in balls]),
        ),
    )


def _joined_swarms(swarms: list[Swarm]) -> Swarm:
    if not swarms:
        return NO_SWARM
    return Swarm(
        tuple(label for s in swarms for label in s.labels),
        np.concatenate([s.rows for s in swarms]),
        np.concatenate([s.positions for s in swarms]),
        np.concatenate([s.weights for s in swarms]),
    )
