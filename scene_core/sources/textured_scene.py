"""The surfaces of a room, ready to be looked at, and what a ray meets first."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry import quaternion
from scene_core.sources.surface import Surface
from scene_core.sources.worlds import SimulatedWorld

LEVELS = 5
"""Of every texture's pyramid."""
PAD = 4
"""Texels by which a texture is continued in the atlas, at every level."""


class Scene(NamedTuple):
    """All surfaces, ready to be looked at."""

    surfaces: tuple[Surface, ...]
    n: np.ndarray
    """Unit normals (S, 3)."""
    corner: np.ndarray
    right: np.ndarray
    """Texture axes in texels: (S, 3), divided by the size of a texel."""
    down: np.ndarray
    size: np.ndarray
    """Texels (S, 2): columns, rows."""
    is_wall: np.ndarray
    atlas: np.ndarray
    """uint8 grey image that holds all pyramids, one below the other; level j of each starts in
    column 2 pitch (1 - 2^-j)."""
    pitch: float
    top: np.ndarray
    """Row (S,) in the atlas where a surface's pyramid starts, float32."""


@lru_cache(maxsize=4)
def scene_of(room: SimulatedWorld) -> Scene:
    """The room's surfaces with their textures in one atlas."""
    surfaces = room.surfaces()
    chains = [_pyramid(s.texture) for s in surfaces]
    widest = max(chain[0].shape[1] for chain in chains) + 2 * PAD * 2**LEVELS
    pitch = -(-widest // 2**LEVELS) * 2**LEVELS
    tops = np.cumsum([0, *(chain[0].shape[0] for chain in chains)])
    atlas = np.zeros((int(tops[-1]), 2 * pitch), np.uint8)
    for top, chain in zip(tops, chains, strict=False):
        for j, level in enumerate(chain):
            left = 2 * pitch - 2 * pitch // 2**j
            atlas[top : top + level.shape[0], left : left + level.shape[1]] = level
    size = np.array([s.texture.shape[1::-1] for s in surfaces])
    metres = np.array([(s.width, s.height) for s in surfaces])
    scale = size / metres
    return Scene(
        surfaces=surfaces,
        n=np.array([s.normal for s in surfaces]),
        corner=np.array([s.corner for s in surfaces]),
        right=np.array([s.right for s in surfaces]) * scale[:, :1],
        down=np.array([s.down for s in surfaces]) * scale[:, 1:],
        size=size,
        is_wall=np.array([s.is_wall for s in surfaces]),
        atlas=atlas,
        pitch=float(pitch),
        top=tops[:-1].astype(np.float32),
    )


def _pyramid(texture: np.ndarray) -> list[np.ndarray]:
    """Grey levels of a texture, each half the size of the one before, continued on all sides."""
    level = cv2.cvtColor(texture, cv2.COLOR_RGB2GRAY)
    out = []
    for _ in range(LEVELS):
        out.append(cv2.copyMakeBorder(level, PAD, PAD, PAD, PAD, cv2.BORDER_REPLICATE))
        rows, columns = level.shape
        even = cv2.copyMakeBorder(level, 0, rows % 2, 0, columns % 2, cv2.BORDER_REPLICATE)
        level = cv2.resize(
            even, (even.shape[1] // 2, even.shape[0] // 2), interpolation=cv2.INTER_AREA
        )
    return out


def hit(scene: Scene, pose: Vec, ray: Vec) -> Vec | None:
    """The place (3,) in the room that a ray (3,) of a camera at `pose` meets first."""
    R, p = quaternion.matrix(pose[3:]), pose[:3]
    d = R @ ray
    gap = ((p - scene.corner) * scene.n).sum(1)
    toward = -(scene.n @ d)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.where((gap > 0) & (toward > 1e-9), gap / toward, np.inf)
    for i in np.argsort(r):
        if not np.isfinite(r[i]):
            return None
        at = p + r[i] * d
        texel = np.array([scene.right[i], scene.down[i]]) @ (at - scene.corner[i])
        if scene.is_wall[i] or ((texel >= 0) & (texel <= scene.size[i])).all():
            return at
    return None


def visible(scene: Scene, position: Vec, place: Vec) -> bool:
    """Whether nothing stands between a camera at `position` (3,) and a place (3,)."""
    way = place - position
    distance = float(np.linalg.norm(way))
    pose = np.concatenate([position, [1.0, 0.0, 0.0, 0.0]])
    first = hit(scene, pose, way / distance)
    return first is not None and float(np.linalg.norm(first - position)) > distance - 1e-3
