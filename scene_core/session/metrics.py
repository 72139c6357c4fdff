"""How well the filter does, frame by frame: errors, NEES, NIS, counts and times, as they happen."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.records import Trace
from scene_core.filter.world import Axes, World
from scene_core.geometry.ellipses import chi2_band, nees
from scene_core.geometry.spaces import Space, embed_points
from scene_core.models.base import completed
from scene_core.session.alignment import Alignment, Similarity, aligned_poses, umeyama
from scene_core.session.axes import (
    estimate_axes,
    points_from,
    poses_from,
    poses_told_first,
    truth_axes,
)
from scene_core.session.columns import Column
from scene_core.session.published import Light, RobotSeries, Series

MAX_ROWS = 50_000
"""Frames kept for the plots; beyond, the oldest quarter is forgotten."""
LIGHT_FRAMES = 30
PHASES = ("predict", "internal", "select", "search", "associate", "update", "manage")
COUNTS = (
    "initialised",
    "converted",
    "deleted",
    "accepted",
    "rejected",
    "no_match",
    "wrong",
    "known",
    "gated",
    "d2",
    "dof",
)
"""Per frame; `known` matches are right or wrong for certain, `gated` matches were put to the gate,
`d2` and `dof` are their sums."""
_EVENT_COUNTS = {"born": "initialised", "converted": "converted", "deleted": "deleted"}
_VERDICT_COUNTS = {"accepted": "accepted", "rejected": "rejected", "no match": "no_match"}


@dataclass(frozen=True)
class PoseEstimate:
    """A robot's position state and its covariance on the tangent."""

    xp: Vec
    P: Mat
    """(tangent, tangent)"""


def pose_estimate(world: World, robot: str) -> PoseEstimate:
    """xp of a robot, and J P J' with J = d tangent / d xv."""
    r = world.robots[robot]
    xv, space = world.gauss.mean(r.block), r.motion.space
    xp, dxp_by_dxv = completed(r.motion.xp(xv), r.motion.xp, xv)
    assert dxp_by_dxv is not None
    J = space.tangent_map(xp) @ dxp_by_dxv
    return PoseEstimate(xp, J @ world.gauss.cov(r.block) @ J.T)


def pose_error(space: Space, xp: Vec, true_xp: Vec) -> Vec:
    """Estimate minus truth on the tangent, in the frame in which `pose_estimate` gives P."""
    return -space.difference(true_xp, xp)


