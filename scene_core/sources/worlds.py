"""Simulated worlds: where the true landmarks are, and the lines that make a place recognisable."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.geometry.embedding import embed_points
from scene_core.geometry.spaces import ONE_D, THREE_D, TWO_D, Space
from scene_core.params import param
from scene_core.sources import noise
from scene_core.sources.surface import Surface


class Ground(NamedTuple):
    """What a robot drives on at some places of the plane."""

    height: Vec
    """(...,) m."""
    slope: Vec
    """(..., 2): dheight/dx, dheight/dy."""


class SimulatedWorld(ABC):
    """True landmarks with identities, in one space: points, and the segments of straight lines."""

    name: ClassVar[str]
    """The word the settings file uses."""
    space: ClassVar[Space]
    any_space: ClassVar[bool] = False
    """Whether it may turn out to be of any dimension; `space` then says of which one it is."""
    turns: ClassVar[bool] = False
    """A 3-D world that is written with z up and stands upright in a y-up simulation as well: its
    x, y, z become that one's z, x, y. False: its axes are the simulation's as they are."""

    @abstractmethod
    def points(self) -> tuple[np.ndarray, Vec]:
        """Identities (K,) int and positions (K, d) in m."""

    def segments(self) -> Mat:
        """Ends (M, 2, d) in m of the true line landmarks; none unless overridden."""
        return np.zeros((0, 2, self.space.d))

    def outline(self) -> Mat:
        """Segments (M, 2, d) that show the place on the map; its line landmarks unless
        overridden."""
        return self.segments()

    def ground(self, at: Vec) -> Ground | None:
        """The ground below places (..., 2) in m of a z-up world; None: it has none."""
        return None

    def surfaces(self) -> tuple[Surface, ...]:
        """Everything there is to see, lit, for cameras that take pictures; nothing unless
        overridden. Computed once."""
        return ()

    def references(self) -> Mapping[str, Vec]:
        """Places (3,) by name that settings may give as known landmarks; none unless overridden."""
        return {}

    def known(self) -> tuple[KnownPoint, ...]:
        """Landmarks the estimator is given at the start; none unless overridden."""
        return ()

    def wanting(self) -> str:
        """What has to be given before there is anything in it, as an instruction; may be empty."""
        return ""

    def version(self) -> Hashable:
        """What tells that the landmarks of an equal world are still the same."""
        return None


class KnownPoint(NamedTuple):
    """A landmark the estimator is given at the start."""

    id: int
    position: tuple[float, ...]
    """m."""
    sd: float
    """m."""


class Lines(NamedTuple):
    """True line landmarks."""

    ids: np.ndarray
    """Identities (M,)."""
    ends: Mat
    """(M, 2, d) m."""


def landmarks(world: SimulatedWorld) -> tuple[np.ndarray, Vec]:
    """`world.points()`, computed once and read-only."""
    return _landmarks(world, world.version())[0]


def lines(world: SimulatedWorld) -> Lines:
    """`world.segments()` with identities that go on after those of its points; computed once and
    read-only."""
    return _landmarks(world, world.version())[1]


@lru_cache(maxsize=16)
def _landmarks(world: SimulatedWorld, _: Hashable) -> tuple[tuple[np.ndarray, Vec], Lines]:
    ids, at = world.points()
    ids, at = ids.copy(), np.array(at, dtype=np.float64)
    ends = np.array(world.segments(), dtype=np.float64)
    after = int(ids.max(initial=0)) + 1
    line_ids = np.arange(after, after + len(ends))
    for a in (ids, at, line_ids, ends):
        a.flags.writeable = False
    return (ids, at), Lines(line_ids, ends)


def in_axes(world: SimulatedWorld, at: Vec, up: str) -> Vec:
    """Places (..., d) of a world in the axes (..., 3) of a simulation in which `up` points up."""
    if world.space.d < 3:
        return embed_points(at, world.space, up)
    return at[..., [1, 2, 0]] if world.turns and up == "y" else at


@dataclass(frozen=True)
class ThickCloister(SimulatedWorld):
    """The toolbox's default world: two square rows of columns, one inside the other.

    Columns stand on a grid of n x n places over [x0, x1] x [y0, y1], on its outermost row without
    the corners and on the next one with them; each carries a point at its foot and one at height h:
    72 points for n = 7. Source: toolbox document, default experiment.
    """

    name: ClassVar[str] = "cloister"
    space: ClassVar[Space] = THREE_D
    turns: ClassVar[bool] = True
    x0: float = param(-6.0, unit="m", effect="on reset")
    """Western side."""
    x1: float = param(6.0, unit="m", effect="on reset")
    """Eastern side."""
    y0: float = param(-6.0, unit="m", effect="on reset")
    """Southern side."""
    y1: float = param(6.0, unit="m", effect="on reset")
    """Northern side."""
    h: float = param(1.0, unit="m", lo=0.0, effect="on reset")
    """Height of the columns."""
    n: int = param(7, lo=4, hi=200, effect="on reset")
    """Grid places along a side."""

    def points(self) -> tuple[np.ndarray, Vec]:
        sides = np.concatenate(self._sides())
        floor = np.column_stack([sides, np.zeros(len(sides))])
        roof = np.column_stack([sides, np.full(len(sides), self.h)])
        return np.arange(1, 2 * len(sides) + 1), np.concatenate([floor, roof])

    def outline(self) -> Mat:
        inner_x = (self.x1 - self.x0) / (self.n - 1)
        inner_y = (self.y1 - self.y0) / (self.n - 1)
        boxes = (
            (self.x0, self.x1, self.y0, self.y1),
            (self.x0 + inner_x, self.x1 - inner_x, self.y0 + inner_y, self.y1 - inner_y),
        )
        columns = np.concatenate(self._sides())
        uprights = np.zeros((len(columns), 2, 3))
        uprights[:, :, :2] = columns[:, None]
        uprights[:, 1, 2] = self.h
        return np.concatenate([*(rectangle(*b, z) for b in boxes for z in (0.0, self.h)), uprights])

    def _sides(self) -> list[Vec]:
        """Places (9, 2) of each side: outer row, inner row up to the corner of the next side."""
        x, y = np.linspace(self.x0, self.x1, self.n), np.linspace(self.y0, self.y1, self.n)
        xs, ys = x[::-1], y[::-1]
        rows = [
            (x[1:-1], y[-1], x[1:-2], y[-2]),
            (x[0], y[1:-1], x[1], y[1:-2]),
            (xs[1:-1], y[0], xs[1:-2], y[1]),
            (x[-1], ys[1:-1], x[-2], ys[1:-2]),
        ]
        return [
            np.concatenate(
                [np.column_stack(np.broadcast_arrays(*row)) for row in (side[:2], side[2:])]
            )
            for side in rows
        ]


@dataclass(frozen=True)
class Line(SimulatedWorld):
    """Scene's 1-D world: landmarks along a line, at +-1, +-2 and +-3 m."""

    name: ClassVar[str] = "line"
    space: ClassVar[Space] = ONE_D
    places: tuple[float, ...] = param(
        (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0), unit="m", lo=-1e4, hi=1e4, effect="on reset"
    )
    """Where the landmarks are."""

    def points(self) -> tuple[np.ndarray, Vec]:
        return np.arange(1, len(self.places) + 1), np.array(self.places, dtype=float)[:, None]

    def outline(self) -> Mat:
        return np.array([[[min(self.places)], [max(self.places)]]])


