"""Undulating ground, and how it holds a robot that drives on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.ports import SourceError
from scene_core.geometry import quaternion
from scene_core.geometry.spaces import THREE_D, Space
from scene_core.models.base import MotionModel
from scene_core.params import param
from scene_core.sources import noise
from scene_core.sources.worlds import Ground, SimulatedWorld, in_axes

DRAWN = 8
"""Lines of the drawn grid on each side of the middle one."""
PIECES = 24
"""Straight pieces of each of them."""


@dataclass(frozen=True)
class Terrain(SimulatedWorld):
    """Undulating ground with points on it: stones, and the tips of sticks.

    height(x, y) = sqrt(2 / n) relief sum_i sin(k_i . (x, y) + phi_i),  i = 1 ... n

    with wave numbers |k_i| of 2 pi / wavelength to half of that, in directions and with phases
    drawn by `layout`: relief is the root mean square of the height over a wide plane.
    Source: this project; the ground Scene's 3-D robot drives on is a random fold per step.
    """

    name: ClassVar[str] = "terrain"
    space: ClassVar[Space] = THREE_D
    turns: ClassVar[bool] = True
    relief: float = param(0.12, unit="m", lo=0.0, hi=100.0, soft=(0.0, 0.5), effect="on reset")
    """Root mean square of the ground's height."""
    wavelength: float = param(6.0, unit="m", lo=0.1, hi=1e4, soft=(2.0, 20.0), effect="on reset")
    """Of the shortest waves; the longest have twice as much."""
    waves: int = param(5, lo=1, hi=50, effect="on reset", label="Waves")
    """How many are added."""
    extent: float = param(8.0, unit="m", lo=0.1, hi=1e4, soft=(2.0, 50.0), effect="on reset")
    """Half side of the square with points on it."""
    spacing: float = param(1.6, unit="m", lo=0.05, hi=1e3, soft=(0.5, 5.0), effect="on reset")
    """Distance of neighbouring points, before each strays by up to a third of it."""
    sticks: float = param(0.8, unit="m", lo=0.0, hi=100.0, soft=(0.0, 3.0), effect="on reset")
    """Every other point is the tip of a stick up to this high; the others lie on the ground."""
    layout: int = param(1, lo=0, effect="on reset")
    """Another number makes another ground."""

    def points(self) -> tuple[np.ndarray, Vec]:
        n = max(1, round(2.0 * self.extent / self.spacing))
        axis = (np.arange(n) + 0.5) * (2.0 * self.extent / n) - self.extent
        x, y = np.meshgrid(axis, axis, indexing="ij")
        rng = noise.rng(self.layout, "world:terrain:points")
        stray = rng.uniform(-1.0, 1.0, (x.size, 2)) * min(self.spacing, self.extent) / 3.0
        grid = np.column_stack([x.ravel(), y.ravel()])
        at: Vec = np.clip(grid + stray, -self.extent, self.extent)
        above = rng.uniform(0.0, self.sticks, len(at)) * (np.arange(len(at)) % 2)
        return np.arange(1, len(at) + 1), np.column_stack([at, self.ground(at).height + above])

    def outline(self) -> Mat:
        across = np.linspace(-self.extent, self.extent, 2 * DRAWN + 1)
        along = np.linspace(-self.extent, self.extent, PIECES + 1)
        a, b = np.meshgrid(across, along, indexing="ij")
        grid = np.stack([np.stack([a, b], -1), np.stack([b, a], -1)])
        ground = np.concatenate([grid, self.ground(grid).height[..., None]], axis=-1)
        pieces = np.stack([ground[..., :-1, :], ground[..., 1:, :]], axis=-2).reshape(-1, 2, 3)
        return pieces

    def ground(self, at: Vec) -> Ground:
        waves = _waves(self)
        phase = at @ waves.k.T + waves.phi
        height = waves.amplitude * np.sin(phase).sum(-1)
        return Ground(height, waves.amplitude * (np.cos(phase) @ waves.k))


class _Waves(NamedTuple):
    k: Vec
    """(n, 2) rad/m."""
    phi: Vec
    """(n,) rad."""
    amplitude: float
    """m."""


@lru_cache(maxsize=16)
def _waves(terrain: Terrain) -> _Waves:
    rng = noise.rng(terrain.layout, "world:terrain:waves")
    n = terrain.waves
    # Directions about evenly round the circle, so that no layout is a mere corrugation.
    angle = np.pi * (np.arange(n) + rng.random(n)) / n
    length = 2.0 * np.pi / (terrain.wavelength * rng.uniform(1.0, 2.0, n))
    k = length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return _Waves(k, rng.uniform(0.0, 2.0 * np.pi, n), np.sqrt(2.0 / n) * terrain.relief)


def on_ground(world: SimulatedWorld, up: str, motion: MotionModel, xv: Vec) -> Vec:
    """The true state xv (n,) of a robot put down on the ground below it: its position is raised or
    lowered along the axis that points up, and it is tilted by the smallest turn that brings its
    own axis of that name onto the normal of the ground, so that it does not change its heading.

    Raises SourceError where the world has no ground or the robot does not move in space.
    """
    places, turn = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
    missing = [s for s in (*places, *turn) if s not in motion.state_labels]
    if missing:
        raise SourceError(
            f"a robot with the motion model '{motion.name}' can not be kept on the ground: its "
            f"state has no '{missing[0]}'; choose one that moves in 3-D or turn 'on ground' off"
        )
    r, q = ([motion.state_labels.index(s) for s in labels] for labels in (places, turn))
    if world.space.d != 3:
        raise SourceError(_no_ground(world))
    back = in_axes(world, np.arange(3.0), up).astype(int)
    flat = np.empty(3)
    flat[back] = xv[r]
    ground = world.ground(flat[:2])
    if ground is None:
        raise SourceError(_no_ground(world))
    flat[2] = ground.height
    normal = np.array([-ground.slope[0], -ground.slope[1], 1.0])
    normal = (normal / np.linalg.norm(normal))[back]
    out = xv.copy()
    out[r] = flat[back]
    out[q] = quaternion.product(_least_turn(quaternion.rotate(xv[q], _axis(up)).v, normal), xv[q])
    return out


def _no_ground(world: SimulatedWorld) -> str:
    return (
        f"the world '{world.name}' has no ground to drive on: choose the world '{Terrain.name}' "
        "or turn 'on ground' off"
    )


def _axis(up: str) -> Vec:
    return np.eye(3)["xyz".index(up)]


def _least_turn(a: Vec, b: Vec) -> Vec:
    """The quaternion (4,) of the smallest rotation that takes the unit vector a to b."""
    q = np.array([1.0 + a @ b, *np.cross(a, b)])
    if q[0] < 1e-12:
        q = np.array([0.0, *np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])])
    return q / np.linalg.norm(q)
