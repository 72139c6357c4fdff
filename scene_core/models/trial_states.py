"""Random and awkward states that models are tried at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry.spaces import Space
from scene_core.models.judge import COUNT, angles_of
from scene_core.models.labels import quaternions


def sample_state(
    labels: Sequence[str], units: Sequence[str], rng: np.random.Generator, spread: float = 1.0
) -> Vec:
    """A random state: unit quaternion, angles anywhere, the rest of order `spread`."""
    x = spread * rng.standard_normal(len(labels))
    circle = angles_of(units)
    x[circle] = rng.uniform(-np.pi, np.pi, circle.sum())
    return with_unit_quaternion(labels, x)


def with_unit_quaternion(labels: Sequence[str], x: Vec) -> Vec:
    """x with every quaternion it has (qw qx qy qz, with or without a prefix) on the unit sphere."""
    for at in quaternions(labels).values():
        x[at] = x[at] / np.linalg.norm(x[at]) if x[at].any() else (1.0, 0.0, 0.0, 0.0)
    return x


def awkward_states(
    labels: Sequence[str], units: Sequence[str], rng: np.random.Generator
) -> list[Vec]:
    """Random states and the usual traps: all zero (at rest), the other cover of a quaternion, half
    a turn, headings at the seam, slow rotation."""
    states = [sample_state(labels, units, rng) for _ in range(4)]
    states.append(with_unit_quaternion(labels, np.zeros(len(labels))))
    rows = list(quaternions(labels).values())
    for flip in ([-1.0, -1.0, -1.0, -1.0], [1e-9, 1.0, 1.0, 1.0]):
        if rows:
            x = sample_state(labels, units, rng)
            x[np.array(rows)] *= flip
            states.append(with_unit_quaternion(labels, x))
    slow = sample_state(labels, units, rng)
    slow[[i for i, unit in enumerate(units) if unit == "rad/s"]] *= 1e-9
    seam = sample_state(labels, units, rng)
    seam[angles_of(units)] = np.pi
    return [*states, slow, seam]


def sample_pose(space: Space, rng: np.random.Generator) -> Vec:
    """A random position state."""
    return sample_state(space.labels, space.units, rng)


def sample_rays(space: Space, rng: np.random.Generator) -> Vec:
    """Random points X (COUNT, d+1) in a sensor's frame: unit rays, w from 0.2 to 1.5 1/m."""
    X = rng.standard_normal((COUNT, space.d + 1))
    X[:, :-1] /= np.linalg.norm(X[:, :-1], axis=-1, keepdims=True)
    X[:, -1] = rng.uniform(0.2, 1.5, COUNT)
    return X
