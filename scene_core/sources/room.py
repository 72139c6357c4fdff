"""A furnished room: its surfaces as textured rectangles, lit once and for all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.geometry.spaces import THREE_D, Space
from scene_core.params import param
from scene_core.sources import painting, wall_art
from scene_core.sources.canvas import WALL, WOOD, Canvas
from scene_core.sources.lighting import lit
from scene_core.sources.surface import Surface
from scene_core.sources.worlds import SimulatedWorld

SIZE = (6.0, 5.0, 2.6)
"""Of the room along x, y and z, m; the floor's middle is the origin, z is up."""
POSTER = (-0.55, 1.75, 1.1, 0.8)
"""Left edge x and upper edge z of the known poster on the wall y = 2.5, its width and height, m."""
BOXES: tuple[tuple[str, tuple[float, float, float], tuple[float, float, float]], ...] = (
    ("bookcase", (2.64, -0.9, 0.0), (3.0, 0.7, 1.95)),
    ("chest", (1.45, 2.02, 0.0), (2.55, 2.5, 0.82)),
    ("crate", (-2.75, 1.55, 0.0), (-2.05, 2.25, 0.66)),
    ("crate", (-2.62, 1.68, 0.66), (-2.2, 2.1, 1.06)),
    ("chest", (-0.6, -2.5, 0.0), (0.9, -2.08, 0.58)),
)
"""Furniture: kind, lower and upper corner, m."""
DENSITY = 200.0
"""Texels per metre."""


@dataclass(frozen=True)
class TexturedRoom(SimulatedWorld):
    """A living room of 6 x 5 x 2.6 m with furniture, pictures, a window, and a wall of repeated
    pattern. Its landmarks by identity are the four corners of a poster."""

    name: ClassVar[str] = "room"
    space: ClassVar[Space] = THREE_D
    pattern: float = param(0.14, unit="m", lo=0.05, hi=1.0, effect="on reset", label="Pattern")
    """Period of the repeated pattern on the wallpapered wall."""

    def points(self) -> tuple[np.ndarray, Vec]:
        return np.arange(1, 5), poster_corners()

    def outline(self) -> Mat:
        low = np.array([-SIZE[0] / 2, -SIZE[1] / 2, 0.0])
        boxes = [(low, low + np.array(SIZE)), *((np.array(a), np.array(b)) for _, a, b in BOXES)]
        return np.concatenate([_edges(a, b) for a, b in boxes])

    def surfaces(self) -> tuple[Surface, ...]:
        return _surfaces(self)

    def references(self) -> dict[str, Vec]:
        return {f"poster:{i}": corner for i, corner in enumerate(poster_corners())}


def poster_corners() -> Vec:
    """Corners (4, 3) of the poster, m: upper left, upper right, lower right, lower left."""
    x, z, w, h = POSTER
    y = SIZE[1] / 2
    return np.array([(x, y, z), (x + w, y, z), (x + w, y, z - h), (x, y, z - h)])


def _edges(a: Vec, b: Vec) -> Mat:
    """The twelve edges (12, 2, 3) of a box."""
    bits = np.array([[i >> k & 1 for k in range(3)] for i in range(8)])
    corners = np.where(bits, b, a)
    pairs = [(i, i | 1 << k) for i in range(8) for k in range(3) if not i >> k & 1]
    return np.array([[corners[i], corners[j]] for i, j in pairs])


@lru_cache(maxsize=4)
def _surfaces(room: TexturedRoom) -> tuple[Surface, ...]:
    walls = _walls(room)
    boxes = [face for i, box in enumerate(BOXES) for face in _box_faces(i, *box)]
    furniture = [(np.array(a), np.array(b)) for _, a, b in BOXES]
    return tuple(
        Surface(
            name=name,
            corner=frozen(corner),
            right=frozen(right),
            down=frozen(down),
            width=canvas.width,
            height=canvas.height,
            texture=lit(canvas, corner, right, down, np.array(SIZE), furniture),
            is_wall=is_wall,
        )
        for name, corner, right, down, canvas, is_wall in [
            *((*wall, True) for wall in walls),
            *((*face, False) for face in boxes),
        ]
    )


_Bare = tuple[str, Vec, Vec, Vec, Canvas]
X, Y, Z = np.eye(3)


def _walls(room: TexturedRoom) -> list[_Bare]:
    x, y, z = SIZE[0] / 2, SIZE[1] / 2, SIZE[2]
    return [
        ("poster wall", np.array([-x, y, z]), X, -Z, _poster_wall()),
        ("bookcase wall", np.array([x, y, z]), -Y, -Z, _bookcase_wall()),
        ("patterned wall", np.array([x, -y, z]), -X, -Z, _patterned_wall(room.pattern)),
        ("window wall", np.array([-x, -y, z]), Y, -Z, _window_wall()),
        ("floor", np.array([-x, y, 0.0]), X, -Y, _floor()),
        ("ceiling", np.array([-x, -y, z]), X, Y, _ceiling()),
    ]


