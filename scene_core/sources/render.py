"""Camera images of a textured room, fast enough to be played.

Every pixel's ray meets the surface on which the inverse distance s is largest. On a plane with unit
normal n and n'x = c, seen from p along the unit ray d, s = (n'd) / (c - n'p) is linear in d, and so
are u s and v s with (u, v) the place on the texture: three products of a 3x3 matrix with all rays.
Textures are filtered over two levels of a pyramid (trilinear), so that far surfaces do not alias.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry import quaternion
from scene_core.params import param
from scene_core.sources.pixel_rays import Rays
from scene_core.sources.textured_scene import LEVELS, PAD, Scene

_CELL = 16
"""Pixels between the rays of the coarse grid that tells which surfaces are in view."""
_STEP = 1.0
"""Pixels between the images an exposure is made of."""
_MAX_SAMPLES = 12


@dataclass(frozen=True)
class Rendering:
    """How the simulated camera takes its pictures."""

    exposure: float = param(0.006, unit="s", lo=0.0, hi=0.5, soft=(0.0, 0.04), label="Exposure")
    """Time the shutter is open: what moves meanwhile is blurred."""
    gain: float = param(1.3, lo=0.05, hi=10.0, soft=(0.3, 2.0), label="Gain")
    """Brightness of the image as a factor; it saturates at 255 grey levels."""
    flicker: float = param(0.01, lo=0.0, hi=1.0, soft=(0.0, 0.2), label="Flicker")
    """Standard deviation of the gain from frame to frame, as a fraction."""
    noise: float = param(3.0, lo=0.0, hi=100.0, soft=(0.0, 20.0), label="Image noise")
    """Standard deviation of every pixel's own noise, grey levels."""
    blur: float = param(0.5, unit="px", lo=0.0, hi=10.0, soft=(0.0, 3.0), label="Lens blur")
    """Width (one sigma) of the spot that a point makes on the sensor."""


def render(
    scene: Scene,
    rays: Rays,
    now: Vec,
    before: Vec,
    dt: float,
    how: Rendering,
    rng: np.random.Generator,
) -> np.ndarray:
    """The grey image, uint8 (height, width), taken from the camera pose `now` (7,), which was
    `before` (7,) dt seconds ago; the middle of the exposure is now."""
    poses = _exposed(rays, now, before, dt, how.exposure)
    image = look(scene, rays, poses[0])
    for pose in poses[1:]:
        image += look(scene, rays, pose)
    gain = how.gain * (1.0 + how.flicker * rng.standard_normal())
    image *= rays.shade * np.float32(gain / len(poses))
    if how.blur > 0.0:
        image = cv2.GaussianBlur(image, (0, 0), how.blur)
    if how.noise > 0.0:
        image += np.float32(how.noise) * rng.standard_normal(image.shape, dtype=np.float32)
    out = cv2.convertScaleAbs(np.maximum(image, 0.0))
    out.flags.writeable = False
    return out


def _exposed(rays: Rays, now: Vec, before: Vec, dt: float, exposure: float) -> list[Vec]:
    """Camera poses (7,) spread evenly over the exposure, one for every _STEP pixels of motion."""
    if dt <= 0.0 or exposure <= 0.0:
        return [now]
    v = (now[:3] - before[:3]) / dt
    turn = quaternion.product(quaternion.conjugate(before[3:]), now[3:])
    w = quaternion.to_rotation_vector(turn)[0] / dt
    travel = exposure * rays.focal * (np.linalg.norm(w) + np.linalg.norm(v))
    count = int(np.clip(np.ceil(travel / _STEP), 1, _MAX_SAMPLES))
    times = exposure * ((np.arange(count) + 0.5) / count - 0.5)
    return [
        np.concatenate(
            [
                now[:3] + v * t,
                quaternion.product(now[3:], quaternion.from_rotation_vector(w * t)[0]),
            ]
        )
        for t in times
    ]


class _View(NamedTuple):
    """The planes of some surfaces as a camera sees them: rows of linear forms in its rays."""

    s: np.ndarray
    """(S, 3): inverse distance."""
    u: np.ndarray
    """(S, 3): column on the texture, times inverse distance."""
    v: np.ndarray
    log_scale: np.ndarray
    """(S,): log2 of texels per radian at distance 1, seen at right angles, over sqrt(distance of
    the plane)."""


def _view(scene: Scene, pose: Vec) -> _View:
    R, p = quaternion.matrix(pose[3:]), pose[:3]
    gap = ((p - scene.corner) * scene.n).sum(1)
    safe = np.where(gap > 1e-6, gap, np.inf)
    s = -(scene.n @ R) / safe[:, None]
    from_corner = p - scene.corner
    u = ((from_corner * scene.right).sum(1)[:, None] * s) + scene.right @ R
    v = ((from_corner * scene.down).sum(1)[:, None] * s) + scene.down @ R
    texels = np.linalg.norm(scene.right, axis=1)
    return _View(
        s.astype(np.float32),
        u.astype(np.float32),
        v.astype(np.float32),
        np.log2(texels / np.sqrt(np.where(gap > 1e-6, gap, 1.0))).astype(np.float32),
    )


