"""What a simulated sensor delivers in a world of points: measurements that say whose they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from scene_core.arrays import Vec, frozen
from scene_core.filter.ports import Points, SourceError
from scene_core.models.base import Fault, Sensor
from scene_core.sources import noise
from scene_core.sources.truth import Disturbances, with_outliers
from scene_core.sources.worlds import SimulatedWorld, in_axes, landmarks


@dataclass(frozen=True)
class Outlook:
    """A sensor at its true place, and the landmarks as it would see them without noise."""

    world: SimulatedWorld
    up: str
    sensor: Sensor
    calib: Vec
    """True calibration."""
    pose: Vec
    """True pose x_WS, in the sensor's space."""
    markers: Mapping[int, Vec] = field(default_factory=dict)
    """Places (d,) in the world, in the sensor's space, of markers on other robots by identity."""

    @cached_property
    def ids(self) -> np.ndarray:
        """Identities (K,): of the landmarks, then of the markers."""
        ids = landmarks(self.world)[0]
        return np.concatenate([ids, np.array(list(self.markers), dtype=int)])

    @cached_property
    def X_W(self) -> Vec:
        """All landmarks and markers as homogeneous points (K, d+1) of the world."""
        space, own, at = self.sensor.space, self.world.space, landmarks(self.world)[1]
        if own is not space and space.d < 3:
            raise SourceError(
                f"the world '{self.world.name}' is {own.name} and can not be seen by a "
                f"{space.name} sensor: choose a {own.name} sensor"
            )
        if space.d == 3:
            at = in_axes(self.world, at, self.up)
        at = np.concatenate([at, *(place[None] for place in self.markers.values())])
        return np.concatenate([at, np.ones((len(at), 1))], axis=1)

    @cached_property
    def X_S(self) -> Vec:
        """The same in the frame of the sensor."""
        return self.sensor.space.to_local(self.pose, self.X_W).X

    @cached_property
    def h(self) -> Vec:
        """Measurements (K, m) without noise; meaningless or not finite where `fault` is set."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return self.sensor.project(self.X_S, self.calib).h

    @cached_property
    def fault(self) -> np.ndarray:
        """Why a landmark can not be measured (K,); zero where it can. Limits that refer to a first
        view do not apply: the truth has none."""
        here = np.broadcast_to(self.pose, (len(self.X_S), len(self.pose)))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            fault = self.sensor.visibility(self.h, self.X_S, self.pose, here, self.X_W)
        return np.where(np.isfinite(self.h).all(axis=1), fault, int(Fault.BEHIND))

    def measured(self, wrong: Disturbances, key: tuple[int, str, int]) -> Points:
        """Noisy measurements with identities; key: seed, mount and frame.

        A landmark's misses and outliers are keyed by its place in the world, so they do not depend
        on which others are seen.
        """
        seed, mount, index = key
        there = np.flatnonzero(self.fault == 0)
        if wrong.misses > 0.0:
            found = noise.rng(seed, f"misses:{mount}", index).random(len(self.ids))
            there = there[found[there] >= wrong.misses]
        if len(there) == 0:
            return Points(np.zeros((0, self.sensor.measurement_size)), np.zeros(0, dtype=int))
        rng = noise.rng(seed, f"measurements:{mount}", index)
        z = self.sensor.h_noisy(self.X_S[there], self.calib, rng)
        if wrong.outliers > 0.0:
            h, rng = self.h[there], noise.rng(seed, f"outliers:{mount}", index)
            R = np.broadcast_to(self.sensor.R(h), (*h.shape, h.shape[1]))
            z = with_outliers(z, h, R, there, len(self.ids), wrong, rng)
        z = self.sensor.nu(np.zeros_like(z), z).nu
        low, high = np.array(self.sensor.limits).T
        inside = ((z >= low) & (z <= high)).all(axis=1)
        ids = self.ids[there][inside]
        ids.flags.writeable = False
        return Points(frozen(z[inside]), ids)
