"""Worlds of walls: the toolbox's house of segments, and a corridor that leads round in a loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.spaces import THREE_D, TWO_D, Space
from scene_core.params import param
from scene_core.sources import noise
from scene_core.sources.worlds import SimulatedWorld, rectangle

WALL_SHARE = 0.65
"""Height of the walls below the roof, as a fraction of the house's."""
DOOR = (0.9, 2.0)
"""Width and height of a door, m."""
GOLDEN = (5.0**0.5 - 1.0) / 2.0
"""Multiples of it, less their whole parts, fill the unit interval evenly."""
EDGE = 0.3
"""Points of the corridor keep this far from floor and ceiling, m."""


@dataclass(frozen=True)
class House(SimulatedWorld):
    """23 segments: the uprights (4) and the floor (4) of the walls, the roof (7: both eaves, four
    rafters and the ridge), a door (4) and a window (4) in the western wall.

    Source: Solà, *An EKF-SLAM toolbox in Matlab*, world "house".
    """

    name: ClassVar[str] = "house"
    space: ClassVar[Space] = THREE_D
    turns: ClassVar[bool] = True
    x: float = param(-2.5, unit="m", lo=-1e4, hi=1e4, soft=(-20.0, 20.0), effect="on reset")
    """Its western corner."""
    y: float = param(-2.5, unit="m", lo=-1e4, hi=1e4, soft=(-20.0, 20.0), effect="on reset")
    """Its southern corner."""
    z: float = param(0.0, unit="m", lo=-1e4, hi=1e4, soft=(-5.0, 5.0), effect="on reset")
    """Its floor."""
    length: float = param(5.0, unit="m", lo=0.1, hi=1e4, soft=(1.0, 20.0), effect="on reset")
    """Along x."""
    width: float = param(5.0, unit="m", lo=0.1, hi=1e4, soft=(1.0, 20.0), effect="on reset")
    """Along y."""
    height: float = param(4.0, unit="m", lo=0.1, hi=1e4, soft=(1.0, 20.0), effect="on reset")
    """Up to the ridge of the roof."""
    marks: int = param(0, lo=0, hi=1000, soft=(0, 100), effect="on reset", label="Marks")
    """So many points on its four walls, evenly all over them."""

    def points(self) -> tuple[np.ndarray, Vec]:
        """Round the house at heights that never come back to where they were."""
        ids = np.arange(1, self.marks + 1)
        round_it = 4.0 * (ids - 0.5) / max(self.marks, 1)
        wall, along = round_it.astype(int), round_it % 1.0
        corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)])
        at = corners[wall] + along[:, None] * (corners[wall + 1] - corners[wall])
        up = WALL_SHARE * (ids * GOLDEN % 1.0)
        size, corner = (self.length, self.width, self.height), (self.x, self.y, self.z)
        return ids, np.array(corner) + np.column_stack([at, up]) * np.array(size)

    def segments(self) -> Mat:
        """In units of the house's size, then moved and stretched."""
        corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
        uprights = np.zeros((4, 2, 3))
        uprights[:, :, :2] = corners[:, None]
        uprights[:, 1, 2] = WALL_SHARE
        south, north = (((0.0, y, WALL_SHARE), (1.0, y, WALL_SHARE)) for y in (0.0, 1.0))
        ridge = ((0.0, 0.5, 1.0), (1.0, 0.5, 1.0))
        rafters = [(eave[i], ridge[i]) for eave in (south, north) for i in (0, 1)]
        roof = np.array([south, north, *rafters, ridge])
        door = rectangle(0.6, 0.8, 0.0, 0.5, 0.0)[..., [2, 0, 1]]
        window = rectangle(0.2, 0.4, 0.25, 0.5, 0.0)[..., [2, 0, 1]]
        unit = np.concatenate([uprights, rectangle(0.0, 1.0, 0.0, 1.0, 0.0), roof, door, window])
        size, corner = (self.length, self.width, self.height), (self.x, self.y, self.z)
        return np.array(corner) + unit * np.array(size)


