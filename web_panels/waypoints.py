"""Waypoints of a simulated robot: where they are in the map, and edits of their list."""

from __future__ import annotations

from typing import Any

import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry.embedding import embed_points
from scene_core.geometry.spaces import Space
from scene_core.session.commands import SetParam
from scene_core.session.config import Experiment
from scene_core.session.published import Published
from scene_core.sources.drivers import Waypoints
from scene_core.sources.simulated import Simulation
from scene_core.sources.worlds import in_axes
from web_panels.map_geometry import Bounds

Points = tuple[tuple[float, ...], ...]
STEPS = 400
"""Places tried along a ray that may meet undulating ground."""


def edited(p: Published) -> Experiment:
    """The experiment as last edited."""
    return p.pending or p.experiment


def driver_of(p: Published, robot: str) -> Any:
    """Who drives a true robot; None where nobody does."""
    source = edited(p).source
    if not isinstance(source, Simulation) or robot not in source.robots:
        return None
    return source.robots[robot].driver


def waypoints_of(p: Published, robot: str) -> Points | None:
    """The list of a robot that is driven by one, without what does not fit its space; None of
    others."""
    driver = driver_of(p, robot)
    return driver.points if isinstance(driver, Waypoints) else None


def space_of(p: Published, robot: str) -> Space:
    """The space a true robot moves in."""
    source = edited(p).source
    assert isinstance(source, Simulation)
    return source.robots[robot].motion.space


def with_points(robot: str, points: Points) -> SetParam:
    """The command that gives a robot another list."""
    return SetParam(f"source.robots.{robot}.driver.points", points)


def moved(points: Points, i: int, by: int) -> Points:
    """The list with its i-th point earlier or later."""
    order = list(points)
    j = min(max(i + by, 0), len(order) - 1)
    order.insert(j, order.pop(i))
    return tuple(order)


def without(points: Points, i: int) -> Points:
    """The list without its i-th point."""
    return points[:i] + points[i + 1 :]


def on_map(points: Points, space: Space, up: str) -> Vec:
    """Places (N, 3) of those points that fit the space; NaN for the others."""
    out = np.full((len(points), 3), np.nan)
    fits = [i for i, point in enumerate(points) if len(point) == space.d]
    if fits:
        out[fits] = embed_points(np.array([points[i] for i in fits]), space, up)
    return out


def as_point(place: Vec, space: Space, up: str) -> tuple[float, ...]:
    """The waypoint of a place (3,) on the map, to the centimetre."""
    axes = embed_points(np.eye(space.d), space, up)
    return tuple(round(float(v), 2) for v in axes @ place)


def floor_height(source: Any, up: str, level: float, at: Vec) -> Vec:
    """Height (N,) of what one drives on below or above places (N, 3): the ground of the world, or
    the level of the drawn grid."""
    axis = "xyz".index(up)
    world = source.world if isinstance(source, Simulation) else None
    if world is None or world.ground(np.zeros(2)) is None:
        return np.full(len(at), level)
    back = in_axes(world, np.arange(3.0), up).astype(int)
    flat = np.empty_like(at)
    flat[:, back] = at
    ground = world.ground(flat[:, :2])
    assert ground is not None and axis == list(back).index(2)
    return np.asarray(ground.height)


def where_it_meets(
    source: Any, up: str, bounds: Bounds, level: float, origin: Vec, direction: Vec
) -> Vec | None:
    """Where a ray first goes through the floor, within a few radii of the map; None: nowhere."""
    axis = "xyz".index(up)
    reach = float(np.linalg.norm(origin - bounds.centre)) + 4.0 * bounds.radius
    s = np.linspace(0.0, reach, STEPS)
    at = origin + s[:, None] * direction / np.linalg.norm(direction)
    above = at[:, axis] - floor_height(source, up, level, at)
    through = np.flatnonzero((above[:-1] > 0.0) & (above[1:] <= 0.0))
    if not len(through):
        return None
    i = through[0]
    part = above[i] / (above[i] - above[i + 1])
    return at[i] + part * (at[i + 1] - at[i])
