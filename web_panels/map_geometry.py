"""Numbers of the map: ellipsoids of all features, bounds, the shape of a camera's frustum."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.records import Trace
from scene_core.filter.world import Label, Layout, World
from scene_core.geometry import quaternion
from scene_core.geometry.correlation import largest_canonical_correlations
from scene_core.geometry.ellipses import ellipsoids, sigma
from scene_core.geometry.spaces import ONE_D, THREE_D, TWO_D, Space, embed, embed_points
from scene_core.geometry.spaces import embed_covariances as embed_P
from scene_core.models.base import FeatureModel, Sensor
from scene_core.session.published import Published
from web_panels import verdicts
from web_panels.style import C

SPACES: dict[int, Space] = {1: ONE_D, 2: TWO_D, 3: THREE_D}
POSES: dict[int, Space] = {1: ONE_D, 3: TWO_D, 7: THREE_D}
STATES = ("accepted", "nomatch", "rejected", "unselected", "out", "partial")
PALETTE = np.array([C[s] for s in STATES], dtype=np.float64)
WEAK, STRONG = np.array(C["out"], dtype=np.float64), np.array([255.0, 170.0, 60.0])


@dataclass(frozen=True)
class Cloud:
    """All features of a world in 3-D world axes, in the order of the state."""

    labels: tuple[Label, ...]
    positions: Vec
    """(N, 3)"""
    scales: Vec
    """(N, 3) half-axes of the ellipsoids at the stated confidence, m."""
    wxyz: Vec
    """(N, 4)"""
    ends: Vec
    """(N, 2, 3) near and far end of a depth that is still uncertain; NaN for plain points."""


@dataclass(frozen=True)
class _Rows:
    model: FeatureModel
    labels: tuple[Label, ...]
    index: np.ndarray
    """(N, n) rows of the state."""


def _identity(model: FeatureModel) -> object:
    """Equal models go through in one call; one that can not be compared goes by itself."""
    try:
        hash(model)
    except TypeError:
        return id(model)
    return type(model), model


class Clouds:
    """Clouds of successive worlds; remembers where the features are while the layout stays."""

    def __init__(self) -> None:
        self._of: tuple[Layout, list[FeatureModel]] | None = None
        self._rows: list[_Rows] = []

    def _rows_of(self, world: World) -> list[_Rows]:
        layout, models = world.gauss.layout, [f.model for f in world.features.values()]
        if self._of is not None and layout is self._of[0]:
            # Editing a parameter of a landmark replaces its model and leaves the layout alone.
            if all(map(operator.is_, models, self._of[1])):
                return self._rows
        groups: dict[object, tuple[FeatureModel, list[tuple[Label, int]]]] = {}
        for label, f in world.features.items():
            at = world.gauss.layout[f.block].start
            groups.setdefault(_identity(f.model), (f.model, []))[1].append((label, at))
        self._rows = [
            _Rows(
                model,
                tuple(label for label, _ in members),
                np.array([at for _, at in members])[:, None] + np.arange(model.state_size),
            )
            for model, members in groups.values()
        ]
        self._of = layout, models
        return self._rows

    def of(self, world: World, confidence: float, thinnest: float) -> Cloud:
        """The cloud of a world; no ellipsoid is thinner than `thinnest` (m): it could not be
        seen, and in the plane or on a line it has no thickness at all."""
        labels: list[Label] = []
        parts: list[tuple[Vec, Vec, Vec, Vec]] = []
        x, P = world.gauss.x, world.gauss.P
        for rows in self._rows_of(world):
            i = rows.index
            glyphs = rows.model.graphics(x[i], P[i[:, :, None], i[:, None, :]])
            space = rows.model.space
            mean = embed_points(glyphs.mean, space, world.up)
            sd, wxyz = ellipsoids(embed_P(glyphs.cov, space, world.up))
            scales = sigma(space.d, confidence) * sd
            if glyphs.ends is None:
                ends = np.full((len(mean), 2, 3), np.nan)
            else:
                ends = embed_points(glyphs.ends, space, world.up)
                mean, scales = within_ray(mean, scales, ends)
            labels.extend(rows.labels)
            parts.append((mean, np.maximum(scales, thinnest), wxyz, ends))
        if not parts:
            none = np.zeros((0, 3))
            return Cloud((), none, none, np.zeros((0, 4)), np.zeros((0, 2, 3)))
        return Cloud(tuple(labels), *(np.concatenate(c) for c in zip(*parts, strict=True)))


def within_ray(mean: Vec, scales: Vec, ends: Vec) -> tuple[Vec, Vec]:
    """Means (N, 3) and half-axes (N, 3) of ellipsoids held within their rays (N, 2, 3).

    A first-order ellipsoid of a depth that is hardly known reaches far behind the camera.
    """
    ray = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(ray, axis=1)
    along = np.linalg.norm(mean - ends[:, 0], axis=1)
    held = np.where((along <= length)[:, None], mean, ends[:, 0] + 0.5 * ray)
    return held, np.minimum(scales, np.maximum(0.5 * length, 1e-3)[:, None])


def states(trace: Trace | None, world: World, labels: Iterable[Label]) -> list[str]:
    """Palette key of every feature: its verdict in this frame, else new or out of view."""
    judged = {} if trace is None else verdicts.states(trace)
    frame = None if trace is None else trace.frame.index
    out = []
    for label in labels:
        f = world.features[label]
        fresh = f.born == frame and not f.known
        out.append(judged.get(label, "partial" if fresh else "out"))
    return out


def colours(keys: list[str]) -> np.ndarray:
    """Palette colours (N, 3) of states."""
    return PALETTE[[STATES.index(k) for k in keys]] if keys else np.zeros((0, 3))


def correlation_colours(world: World, selected: Label, labels: tuple[Label, ...]) -> np.ndarray:
    """Colours (N, 3) by the largest canonical correlation with the selected feature."""
    layout = world.gauss.layout
    blocks = [layout[world.features[label].block].slice for label in labels]
    chosen = layout[world.features[selected].block].slice
    rho = largest_canonical_correlations(world.gauss.P, chosen, blocks)
    return WEAK + rho[:, None] * (STRONG - WEAK)


@lru_cache(maxsize=1)
def _circles() -> Vec:
    a = np.linspace(0.0, 2.0 * np.pi, 49)
    c, s, o = np.cos(a), np.sin(a), 0.0 * a
    return np.stack([np.stack(p, -1) for p in ((c, s, o), (c, o, s), (o, c, s))])


def rings(position: Vec, scales: Vec, wxyz: Vec, larger: float = 1.25) -> Vec:
    """Three circles around an ellipsoid as line segments (144, 2, 3)."""
    R = quaternion.matrix(wxyz)
    points = position + (_circles() * (larger * scales)) @ R.T
    return np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)


def mount_pose(world: World, mount: str) -> Vec:
    """Pose (7,) of a mount in 3-D world axes."""
    m = world.mounts[mount]
    xp = world.xp(m.robot, m.hook)
    robot = world.robots[m.robot].motion.space
    x_WR, x_RS = xp, world.mount_pose(mount)
    if robot is m.sensor.space:
        return embed(robot.compose(x_WR, x_RS).x, robot, world.up)[0]
    x_WR = embed(x_WR, robot, world.up)[0]
    x_RS = embed(x_RS, m.sensor.space, world.up)[0]
    return THREE_D.compose(x_WR, x_RS).x


def robot_pose(world: World, robot: str) -> Vec:
    """Pose (7,) of a robot in 3-D world axes."""
    return embed(world.xp(robot), world.robots[robot].motion.space, world.up)[0]


RECENT = 12
"""A reference that is given for every few frames only is shown until it is this many old."""


def last_known(rows: Vec | None) -> Vec | None:
    """The last finite one of the most recent rows (T, n)."""
    recent = np.zeros((0, 1)) if rows is None else rows[-RECENT:]
    good = np.flatnonzero(np.isfinite(recent).all(axis=1))
    return recent[good[-1]] if len(good) else None


def true_position(p: Published, robot: str, up: str) -> Vec | None:
    """True position (3,) of a robot in world axes, of whatever dimension it was given in."""
    truth = p.trace.frame.truth if p.trace is not None else None
    if truth is None or robot not in truth.xp:
        series = p.series.robots.get(robot)
        return None if series is None else last_known(series.true_position)
    xp = np.asarray(truth.xp[robot])
    at = aligned(POSES[len(xp)].position(xp), p)
    return embed_points(at, POSES[len(xp)], up)


def aligned(points: Vec, p: Published) -> Vec:
    """True points (..., d) in the estimate's axes, moved as the true trajectory is."""
    fit = next((r.alignment for r in p.series.robots.values() if r.alignment is not None), None)
    return points if fit is None else fit.points(points)