def _plaster(width: float, seed: int) -> Canvas:
    c = Canvas(width, SIZE[2], DENSITY, WALL, seed)
    c.mottle(3.5, 0.5)
    c.rectangle(0, SIZE[2] - 0.1, width, 0.1, (206, 200, 190))
    c.rectangle(0, SIZE[2] - 0.108, width, 0.008, (96, 90, 82))
    return c


def _poster_wall() -> Canvas:
    c = _plaster(SIZE[0], 11)
    x, z, w, h = POSTER
    wall_art.poster(c, x + SIZE[0] / 2, SIZE[2] - z, w, h)
    wall_art.framed(c, 0.95, 0.62, 0.8, 0.58, "hills")
    wall_art.framed(c, 1.12, 1.42, 0.46, 0.36, "letters")
    wall_art.framed(c, 0.28, 0.66, 0.42, 0.56, "rings")
    wall_art.framed(c, 3.92, 0.6, 0.5, 0.68, "blocks")
    wall_art.framed(c, 4.72, 0.72, 0.9, 0.62, "chart")
    painting.clock(c, 3.0, 0.46, 0.16)
    return c


def _bookcase_wall() -> Canvas:
    c = _plaster(SIZE[1], 12)
    wall_art.framed(c, 0.35, 0.6, 0.62, 0.84, "triangles")
    wall_art.framed(c, 1.2, 0.72, 0.38, 0.5, "letters")
    wall_art.framed(c, 3.62, 0.62, 0.95, 0.66, "blocks")
    wall_art.framed(c, 3.8, 1.5, 0.56, 0.4, "rings")
    return c


def _patterned_wall(period: float) -> Canvas:
    c = Canvas(SIZE[0], SIZE[2], DENSITY, WALL, 13)
    painting.wallpaper(c, period)
    c.rectangle(0, SIZE[2] - 0.1, SIZE[0], 0.1, (206, 200, 190))
    wall_art.framed(c, 1.0, 0.66, 0.66, 0.5, "chart")
    wall_art.framed(c, 4.3, 0.6, 0.6, 0.8, "hills")
    return c


def _window_wall() -> Canvas:
    c = _plaster(SIZE[1], 14)
    painting.window(c, 1.75, 0.62, 1.5, 1.15)
    painting.door(c, 0.25, 0.86, 2.05)
    wall_art.framed(c, 3.98, 0.7, 0.62, 0.46, "triangles")
    return c


def _floor() -> Canvas:
    c = Canvas(SIZE[0], SIZE[1], DENSITY, WOOD, 15)
    painting.planks(c)
    painting.rug(c, 1.7, 1.55, 2.7, 1.8)
    return c


def _ceiling() -> Canvas:
    c = Canvas(SIZE[0], SIZE[1], DENSITY / 2, (214, 212, 206), 16)
    c.mottle(2.0, 0.8)
    for x in (1.5, 3.0, 4.5):
        c.rectangle(x - 0.05, 0, 0.1, SIZE[1], (176, 164, 148))
    c.disc(3.0, 2.5, 0.32, (150, 148, 142))
    c.disc(3.0, 2.5, 0.29, (255, 253, 246))
    c.shine(2.72, 2.22, 0.56, 0.56, 1.0)
    return c


def _box_faces(number: int, kind: str, low: tuple, high: tuple) -> list[_Bare]:
    """The faces of a piece of furniture that are not against the floor or a wall."""
    a, b = np.array(low), np.array(high)
    half = np.array([SIZE[0] / 2, SIZE[1] / 2])
    faces = [
        ("west", np.array([a[0], b[1], b[2]]), -Y, -Z, a[0] > -half[0] + 1e-6),
        ("east", np.array([b[0], a[1], b[2]]), Y, -Z, b[0] < half[0] - 1e-6),
        ("south", np.array([a[0], a[1], b[2]]), X, -Z, a[1] > -half[1] + 1e-6),
        ("north", np.array([b[0], b[1], b[2]]), -X, -Z, b[1] < half[1] - 1e-6),
        ("top", np.array([a[0], b[1], b[2]]), X, -Y, True),
    ]
    out = []
    for k, (side, corner, right, down, free) in enumerate(faces):
        if free:
            size = b - a
            c = Canvas(abs(size @ right), abs(size @ down), DENSITY, WOOD, 100 + 10 * number + k)
            _FINISH[kind](c, side)
            out.append((f"{kind} {number} {side}", corner, right, down, c))
    return out


def _bookcase(c: Canvas, side: str) -> None:
    if side == "west":
        painting.books(c, 5)
    else:
        c.mottle(4.0, 0.3)


def _chest(c: Canvas, side: str) -> None:
    if side in ("north", "south"):
        painting.drawers(c, 2, 3)
    elif side == "top":
        c.mottle(4.0, 0.3)
        c.rectangle(0.12, 0.1, 0.26, 0.2, (226, 220, 206))
        c.rectangle(0.5, 0.14, 0.18, 0.18, (60, 84, 104))
        c.disc(c.width - 0.2, 0.2, 0.09, (178, 84, 60))
    else:
        c.mottle(4.0, 0.3)


def _crate(c: Canvas, side: str) -> None:
    painting.crate(c)


_FINISH: dict[str, Callable[[Canvas, str], None]] = {
    "bookcase": _bookcase,
    "chest": _chest,
    "crate": _crate,
}
