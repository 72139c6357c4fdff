"""Numbers of the map: colours of features, poses, bounds, the shape of a camera's frustum."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.groups import rows_of
from scene_core.filter.ports import Frame
from scene_core.filter.records import Trace
from scene_core.filter.world import Axes, Label, World
from scene_core.geometry import quaternion
from scene_core.geometry.correlation import largest_canonical_correlations
from scene_core.geometry.embedding import embed, embed_points
from scene_core.geometry.spaces import SPACES, THREE_D, Space
from scene_core.models.base import Sensor
from scene_core.session.axes import points_from, truth_axes
from scene_core.session.published import Published
from scene_core.sources.simulated import Simulation
from scene_core.sources.worlds import SimulatedWorld, in_axes
from web_panels import verdicts
from web_panels.clouds import Clouds
from web_panels.style import C

GROUND_CELLS = 60
"""Of the drawn ground on each side."""
POSES: dict[int, Space] = {space.n: space for space in SPACES.values()}
STATES = ("accepted", "nomatch", "rejected", "unselected", "out", "partial")
PALETTE = np.array([C[s] for s in STATES], dtype=np.float64)
WEAK, STRONG = np.array(C["out"], dtype=np.float64), np.array([255.0, 170.0, 60.0])


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
    P, (chosen, *rows) = rows_of(world, [selected, *(k for k in labels if k != selected)])
    at = iter(rows)
    every = [chosen if k == selected else next(at) for k in labels]
    rho = largest_canonical_correlations(P, chosen, every)
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


def robot_pose(world: World, robot: str, hook: str = "base") -> Vec:
    """Pose (7,) of a robot in 3-D world axes."""
    return embed(world.xp(robot, hook), world.robots[robot].motion.space, world.up)[0]


Part = tuple[str, str]
"""A robot and one of its hooks."""


def parts(world: World) -> list[Part]:
    """What is drawn of the robots: their bodies, and the hooks that move by themselves; a colon
    marks another name of something on a part."""
    out: dict[Part, None] = {}
    for name, robot in world.robots.items():
        own = (hook for hook in robot.motion.hooks if ":" not in hook)
        out |= dict.fromkeys((name, hook) for hook in (*robot.motion.bodies, *own))
    return list(out)


def bodies(robots: Mapping[str, Any]) -> list[Part]:
    """The bodies of robots, each with a `motion`, in the order of their colours."""
    return [(name, body) for name, robot in robots.items() for body in robot.motion.bodies]


RECENT = 12
"""A reference that is given for every few frames only is shown until it is this many old."""


def last_known(rows: Vec | None) -> Vec | None:
    """The last finite one of the most recent rows (T, n)."""
    recent = np.zeros((0, 1)) if rows is None else rows[-RECENT:]
    good = np.flatnonzero(np.isfinite(recent).all(axis=1))
    return recent[good[-1]] if len(good) else None


def true_position(p: Published, robot: str, hook: str = "base", up: str = "z") -> Vec | None:
    """True position (3,) of a robot's hook in world axes, of whatever dimension it was given in."""
    truth = p.trace.frame.truth if p.trace is not None else None
    if hook != "base":
        xp = None if p.trace is None else _true_hook(p, p.trace.frame, robot, hook)
    elif truth is None or robot not in truth.xp:
        series = p.series.robots.get(robot)
        return None if series is None else last_known(series.true_position)
    else:
        xp = np.asarray(truth.xp[robot])
    if xp is None:
        return None
    return in_map(POSES[len(xp)].position(xp), p, POSES[len(xp)], up)


def _true_hook(p: Published, frame: Frame, robot: str, hook: str) -> Vec | None:
    """Only a simulation knows where the parts of a robot are."""
    source = p.experiment.source
    if not isinstance(source, Simulation) or robot not in source.robots:
        return None
    motion = source.robots[robot].motion
    xv = source.true_states(frame).get(robot) if frame.truth is not None else None
    return None if xv is None or hook not in motion.hooks else motion.xp(xv, hook).xp


