"""How well the filter does, frame by frame: errors, NEES, NIS, counts and times, as they happen."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from scene_core.filter.ports import Truth
from scene_core.filter.records import Trace
from scene_core.filter.world import Axes, World
from scene_core.geometry.ellipses import chi2_band
from scene_core.session.alignment import Alignment
from scene_core.session.columns import Column
from scene_core.session.counting import COUNTS, calibrations, count
from scene_core.session.published import Light, Series
from scene_core.session.tracks import RobotTrack, body_name

MAX_ROWS = 50_000
"""Frames kept for the plots; beyond, the oldest quarter is forgotten."""
LIGHT_FRAMES = 30
WORSE = ("consistent", "cautious", "overconfident")
"""The later the worse."""
PHASES = ("predict", "internal", "select", "search", "associate", "update", "manage")


class Metrics:
    """The tables of one run. One row per frame; stepping back cuts them off."""

    def __init__(self, align: Alignment = "none") -> None:
        self.align: Alignment = align
        self.first = 0
        """Frame of the first kept row."""
        self.times, self.landmarks, self.source_ms = Column(), Column(), Column()
        self.counts, self.ms = Column(len(COUNTS)), Column(len(PHASES))
        self.nis, self.nis_band = Column(), Column(2)
        self.robots: dict[str, RobotTrack] = {}
        self.calibrations: dict[str, Column] = {}
        self._axes: list[tuple[int, Axes]] = []
        """New axes, and the frame they came into force at the end of."""
        self._shown = 0
        self._series: Series | None = None

    def __len__(self) -> int:
        """Rows up to the present frame."""
        return self._shown

    def show(self, frame: int) -> None:
        """Show the rows up to the end of a frame; later ones are kept for seeking forward."""
        self._series = None
        self._shown = min(max(0, frame + 1 - self.first), len(self.times))

    @property
    def axes(self) -> Axes | None:
        """In force in the last row that is shown."""
        last = self.first + self._shown - 1
        return next((axes for frame, axes in reversed(self._axes) if frame <= last), None)

    def _columns(self) -> list[Column]:
        tracks = [c for r in self.robots.values() for c in r.columns]
        own = [
            self.times,
            self.landmarks,
            self.source_ms,
            self.counts,
            self.ms,
            self.nis,
            self.nis_band,
        ]
        return own + tracks + list(self.calibrations.values())

    def add(self, trace: Trace, source_ms: float = 0.0) -> None:
        """A complete frame, and how long its input took; one that is in the books already comes
        out the same and is only shown."""
        world, truth, row = trace.world, trace.frame.truth, len(self.times)
        for column in self._columns():
            column.truncate(row)  # what a model that raised half-way may have left
        if trace.frame.index < self.first + row:
            self.show(trace.frame.index)
            return
        axes = self._axes[-1][1] if self._axes else None
        if world.axes is not None and world.axes is not axes:
            self._axes.append((trace.frame.index, world.axes))
        self._add_robots(world, truth, row)
        self._add_calibrations(trace, row)
        counts = count(trace)
        self.counts.append(np.array([counts[name] for name in COUNTS]))
        dof = counts["dof"]
        band = chi2_band(dof) if dof else (math.nan, math.nan)
        self.nis.append(counts["d2"] / dof if dof else math.nan)
        self.nis_band.append(np.array(band) / (dof or 1.0))
        spent = dict.fromkeys(PHASES, 0.0)
        for record in trace.records:
            spent[record.phase] += record.ms
        self.ms.append(np.array(list(spent.values())))
        self.source_ms.append(source_ms)
        self.landmarks.append(float(len(world.features)))
        self.times.append(world.time)
        if len(self.times) > MAX_ROWS:
            self._forget_oldest(MAX_ROWS // 4)
        self.show(trace.frame.index)

    def _add_robots(self, world: World, truth: Truth | None, row: int) -> None:
        """A swap of models may bring bodies and take them away."""
        for robot, r in world.robots.items():
            for body in r.motion.bodies:
                name = body_name(robot, body)
                if name not in self.robots:
                    self.robots[name] = RobotTrack(r.motion.space, world.up, robot, body)
                    self.robots[name].pad(row)
                self.robots[name].add(world, None if truth is None else truth.at(robot, body))
        for track in self.robots.values():
            track.pad(row + 1)

    def _add_calibrations(self, trace: Trace, row: int) -> None:
        for name, (mean, sd, true) in calibrations(trace).items():
            if name not in self.calibrations:
                self.calibrations[name] = Column(3)
                self.calibrations[name].pad(row)
            self.calibrations[name].append(np.array([mean, sd, true]))
        for column in self.calibrations.values():
            column.pad(row + 1)

    def truncate(self, frame: int) -> None:
        """Forget the rows after the end of `frame`."""
        for column in self._columns():
            column.truncate(max(0, frame + 1 - self.first))
        # What was there in no frame that is left comes from an edit that is void now.
        self.robots = {n: track for n, track in self.robots.items() if track.xp.any_row()}
        self.calibrations = {n: c for n, c in self.calibrations.items() if c.any_row()}
        self._axes = [entry for entry in self._axes if entry[0] <= frame]
        self.show(frame)

    def _forget_oldest(self, count: int) -> None:
        self.first += count
        for column in self._columns():
            column.drop_first(count)

    def totals(self) -> dict[str, int]:
        """Sums of the counts over the kept frames."""
        sums = self.counts.view(self._shown).sum(axis=0)
        return {n: int(s) for n, s in zip(COUNTS, sums, strict=True) if n not in ("d2", "dof")}

    def series(self) -> Series:
        """What the plots show; built once per frame from views."""
        if self._series is None:
            self._series = self._build_series()
        return self._series

    def _build_series(self) -> Series:
        ms = self.ms.view(self._shown)
        tables = {name: column.view(self._shown) for name, column in self.calibrations.items()}
        return Series(
            frames=np.arange(self.first, self.first + self._shown, dtype=np.float64),
            times=self.times.view(self._shown),
            robots={
                name: track.series(self._shown, self.axes, self.align)
                for name, track in self.robots.items()
                if track.is_there(self._shown)
            },
            nis=self.nis.view(self._shown),
            nis_band=self.nis_band.view(self._shown),
            ms={phase: ms[:, i] for i, phase in enumerate(PHASES)},
            landmarks=self.landmarks.view(self._shown),
            calibrations={
                name: (t[:, 0], t[:, 1], t[:, 2] if np.isfinite(t[-1:, 2]).any() else None)
                for name, t in tables.items()
            },
        )

    def light(self) -> Light:
        """Whether the errors are as large as the filter says: the mean NEES of the last frames,
        or without truth their NIS, against the 95 % interval of one value. Of several robots that
        of the first which is least so."""
        lights = list(self._nees_lights())
        if lights:
            return max(lights, key=lambda light: WORSE.index(light.state))
        return self._nis_light()

    def _nees_lights(self) -> Iterator[Light]:
        """One for every body whose truth was known lately."""
        there = {name: r for name, r in self.robots.items() if r.is_there(self._shown)}
        for name, track in there.items():
            recent = track.nees.view(self._shown)[-LIGHT_FRAMES:]
            if self.align == "none" and np.isfinite(recent).any():
                dof = track.space.tangent
                what = f"NEES of {name}" if len(there) > 1 else "NEES"
                yield _light(what, float(np.nanmean(recent)), chi2_band(dof), f"{dof} DoF")

    def _nis_light(self) -> Light:
        counts = self.counts.view(self._shown)[-LIGHT_FRAMES:]
        frames = counts[counts[:, COUNTS.index("dof")] > 0]
        if not len(frames):
            return Light("unknown", "nothing was measured yet")
        dof = frames[:, COUNTS.index("dof")]
        mean_dof = float(dof.mean())
        lo, hi = chi2_band(round(mean_dof))
        value = float((frames[:, COUNTS.index("d2")] / dof).mean())
        return _light("NIS", value, (lo / mean_dof, hi / mean_dof), "per DoF")


def _light(what: str, value: float, band: tuple[float, float], of: str) -> Light:
    lo, hi = band
    state, lies = ("overconfident", "above") if value > hi else ("consistent", "in")
    if value < lo:
        state, lies = "cautious", "below"
    return Light(state, f"{what} {value:.2f} {lies} {lo:.2f} to {hi:.2f} ({of})")
