"""Directions of the world that models rely on, and what new axes would make of them."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.world import World
from scene_core.geometry import quaternion
from scene_core.geometry.embedding import embed, embed_points, flatten
from scene_core.geometry.spaces import ONE_D, THREE_D, Space

ANY = "any direction"
TOLD = ("gravity", "north", "plane", ANY)
"""What `Axes.lost` may hold; a word of a user's own model counts as any direction."""
EXACT = 1e-9
"""In rad and m: a direction that changes by less has not changed."""


def deviation(word: str, pose: Vec, P: Mat, up: str) -> str:
    """What becomes of a direction of the world in axes at `pose` (7,), known with covariance P
    (7, 7): a sentence, or nothing when it stays exactly what it is.

    A direction that is only likely to stay has changed too: measuring it in the new axes would tell
    more than anybody knows.
    """
    # The line's z points north in either kind of axes: along the world's z, resp. x.
    ahead, above = embed_points(np.ones(1), ONE_D, up), np.eye(3)["xyz".index(up)]
    if word in ("gravity", "plane"):
        change = _turned(above, pose, P, "the up axis would tilt")
        return change or (_lifted(above, pose, P) if word == "plane" else "")
    change = _turned(ahead, pose, P, "its direction would turn")
    return change if word == "north" else change or _turned(above, pose, P, "it would tilt")


def _turned(axis: Vec, pose: Vec, P: Mat, what: str) -> str:
    seen = quaternion.rotate_back(pose[3:], axis)
    away = float(np.linalg.norm(np.cross(seen.v, axis)))
    angle = float(np.arctan2(away, seen.v @ axis))
    if angle > EXACT:
        return f"{what} by {np.degrees(angle):.3g} deg"
    sd = float(np.sqrt(max(np.trace(seen.by_q @ P[3:, 3:] @ seen.by_q.T), 0.0)))
    return f"{what} by 0 ± {np.degrees(sd):.2g} deg" if sd > EXACT else ""


def _lifted(axis: Vec, pose: Vec, P: Mat) -> str:
    shift, sd = float(axis @ pose[:3]), float(np.sqrt(max(axis @ P[:3, :3] @ axis, 0.0)))
    if abs(shift) <= EXACT and sd <= EXACT:
        return ""
    return f"its height would change by {shift:.3g} ± {sd:.2g} m"


def not_flat(space: Space, pose: Vec, P: Mat, up: str) -> str:
    """How axes at `pose` (7,) would stand out of a space of fewer dimensions; empty: not."""
    flat, by_pose = flatten(pose, space, up)
    back, by_flat = embed(flat, space, up)
    out = THREE_D.difference(pose, back)
    J = THREE_D.tangent_map(pose) @ (np.eye(7) - by_flat @ by_pose)
    sds = np.sqrt(np.maximum((J @ P @ J.T).diagonal(), 0.0))
    for rows, what, scale, unit in (
        (slice(3, 6), "tilt", np.degrees(1.0), "deg"),
        (slice(0, 3), "leave it", 1.0, "m"),
    ):
        most, sd = np.abs(out[rows]).max() * scale, sds[rows].max() * scale
        if max(most, sd) > EXACT * scale:
            return f"the new axes would {what} by {most:.3g} ± {sd:.2g} {unit}"
    return ""


def lost(world: World, word: str) -> bool:
    """Whether a direction of the world is no longer where it was in the axes the run began in."""
    return world.axes is not None and (word if word in TOLD else ANY) in world.axes.lost