@dataclass(frozen=True)
class Field(SimulatedWorld):
    """A planar field (z, x) of landmarks on a regular grid, each moved at random by up to `scatter`
    of the grid's step."""

    name: ClassVar[str] = "field"
    space: ClassVar[Space] = TWO_D
    rows: int = param(7, lo=1, hi=200, effect="on reset")
    """Landmarks along z."""
    columns: int = param(6, lo=1, hi=200, effect="on reset")
    """Landmarks along x."""
    step: float = param(1.6, unit="m", lo=0.01, hi=1e3, effect="on reset")
    """Distance of neighbours on the grid."""
    scatter: float = param(0.35, lo=0.0, hi=0.5, effect="on reset")
    """How far a landmark strays from its place on the grid, in steps."""
    layout: int = param(1, lo=0, effect="on reset")
    """Another number scatters the landmarks differently."""

    def points(self) -> tuple[np.ndarray, Vec]:
        z, x = np.meshgrid(self._axis(self.rows), self._axis(self.columns), indexing="ij")
        grid = np.column_stack([z.ravel(), x.ravel()])
        stray = noise.rng(self.layout, "world:field").uniform(
            -self.scatter, self.scatter, grid.shape
        )
        return np.arange(1, len(grid) + 1), self.step * (grid + stray)

    def outline(self) -> Mat:
        z, x = ((n / 2) * self.step for n in (self.rows, self.columns))
        return rectangle(-z, z, -x, x, 0.0)[..., :2]

    @staticmethod
    def _axis(n: int) -> Vec:
        return np.arange(n, dtype=np.float64) - (n - 1) / 2


def rectangle(x0: float, x1: float, y0: float, y1: float, z: float) -> Mat:
    """The four sides (4, 2, 3) of a horizontal rectangle."""
    corners = np.array([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