def view_angle(sensor: Sensor, k: Vec) -> tuple[float, float]:
    """Vertical field of view (rad, below 150 degrees) and aspect of a camera's frustum."""
    lo, hi = np.array(sensor.limits).T
    z = np.tile(0.5 * (lo + hi), (2, 1))
    # v is every second component: a stereo pair has two.
    z[:, 1::2] = lo[1::2], hi[1::2]
    n = np.ones((2, len(sensor.unmeasured)))
    rays = sensor.backproject(z, n, k).X[..., :3]
    # Up and down from the axis each on its own: together they may be more than half a turn.
    up, down = np.arctan2(rays[:, 1], rays[:, 2])
    fov = float(down - up)
    return min(fov, np.radians(150.0)), float((hi[0] - lo[0]) / (hi[1] - lo[1]))


@dataclass(frozen=True)
class Bounds:
    """A box in world axes."""

    lo: Vec
    hi: Vec

    @property
    def centre(self) -> Vec:
        return 0.5 * (self.lo + self.hi)

    @property
    def radius(self) -> float:
        """Half the diagonal, m; never so small that nothing has a size."""
        return max(0.5 * float(np.linalg.norm(self.hi - self.lo)), 0.3)


def bounds_of(points: Vec, least: float = 0.0) -> Bounds:
    """The box of points (N, 3), at least `least` metres in every direction."""
    lo, hi = points.min(axis=0), points.max(axis=0)
    grow = np.maximum(0.5 * (least - (hi - lo)), 0.0)
    return Bounds(lo - grow, hi + grow)