@dataclass(frozen=True)
class CorridorLoop(SimulatedWorld):
    """A corridor round a rectangular block: points on both walls at random heights, and segments
    along the floor of both walls and the frames of the doors in the outer one."""

    name: ClassVar[str] = "corridor loop"
    space: ClassVar[Space] = THREE_D
    turns: ClassVar[bool] = True
    length: float = param(16.0, unit="m", lo=1.0, hi=1e4, soft=(5.0, 50.0), effect="on reset")
    """Of the loop along x, from middle to middle of the corridor."""
    width: float = param(10.0, unit="m", lo=1.0, hi=1e4, soft=(5.0, 50.0), effect="on reset")
    """The same along y."""
    corridor: float = param(2.0, unit="m", lo=0.1, hi=100.0, soft=(1.0, 5.0), effect="on reset")
    """From wall to wall; narrower than the loop is long and wide."""
    height: float = param(2.5, unit="m", lo=1.0, hi=100.0, soft=(2.0, 5.0), effect="on reset")
    """Of the walls."""
    spacing: float = param(1.2, unit="m", lo=0.05, hi=100.0, soft=(0.3, 5.0), effect="on reset")
    """Distance of neighbouring points along a wall, at most."""
    doors: int = param(2, lo=0, hi=50, effect="on reset", label="Doors")
    """In each of the four outer walls."""
    layout: int = param(1, lo=0, effect="on reset")
    """Another number puts the points at other heights."""

    def points(self) -> tuple[np.ndarray, Vec]:
        at = np.concatenate([_along(_walls(self, side), self.spacing) for side in (1.0, -1.0)])
        rng = noise.rng(self.layout, "world:corridor loop")
        low = min(EDGE, 0.5 * self.height)
        z = rng.uniform(low, self.height - low, len(at))
        return np.arange(1, len(at) + 1), np.column_stack([at, z])

    def segments(self) -> Mat:
        floors = [_raised(_walls(self, side), 0.0) for side in (1.0, -1.0)]
        return np.concatenate([*floors, *(_doors(wall, self) for wall in _walls(self, 1.0))])

    def outline(self) -> Mat:
        walls = [_walls(self, side) for side in (1.0, -1.0)]
        edges = [_raised(wall, z) for wall in walls for z in (0.0, self.height)]
        uprights = [
            np.stack([_raised(w, 0.0)[:, 0], _raised(w, self.height)[:, 0]], 1) for w in walls
        ]
        return np.concatenate([*edges, *uprights, self.segments()])

    def corners(self) -> tuple[tuple[float, float], ...]:
        """Corners (x, y) of the middle of the corridor, in m: waypoints for a lap."""
        return _corners(self)


@dataclass(frozen=True)
class CorridorPlan(SimulatedWorld):
    """The same corridor as a plane (z, x): points along both walls."""

    name: ClassVar[str] = "corridor plan"
    space: ClassVar[Space] = TWO_D
    length: float = param(16.0, unit="m", lo=1.0, hi=1e4, soft=(5.0, 50.0), effect="on reset")
    """Of the loop along z, from middle to middle of the corridor."""
    width: float = param(10.0, unit="m", lo=1.0, hi=1e4, soft=(5.0, 50.0), effect="on reset")
    """The same along x."""
    corridor: float = param(2.0, unit="m", lo=0.1, hi=100.0, soft=(1.0, 5.0), effect="on reset")
    """From wall to wall; narrower than the loop is long and wide."""
    spacing: float = param(1.2, unit="m", lo=0.05, hi=100.0, soft=(0.3, 5.0), effect="on reset")
    """Distance of neighbouring points along a wall, at most."""

    def points(self) -> tuple[np.ndarray, Vec]:
        at = np.concatenate([_along(_walls(self, side), self.spacing) for side in (1.0, -1.0)])
        return np.arange(1, len(at) + 1), at

    def outline(self) -> Mat:
        return np.concatenate([_walls(self, side) for side in (1.0, -1.0)])

    def corners(self) -> tuple[tuple[float, float], ...]:
        """Corners (z, x) of the middle of the corridor, in m: waypoints for a lap."""
        return _corners(self)


def _corners(loop: CorridorLoop | CorridorPlan) -> tuple[tuple[float, float], ...]:
    a, b = 0.5 * loop.length, 0.5 * loop.width
    return (-a, -b), (a, -b), (a, b), (-a, b)


def _walls(loop: CorridorLoop | CorridorPlan, side: float) -> Mat:
    """The four outer (side = 1) or inner (-1) walls (4, 2, 2); a corridor that is wider than its
    block leaves none of it."""
    a, b = (max(0.5 * (v + side * loop.corridor), 0.0) for v in (loop.length, loop.width))
    return rectangle(-a, a, -b, b, 0.0)[..., :2]


def _along(walls: Mat, spacing: float) -> Vec:
    """Places (K, 2) at equal distances of at most `spacing` along each wall, corners left out."""
    places = []
    for start, end in walls:
        count = int(np.ceil(np.linalg.norm(end - start) / spacing))
        if count > 0:
            t = (np.arange(count) + 0.5) / count
            places.append(start + t[:, None] * (end - start))
    return np.concatenate(places) if places else np.zeros((0, 2))


def _raised(walls: Mat, z: float) -> Mat:
    """Walls (M, 2, 2) as horizontal segments (M, 2, 3)."""
    return np.concatenate([walls, np.full((len(walls), 2, 1), z)], axis=-1)


def _doors(wall: Mat, loop: CorridorLoop) -> Mat:
    """Both posts and the lintel of each door in a wall (2, 2): (3 doors, 2, 3)."""
    start, end = wall
    far = float(np.linalg.norm(end - start))
    width, top = min(DOOR[0], far / (2 * loop.doors + 1)), min(DOOR[1], loop.height)
    frames = np.zeros((loop.doors, 3, 2, 3))
    for i in range(loop.doors):
        middle = far * (i + 0.5) / loop.doors
        left, right = (start + (end - start) * (middle + s * width / 2) / far for s in (-1, 1))
        frames[i, 0, :, :2], frames[i, 1, :, :2] = left, right
        frames[i, :2, 1, 2] = frames[i, 2, :, 2] = top
        frames[i, 2, 0, :2], frames[i, 2, 1, :2] = left, right
    return frames.reshape(-1, 2, 3)
