"""From matches to verdicts: the chi-square gate.

A match z of a feature predicted at h with innovation covariance S is accepted when
    d2 = nu' S^-1 nu < chi2(dof, confidence),   nu = z - h.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.ports import Match, Query
from scene_core.filter.records import Association, Predictions
from scene_core.filter.world import Label, Mount, World
from scene_core.geometry.ellipses import chi2_gate


def query(
    world: World, mount: str, predictions: Sequence[Predictions], labels: Sequence[Label], warp: Mat
) -> Query:
    """The search request for the selected features, in the order of their selection."""
    where = {label: (p, i) for p in predictions for label, i in p.row.items()}
    found = [where[label] for label in labels]
    m = world.mounts[mount].sensor.measurement_size
    return Query(
        mount=mount,
        labels=tuple(labels),
        h=np.array([p.h[i] for p, i in found]).reshape(-1, m),
        S=np.array([p.E[i] + p.R[i] for p, i in found]).reshape(-1, m, m),
        gate=world.policies.association.search_sigma**2,
        appearance=tuple(world.features[label].appearance for label in labels),
        warp=warp,
        how=world.policies.association.kind,
    )


def squared_distance(nu: Vec, S: Mat) -> float:
    """nu' S^-1 nu, in closed form up to two dimensions."""
    if len(nu) == 1:
        return float(nu[0] * nu[0] / S[0, 0])
    if len(nu) == 2:
        (a, b), (_, d) = S.tolist()
        u, v = nu.tolist()
        return (d * u * u - 2.0 * b * u * v + a * v * v) / (a * d - b * b)
    return float(nu @ np.linalg.solve(S, nu))


def judge(mount: Mount, match: Match, h: Vec, S: Mat, confidence: float) -> Association:
    """The verdict on one searched feature, from its prediction at the time of judging."""
    if match.z is None:
        return Association(
            mount.id, match.label, "no match", h, S, score=match.score,
            runner_up=match.runner_up, why=match.why or "nothing found in the search region",
        )  # fmt: skip
    nu = mount.sensor.nu(h, match.z).nu
    d2 = squared_distance(nu, S)
    dof = len(nu)
    gate = chi2_gate(dof, confidence)
    accepted = d2 < gate
    sign = "<" if accepted else ">"
    return Association(
        mount=mount.id,
        label=match.label,
        verdict="accepted" if accepted else "rejected",
        h=h,
        S=S,
        z=match.z,
        nu=nu,
        d2=d2,
        gate=gate,
        dof=dof,
        confidence=confidence,
        score=match.score,
        runner_up=match.runner_up,
        why=f"d2 = {d2:.1f} {sign} {gate:.2f} ({dof} DoF, {100 * confidence:.4g} %)",
        wrong=is_wrong(match, mount),
    )


def is_wrong(match: Match, mount: Mount) -> bool | None:
    """In simulation: the match lies more than 5 standard deviations of the sensor off the truth."""
    if match.true_z is None or match.z is None:
        return None
    nu = mount.sensor.nu(match.true_z, match.z).nu
    R = mount.sensor.R(match.true_z[None])[0]
    return squared_distance(nu, R) > 25.0
