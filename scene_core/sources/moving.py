"""How a true robot moves over one interval, and what is reported of its controls."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.sources import noise
from scene_core.sources.truth import TrueRobot


class Moved(NamedTuple):
    """A true robot after an interval."""

    xv: Vec
    u: Vec
    """The controls as they are reported."""
    memory: Any
    """What its driver remembers."""


def moved(
    robot: TrueRobot, name: str, xv: Vec, memory: Any, index: int, dt: float, seed: int
) -> Moved:
    """The robot of this name as its driver lets it move over the interval dt before frame `index`:
    with noise in the motion, or in what is reported of the controls (`noise_on`)."""
    motion, k = robot.motion, robot.true_calib(name, seed)
    drive = robot.driver.drive(motion, xv, memory, index, dt, seed)
    u = drive.u
    if drive.push is not None:
        after = motion.f(xv + drive.push, u, dt, k).fv
    elif robot.noise_on == "controls":
        after = motion.f(xv, u, dt, k).fv
        rng = noise.rng(seed, f"controls:{name}", index)
        u = u + _factor(motion.U(u, dt)) @ rng.standard_normal(len(u))
    else:
        after = motion.f_noisy(xv, u, dt, k, noise.rng(seed, f"motion:{name}", index))
    return Moved(after, u, drive.memory)


def _factor(P: Mat) -> Mat:
    """L with L L' = P for a positive semidefinite P."""
    values, vectors = np.linalg.eigh(P)
    return vectors * np.sqrt(np.maximum(values, 0.0))