def in_map(points: Vec, p: Published, space: Space, up: str) -> Vec:
    """True points (..., d) in the axes of the map (..., 3), moved as the true trajectory is:
    aligned with the estimate where it has to be, seen from where the axes truly are."""
    fit = next((r.alignment for r in p.series.robots.values() if r.alignment is not None), None)
    at = points if fit is None else fit.points(points)
    return points_from(truth_axes(axes_of(p), fit is not None), embed_points(at, space, up))


def axes_of(p: Published) -> Axes | None:
    """The axes the map is told in; None: those the run began in."""
    return None if p.trace is None else p.trace.world.axes


def place_of_world(p: Published) -> Vec:
    """Pose (7,) in the axes of the map of those a simulated world is told in."""
    pose = truth_axes(axes_of(p), aligned=False)
    if pose is None or not np.isfinite(pose).all():
        return THREE_D.identity()
    return THREE_D.inverse(pose).x


def axes_key(p: Published) -> bytes:
    """Equal in equal axes."""
    axes = axes_of(p)
    if axes is None:
        return b""
    return axes.pose.tobytes() + (b"" if axes.true_pose is None else axes.true_pose.tobytes())


def view_name(p: Published) -> str:
    """What a place to look from belongs to: a scenario, in certain axes."""
    axes, name = axes_of(p), p.experiment.name
    return name if axes is None else f"{name} from {axes.robot} in frame {axes.frame}"


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
    parts = [robot_pose(world, *body)[None, :3] for body in bodies(world.robots)]
    least = 2.0
    outline = outline_of(p.experiment.source, world.up).reshape(-1, 3)
    if len(outline):
        there = np.concatenate([outline, np.ones((len(outline), 1))], axis=1)
        outline = THREE_D.to_world(place_of_world(p), there).X[:, :3]
    points = true_points(p, world.up)
    if len(outline) == 0 and len(points) == 0 and world.features:
        parts.append(Clouds().of(world, 0.5, 0.0).positions)
    if len(outline) == 0 and (len(points) or world.features):
        least = 0.8
    return bounds_of(np.concatenate([*parts, outline, points]), least)


def true_points(p: Published, up: str) -> Vec:
    """True landmarks (K, 3) in world axes; none when nobody knows them."""
    truth = p.trace.frame.truth if p.trace is not None else None
    if truth is None or len(truth.points) == 0:
        return np.zeros((0, 3))
    points = np.asarray(truth.points)
    return in_map(points, p, SPACES[points.shape[1]], up)


def true_segments(p: Published, up: str) -> Vec:
    """True line landmarks (M, 2, 3) in world axes; none when nobody knows them."""
    truth = p.trace.frame.truth if p.trace is not None else None
    if truth is None or len(truth.segments) == 0:
        return np.zeros((0, 2, 3))
    ends = np.asarray(truth.segments)
    return in_map(ends, p, SPACES[ends.shape[-1]], up)


def ground_mesh(source: Any) -> tuple[Vec, np.ndarray] | None:
    """Vertices (V, 3) in world axes and faces (F, 3) of the ground of a simulated world; None where
    it has none."""
    world = getattr(source, "world", None)
    if not isinstance(world, SimulatedWorld) or world.ground(np.zeros(2)) is None:
        return None
    edges = world.outline().reshape(-1, 3)
    lo, hi = edges[:, :2].min(axis=0), edges[:, :2].max(axis=0)
    axes = (np.linspace(lo[i], hi[i], GROUND_CELLS + 1) for i in range(2))
    flat = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    ground = world.ground(flat)
    assert ground is not None
    n = GROUND_CELLS + 1
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    a, b, c, d = corner, corner + n, corner + n + 1, corner + 1
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return in_axes(world, np.column_stack([flat, ground.height]), source.up), faces


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