class RobotTrack:
    """The columns of one robot. Poses and positions are told in the axes the run began in; errors,
    their standard deviations and NEES are of the axes in force at the time."""

    def __init__(self, space: Space, up: str) -> None:
        t = space.tangent
        self.space, self.up = space, up
        self.xp, self.true_xp = Column(space.n), Column(space.n)
        self.error, self.sd, self.nees = Column(t), Column(t), Column()
        self.position, self.true_position = Column(3), Column(3)
        self.columns = (
            *(self.xp, self.true_xp, self.error, self.sd, self.nees),
            *(self.position, self.true_position),
        )
        self.known = False
        """Whether the truth was known in any frame."""

    def embedded(self, xp: Vec) -> Vec:
        """Positions of poses (..., n) in the world's three axes."""
        return embed_points(np.atleast_2d(self.space.position(xp)), self.space, self.up)

    def add(self, world: World, robot: str, true_xp: Vec | None) -> None:
        at = pose_estimate(world, robot)
        pose = estimate_axes(world.axes)
        xp = poses_told_first(pose, at.xp, self.space, self.up)
        self.xp.append(xp)
        self.position.append(self.embedded(xp)[0])
        self.sd.append(np.sqrt(np.maximum(at.P.diagonal(), 0.0)))
        if true_xp is None or not np.isfinite(true_xp).all():
            for column in (self.true_xp, self.true_position, self.error, self.nees):
                column.append(np.nan)
            return
        self.known = True
        seen = poses_from(truth_axes(world.axes, aligned=False), true_xp, self.space, self.up)
        e = pose_error(self.space, at.xp, seen)
        self.true_xp.append(true_xp)
        self.true_position.append(self.embedded(true_xp)[0])
        self.error.append(e)
        self.nees.append(nees(e, at.P) if np.isfinite(e).all() else math.nan)


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
        for robot, r in world.robots.items():
            if robot not in self.robots:
                self.robots[robot] = RobotTrack(r.motion.space, world.up)
            self.robots[robot].add(world, robot, None if truth is None else truth.xp.get(robot))
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
            robots={name: self._robot_series(track) for name, track in self.robots.items()},
            nis=self.nis.view(self._shown),
            nis_band=self.nis_band.view(self._shown),
            ms={phase: ms[:, i] for i, phase in enumerate(PHASES)},
            landmarks=self.landmarks.view(self._shown),
            calibrations={
                name: (t[:, 0], t[:, 1], t[:, 2] if np.isfinite(t[-1:, 2]).any() else None)
                for name, t in tables.items()
            },
        )

    def _robot_series(self, track: RobotTrack) -> RobotSeries:
        space, known, fit = track.space, track.known, None
        error = track.error.view(self._shown)
        true_position = points_from(
            truth_axes(self.axes, aligned=False), track.true_position.view(self._shown)
        )
        if known and self.align != "none":
            true_position, error, fit = self._aligned(track)
        rotation = ("rx", "ry", "rz") if space.d == 3 else ("phi",) if space.d == 2 else ()
        return RobotSeries(
            labels=space.labels[: space.d] + rotation,
            units=("m",) * space.d + ("rad",) * len(rotation),
            position=points_from(estimate_axes(self.axes), track.position.view(self._shown)),
            true_position=true_position if known else None,
            error=error if known else None,
            sd=track.sd.view(self._shown),
            nees=track.nees.view(self._shown) if known and self.align == "none" else None,
            nees_dof=space.tangent,
            nees_band=chi2_band(space.tangent),
            alignment=fit,
        )

    def _aligned(self, track: RobotTrack) -> tuple[Vec, Vec, Similarity | None]:
        """The truth moved into the estimate's axes (at most 500 frames decide how), errors, how
        in the axes the run began in."""
        xp, true_xp = track.xp.view(self._shown), track.true_xp.view(self._shown)
        step = max(1, len(xp) // 500)
        fit = umeyama(track.space, true_xp[::step], xp[::step], self.align)
        if fit is None:
            unknown = np.full_like(track.error.view(self._shown), np.nan)
            pose = truth_axes(self.axes, aligned=False)
            return points_from(pose, track.true_position.view(self._shown)), unknown, None
        moved = aligned_poses(track.space, fit, true_xp)
        pose = estimate_axes(self.axes)
        seen, true = (poses_from(pose, x, track.space, track.up) for x in (xp, moved))
        at = points_from(pose, track.embedded(moved))
        return at, -track.space.difference(true, seen), fit

    def light(self) -> Light:
        """Whether the errors are as large as the filter says: the mean NEES of the last frames,
        or without truth their NIS, against the 95 % interval of one value."""
        for track in self.robots.values():
            recent = track.nees.view(self._shown)[-LIGHT_FRAMES:]
            if self.align == "none" and np.isfinite(recent).any():
                dof = track.space.tangent
                return _light("NEES", float(np.nanmean(recent)), chi2_band(dof), f"{dof} DoF")
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
    text = f"{what} {value:.2f} in {lo:.2f} to {hi:.2f} ({of})"
    if value > hi:
        return Light("overconfident", text.replace(" in ", " above "))
    if value < lo:
        return Light("cautious", text.replace(" in ", " below "))
    return Light("consistent", text)


def count(trace: Trace) -> Counter[str]:
    """What happened in a frame, by the names in COUNTS."""
    out: Counter[str] = Counter()
    for record in trace.records:
        for event in record.events:
            if event.kind in _EVENT_COUNTS:
                out[_EVENT_COUNTS[event.kind]] += 1
    for a in trace.associations():
        if a.verdict in _VERDICT_COUNTS:
            out[_VERDICT_COUNTS[a.verdict]] += 1
        out["wrong"] += bool(a.wrong)
        out["known"] += a.wrong is not None
        if a.d2 is not None and a.verdict in ("accepted", "rejected"):
            out["gated"] += 1
            out["d2"] += a.d2  # type: ignore[assignment]
            out["dof"] += a.dof
    return out


def calibrations(trace: Trace) -> dict[str, tuple[float, float, float]]:
    """Mean, sd and true value (NaN: unknown) of every estimated calibration component."""
    world, truth = trace.world, trace.frame.truth
    labels = {r.calib_block: r.motion.calib_labels for r in world.robots.values()}
    labels |= {m.calib_block: m.sensor.calib_labels for m in world.mounts.values()}
    labels |= {m.pose_block: m.sensor.space.labels for m in world.mounts.values()}
    out = {}
    for block in world.gauss.layout.blocks:
        if block.name in labels:
            mean, variance = world.gauss.mean(block.name), world.gauss.cov(block.name).diagonal()
            true = truth.labels.get(block.name, {}) if truth is not None else {}
            for i, label in enumerate(labels[block.name]):
                sd = math.sqrt(max(0.0, float(variance[i])))
                out[f"{block.name} {label}"] = (float(mean[i]), sd, true.get(label, math.nan))
    return out