def start_bounds(p: Published, world: World) -> Bounds:
    """What the map is going to show: the simulated world, or what is known at the start."""
    parts = [robot_pose(world, r)[None, :3] for r in world.robots]
    least = 2.0
    outline = outline_of(p.experiment.source, world.up).reshape(-1, 3)
    points = true_points(p, world.up)
    if len(outline) == 0 and len(points) == 0 and world.features:
        parts.append(Clouds().of(world, 0.5, 0.0).positions)
        least = 0.8
    return bounds_of(np.concatenate([*parts, outline, points]), least)


def true_points(p: Published, up: str) -> Vec:
    """True landmarks (K, 3) in world axes; none when nobody knows them."""
    truth = p.trace.frame.truth if p.trace is not None else None
    if truth is None or len(truth.points) == 0:
        return np.zeros((0, 3))
    points = np.asarray(truth.points)
    return embed_points(aligned(points, p), SPACES[points.shape[1]], up)


def outline_of(source: Any, up: str) -> Vec:
    """Edges (M, 2, 3) of a simulated world in world axes; none for a recording."""
    outline = getattr(source, "outline", None)
    edges = np.asarray(outline()) if outline is not None else np.zeros((0, 2, 3))
    if edges.size == 0:
        return np.zeros((0, 2, 3))
    return edges if edges.shape[-1] == 3 else embed_points(edges, SPACES[edges.shape[-1]], up)


def nice(x: float) -> float:
    """The round number (1, 2 or 5 times a power of ten) at or below x."""
    ten = 10.0 ** np.floor(np.log10(x))
    return float(max(m * ten for m in (1.0, 2.0, 5.0) if m * ten <= x * (1 + 1e-9)))


def thinned(path: Vec, most: int = 400) -> Mat:
    """Line segments (M, 2, 3) along the known points of a path (T, 3), at most so many."""
    path = path[np.isfinite(path).all(axis=1)]
    stride = max(1, -(-len(path) // most))
    keep = path[::stride]
    if len(path) and (len(path) - 1) % stride:
        keep = np.concatenate([keep, path[-1:]])
    return np.stack([keep[:-1], keep[1:]], axis=1)
