"""What happened in a frame, as numbers: features, matches, calibrations."""

from __future__ import annotations

import math
from collections import Counter

from scene_core.filter.records import Trace

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