def look(scene: Scene, rays: Rays, pose: Vec) -> np.ndarray:
    """What an ideal camera sees from a pose (7,) inside the room: float32 (height, width)."""
    view = _view(scene, pose)
    walls, boxes = _in_sight(scene, rays, view)
    _, height, width = rays.d.shape
    flat = rays.d.reshape(3, -1)
    best = np.full((height, width), -1.0, np.float32)
    u, v, log_scale, top = (np.empty((height, width), np.float32) for _ in range(4))
    for i in walls:
        s, us, vs = (np.stack([view.s[i], view.u[i], view.v[i]]) @ flat).reshape(3, height, width)
        fits = s > best
        _keep(fits, (best, u, v, log_scale, top), (s, us, vs, view.log_scale[i], scene.top[i]))
    for i, rows, columns in boxes:
        block = (slice(rows[0], rows[1]), slice(columns[0], columns[1]))
        d = rays.d[:, block[0], block[1]]
        s, us, vs = np.tensordot(np.stack([view.s[i], view.u[i], view.v[i]]), d, 1)
        here = best[block]
        w, h = scene.size[i]
        fits = (s > here) & (us >= 0.0) & (us <= w * s) & (vs >= 0.0) & (vs <= h * s)
        to = (here, u[block], v[block], log_scale[block], top[block])
        _keep(fits, to, (s, us, vs, view.log_scale[i], scene.top[i]))
    return _sampled(scene, rays, best, u, v, log_scale, top)


def _keep(fits: np.ndarray, to: tuple[np.ndarray, ...], values: tuple[Any, ...]) -> None:
    """Where `fits`, write arrays and constants to their places."""
    mask = fits.view(np.uint8)
    for a, b in zip(to, values, strict=True):
        if isinstance(b, np.ndarray):
            cv2.copyTo(b, mask, a)
        else:
            np.copyto(a, b, where=fits)


_Box = tuple[int, tuple[int, int], tuple[int, int]]


def _in_sight(scene: Scene, rays: Rays, view: _View) -> tuple[np.ndarray, list[_Box]]:
    """Walls in view, and pieces of furniture with the rows and columns they may cover, as found on
    a coarse grid of rays."""
    _, height, width = rays.d.shape
    coarse = rays.d[:, ::_CELL, ::_CELL]
    shape = coarse.shape[1:]
    d = np.concatenate([coarse.reshape(3, -1), rays.d[:, -1, ::_CELL], rays.d[:, ::_CELL, -1]], 1)
    s, us, vs = view.s @ d, view.u @ d, view.v @ d
    walls = np.flatnonzero(scene.is_wall)
    nearest = walls[np.unique(s[walls].argmax(0))]
    grid = shape[0] * shape[1]
    cell = _CELL / rays.focal * np.linalg.norm(scene.right, axis=1)[:, None]
    w, h = scene.size[:, :1], scene.size[:, 1:]
    s0, u0, v0 = s[:, :grid], us[:, :grid], vs[:, :grid]
    near = (s0 > 0) & (u0 > -cell) & (u0 < w * s0 + cell) & (v0 > -cell) & (v0 < h * s0 + cell)
    boxes = []
    for i in np.flatnonzero(~scene.is_wall):
        rows, columns = np.nonzero(near[i].reshape(shape))
        if len(rows):
            top, left = ((k.min() - 1) * _CELL for k in (rows, columns))
            low, far = ((k.max() + 1) * _CELL + 1 for k in (rows, columns))
            boxes.append((int(i), (max(top, 0), min(low, height)), (max(left, 0), min(far, width))))
    return nearest, boxes


def _sampled(
    scene: Scene,
    rays: Rays,
    s: np.ndarray,
    us: np.ndarray,
    vs: np.ndarray,
    log_scale: np.ndarray,
    top: np.ndarray,
) -> np.ndarray:
    """Grey levels where the rays meet the textures, filtered over two pyramid levels.

    A pixel of angle a at distance r = 1/s on a plane at distance g covers a sqrt(r^3 / g) on it,
    the geometric mean of its sides."""
    lod = rays.log_size + log_scale
    lod -= np.float32(1.5) * np.log2(s)
    np.clip(lod, 0.0, LEVELS - 1.001, out=lod)
    level = lod.astype(np.int32)
    half = _HALF[level]
    r = np.reciprocal(s)
    u, v = us * r, vs * r
    # Texel i of level 0 has its centre at i + 1/2; level j starts in column 2 pitch (1 - 2^-j).
    start, edge = np.float32(2.0 * scene.pitch), np.float32(PAD - 0.5)
    u -= start
    top = top + edge
    near = cv2.remap(scene.atlas, u * half + (start + edge), v * half + top, cv2.INTER_LINEAR)
    half *= np.float32(0.5)
    far = cv2.remap(scene.atlas, u * half + (start + edge), v * half + top, cv2.INTER_LINEAR)
    out = near.astype(np.float32)
    out += (lod - level) * (far - out)
    return out


_HALF = (0.5 ** np.arange(LEVELS)).astype(np.float32)
