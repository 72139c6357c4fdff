"""From matches to verdicts: the chi-square gate.

A match z of a feature predicted at h with innovation covariance S is accepted when
    d2 = nu' S^-1 nu < chi2(dof, confidence),   nu = z - h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.groups import Group, groups
from scene_core.filter.observe import (
    Residual,
    SensorState,
    innovation_covariance,
    observe,
    residual,
    sensor_state,
)
from scene_core.filter.particles import nearest
from scene_core.filter.ports import Match, Query
from scene_core.filter.records import Association, Predictions
from scene_core.filter.world import Label, Mount, World
from scene_core.geometry.ellipses import chi2_gate
from scene_core.models import segments


def queries(
    world: World, mount: str, predictions: Sequence[Predictions], labels: Sequence[Label]
) -> list[Query]:
    """The search requests for the selected features, in the order of their selection; points and
    segments are asked for apart. Segments are told by their identities."""
    where = {label: (p, i) for p in predictions for label, i in p.row.items()}
    how = world.policies.association.kind
    out = []
    points = [label for label in labels if where[label][0].shape == "point"]
    if points:
        h = np.array([where[label][0].h[where[label][1]] for label in points])
        S = np.array([where[label][0].S[where[label][1]] for label in points])
        out.append(_query(world, mount, points, h, S, how))
    lines = [label for label in labels if where[label][0].shape == "segment"]
    if lines:
        ends = [(where[label][0].ends, where[label][1]) for label in lines]
        h = np.array([each[i] for each, i in ends if each is not None])
        S = np.broadcast_to(np.eye(h.shape[1]), (len(lines), h.shape[1], h.shape[1]))
        request = _query(world, mount, lines, h, S, "identity")
        out.append(replace(request, shape="segment"))
    return out


def _query(
    world: World,
    mount: str,
    labels: Sequence[Label],
    h: Vec,
    S: Mat,
    how: Literal["identity", "search"],
) -> Query:
    m = h.shape[1]
    return Query(
        mount=mount,
        labels=tuple(labels),
        h=h,
        S=S,
        gate=world.policies.association.search_sigma**2,
        appearance=tuple(world.features[label].appearance for label in labels),
        warp=np.broadcast_to(np.eye(m), (len(labels), m, m)),
        how=how,
    )


def judged(
    world: World, mount_id: str, predictions: Sequence[Predictions], matches: Sequence[Match]
) -> tuple[Association, ...]:
    """The verdict on every match, by its own gate."""
    where = {label: (p, i) for p in predictions for label, i in p.row.items()}
    mount, confidence = world.mounts[mount_id], world.policies.gate.confidence
    ends = [m for m in matches if m.z is not None and where[m.label][0].shape == "segment"]
    lines = line_innovations(world, mount_id, ends)
    open_ = [m for m in matches if m.z is not None and where[m.label][0].particles is not None]
    closest = nearest(world, mount_id, open_)
    out = []
    for match in matches:
        p, i = where[match.label]
        S = p.S[i] if match.R is None or p.shape == "segment" else p.E[i] + match.R
        if match.z is None:
            verdict = unmatched(mount, match, p.h[i], S)
        elif p.shape == "segment":
            verdict = judge(mount, match, p.h[i], *lines[match.label], confidence)
        else:
            nu = mount.sensor.nu(p.h[i], match.z).nu
            verdict = judge(mount, match, p.h[i], nu, S, confidence, closest.get(match.label))
        out.append(verdict)
    return tuple(out)


def line_innovations(
    world: World, mount: str, matches: Sequence[Match]
) -> dict[Label, tuple[Vec, Mat]]:
    """nu (2,) and S (2, 2) of measured segments against their lines, those of a model at once."""
    if not matches:
        return {}
    at, found = sensor_state(world, mount), {m.label: m for m in matches}
    out: dict[Label, tuple[Vec, Mat]] = {}
    for group in groups(world, list(found)):
        _, seen = against(at, group, world.gauss.x, [found[label] for label in group.labels])
        S = innovation_covariance(world.gauss.P, seen.rows) + seen.R
        out |= {label: (seen.nu[i], S[i]) for i, label in enumerate(group.labels)}
    return out


def against(
    at: SensorState, group: Group, x: Vec, matches: Sequence[Match]
) -> tuple[Vec, Residual]:
    """What x expects of a group, and the matches against it; a measurement's own covariance goes
    before the sensor's."""
    seen = observe(at, group, x)
    z = np.array([match.z for match in matches])
    R = None
    if any(match.R is not None for match in matches):
        sensor = at.mount.sensor
        R = sensor.R(seen.h) if group.model.shape == "point" else segments.noise(sensor, z)
        R = np.array(R)
        for i, match in enumerate(matches):
            if match.R is not None:
                R[i] = match.R
    return seen.h, residual(at, seen, z, R)


def squared_distance(nu: Vec, S: Mat) -> float:
    """nu' S^-1 nu, in closed form up to two dimensions."""
    if len(nu) == 1:
        return float(nu[0] * nu[0] / S[0, 0])
    if len(nu) == 2:
        (a, b), (_, d) = S.tolist()
        u, v = nu.tolist()
        return (d * u * u - 2.0 * b * u * v + a * v * v) / (a * d - b * b)
    return float(nu @ np.linalg.solve(S, nu))


def unmatched(mount: Mount, match: Match, h: Vec, S: Mat) -> Association:
    """The verdict on a feature that was searched and not found."""
    return Association(
        mount.id, match.label, "no match", h, S, score=match.score,
        runner_up=match.runner_up, why=match.why or "nothing found in the search region",
    )  # fmt: skip


def judge(
    mount: Mount,
    match: Match,
    h: Vec,
    nu: Vec,
    S: Mat,
    confidence: float,
    d2: float | None = None,
) -> Association:
    """The verdict on a match with the innovation nu, at the time of judging.

    d2: given for a partial feature, where it is the smallest of all particles.
    """
    of_particle = d2 is not None
    d2 = squared_distance(nu, S) if d2 is None else d2
    dof = len(nu)
    gate = chi2_gate(dof, confidence)
    accepted = d2 < gate
    sign = "<" if accepted else ">"
    whose = " of the nearest particle" if of_particle else ""
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
        why=f"d2{whose} = {d2:.1f} {sign} {gate:.2f} ({dof} DoF, {100 * confidence:.4g} %)",
        wrong=is_wrong(match, mount),
    )


def is_wrong(match: Match, mount: Mount) -> bool | None:
    """In simulation: the match lies more than 5 standard deviations of the sensor off the truth.
    None where nobody knows: a recording, or a segment, whose ends have no true place."""
    if match.true_z is None or match.z is None or match.z.size != mount.sensor.measurement_size:
        return None
    nu = mount.sensor.nu(match.true_z, match.z).nu
    R = mount.sensor.R(match.true_z[None])[0]
    return squared_distance(nu, R) > 25.0
