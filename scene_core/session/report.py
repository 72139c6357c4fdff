"""The figures of a whole run: what `scene run --json` writes."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry.ellipses import chi2_band
from scene_core.session.alignment import aligned_poses, umeyama
from scene_core.session.counting import COUNTS
from scene_core.session.metrics import PHASES, Metrics
from scene_core.session.session import Session
from scene_core.session.tracks import RobotTrack, pose_error


def report(session: Session, seconds: float, first: int = 0) -> dict[str, Any]:
    """All figures by their names; what has no truth is None.

    Errors, NEES and NIS leave frames before `first` out; counts and times are over the whole run.
    With several robots the errors are those of the first. NEES is of (position, rotation vector)
    and needs a truth in the estimate's own axes, so an aligned run has none. `nees_band` and
    `nis_band` are the 95 % intervals of one value, not of the run's mean: neighbouring values of
    NEES are not independent. `nis_mean` is the mean d2 of the matches that were put to the gate.
    """
    metrics, trace = session.metrics, session.trace
    totals, ms = metrics.totals(), metrics.series().ms
    frames = len(metrics)
    track = next(iter(metrics.robots.values()), None)
    return {
        "preset": session.experiment.name,
        "seed": session.experiment.seed,
        "frames": frames,
        "fps_mean": _number(frames / seconds if seconds > 0 else None),
        "ms_per_phase": {phase: _number(np.median(ms[phase])) for phase in PHASES if frames},
        "landmarks": len(trace.world.features) if trace else 0,
        **{n: totals[n] for n in ("initialised", "converted", "deleted", "accepted", "rejected")},
        "align": metrics.align,
        **(_errors(metrics, track, first) if track else _errors_unknown()),
        **_nis(metrics, first),
        "state": _state(session),
    }


def _errors_unknown() -> dict[str, Any]:
    names = ("pos_rmse_m", "ori_rmse_deg", "pos_end_m", "nees_mean", "nees_dof", "nees_band")
    return dict.fromkeys(names)


def _errors(metrics: Metrics, track: RobotTrack, first: int) -> dict[str, Any]:
    rows = slice(max(0, first - metrics.first), len(metrics))
    xp, true_xp = track.xp.view(len(metrics))[rows], track.true_xp.view(len(metrics))[rows]
    known = np.all(np.isfinite(true_xp), axis=1)
    fit = umeyama(track.space, xp, true_xp, metrics.align)
    error = track.error.view(len(metrics))[rows]
    if metrics.align == "none":
        known = np.all(np.isfinite(error), axis=1)
    if fit is None or not known.any():
        return _errors_unknown()
    error = error[known]
    if metrics.align != "none":
        error = pose_error(track.space, aligned_poses(track.space, fit, xp[known]), true_xp[known])
    d = track.space.d
    position = np.linalg.norm(error[:, :d], axis=1)
    turn = np.linalg.norm(error[:, d:], axis=1) if track.space.tangent > d else None
    nees = track.nees.view(len(metrics))[rows]
    nees = nees[np.isfinite(nees)]
    has_nees = metrics.align == "none" and len(nees) > 0
    return {
        "pos_rmse_m": _rms(position),
        "ori_rmse_deg": None if turn is None else _number(math.degrees(_rms(turn) or 0.0)),
        "pos_end_m": _number(position[-1]) if known[-1] else None,
        "nees_mean": _number(nees.mean()) if has_nees else None,
        "nees_dof": track.space.tangent if has_nees else None,
        "nees_band": list(chi2_band(track.space.tangent)) if has_nees else None,
    }


def _nis(metrics: Metrics, first: int) -> dict[str, Any]:
    counts = metrics.counts.view(len(metrics))[max(0, first - metrics.first) :]
    gated, d2, dof = (float(counts[:, COUNTS.index(name)].sum()) for name in ("gated", "d2", "dof"))
    if not gated:
        return {"nis_mean": None, "nis_dof": None, "nis_band": None}
    mean_dof = dof / gated
    return {
        "nis_mean": _number(d2 / gated),
        "nis_dof": int(mean_dof) if mean_dof == int(mean_dof) else mean_dof,
        "nis_band": list(chi2_band(mean_dof)),
    }


def _state(session: Session) -> dict[str, list[float]]:
    """Mean and sd of every component of robots, sensor poses and calibrations. A label that occurs
    twice is preceded by the name of its robot or sensor."""
    world = session.world
    labels = {r.block: r.motion.state_labels for r in world.robots.values()}
    labels |= {r.calib_block: r.motion.calib_labels for r in world.robots.values()}
    labels |= {m.pose_block: m.sensor.space.labels for m in world.mounts.values()}
    labels |= {m.calib_block: m.sensor.calib_labels for m in world.mounts.values()}
    blocks = [b.name for b in world.gauss.layout.blocks if b.name in labels]
    seen = Counter(label for block in blocks for label in labels[block])
    out: dict[str, list[float]] = {}
    for block in blocks:
        mean, variance = world.gauss.mean(block), world.gauss.cov(block).diagonal()
        for i, label in enumerate(labels[block]):
            name = label if seen[label] == 1 else f"{block.split(':')[1]} {label}"
            out[name] = [float(mean[i]), math.sqrt(max(0.0, float(variance[i])))]
    return out


def _rms(values: Vec) -> float | None:
    return _number(np.sqrt(np.mean(values**2))) if len(values) else None


def _number(value: Any) -> float | None:
    """A finite float, or None."""
    return float(value) if value is not None and math.isfinite(value) else None


def summary(figures: dict[str, Any], totals: dict[str, int]) -> str:
    """The figures for somebody who reads them."""

    def shown(name: str, unit: str, digits: int = 4) -> str:
        value = figures[name]
        return "unknown" if value is None else f"{value:.{digits}g} {unit}".rstrip()

    def banded(name: str) -> str:
        if figures[f"{name}_mean"] is None:
            return "unknown"
        lo, hi = figures[f"{name}_band"]
        dof = figures[f"{name}_dof"]
        return f"{figures[f'{name}_mean']:.2f} ({dof:g} DoF, 95 % of values {lo:.2f} to {hi:.2f})"

    phases = ", ".join(f"{p} {ms:.2f}" for p, ms in figures["ms_per_phase"].items())
    rows = [
        ("frames", f"{figures['frames']} at {shown('fps_mean', 'frames/s', 3)}"),
        ("ms per phase", phases),
        (
            "features",
            f"{figures['landmarks']} in the map; {figures['initialised']} started, "
            f"{figures['converted']} converted, {figures['deleted']} deleted",
        ),
        (
            "matches",
            f"{figures['accepted']} accepted, {figures['rejected']} rejected, "
            f"{totals['no_match']} not found"
            + (f", {totals['wrong']} wrong" if totals["known"] else ""),
        ),
        ("alignment", figures["align"]),
        ("position", f"rmse {shown('pos_rmse_m', 'm')}, at the end {shown('pos_end_m', 'm')}"),
        ("orientation", f"rmse {shown('ori_rmse_deg', 'deg')}"),
        ("NEES", banded("nees")),
        ("NIS", banded("nis")),
    ]
    head = f"{figures['preset']}, seed {figures['seed']}"
    return "\n".join([head, *(f"  {name:<13}{text}" for name, text in rows)])
