"""Measurements that are points: whose they are, by identity or by the nearest prediction."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.ports import Detection, Match, Occupied, Points, Query

Limits = tuple[tuple[float, float], ...]


Innovation = Callable[[Vec, Vec], Vec]
"""nu(h, z), batched: a sensor knows which of its coordinates are angles."""


def plain(h: Vec, z: Vec) -> Vec:
    """z - h: the innovation of a sensor without angles."""
    return z - h


def match_points(points: Points, query: Query, nu: Innovation = plain) -> list[Match]:
    """One match per queried label, as the query asks: by identity or by the nearest in the gate."""
    if query.how == "identity":
        return match_identities(points, query)
    return match_nearest(points, query, nu)


def match_identities(points: Points, query: Query) -> list[Match]:
    """One match per queried label: the measurement that carries the landmark's identity.

    points.z (K, m) with points.ids (K,); query.appearance holds an identity per label. Where an
    identity occurs twice in a frame, its first measurement is taken.
    """
    if points.ids is None:
        return [_none(query, i, "the sensor sends no identities") for i in range(len(query.labels))]
    row: dict[int, int] = {}
    for k, identity in enumerate(points.ids):
        row.setdefault(int(identity), k)
    out = []
    for i, identity in enumerate(query.appearance):
        k = row.get(int(identity)) if identity is not None else None
        if k is None:
            out.append(_none(query, i, f"landmark {identity} was not measured in this frame"))
        else:
            out.append(_match(points, query, i, k, positions=1))
    return out


def match_nearest(points: Points, query: Query, nu: Innovation = plain) -> list[Match]:
    """One match per queried label: the nearest measurement inside its gate, identities unread.

    The pairs with d2 = nu' S^-1 nu < gate are taken in the order of growing d2 (greedy nearest
    neighbour), so that no measurement is given twice. `nu(h, z)` is the sensor's innovation,
    batched: it knows which coordinates are angles (Bar-Shalom, *Tracking and Data Association*).
    """
    n, k = len(query.labels), len(points.z)
    if n == 0:
        return []
    if k == 0:
        return [_none(query, i, "nothing was measured in this frame") for i in range(n)]
    v = np.asarray(nu(query.h[:, None, :], points.z[None, :, :]))
    d2 = np.einsum("ijk,ikl,ijl->ij", v, np.linalg.inv(query.S), v)
    inside = d2 < query.gate
    out: list[Match | None] = [None] * n
    taken = np.zeros(k, dtype=bool)
    for flat in np.argsort(d2, axis=None, kind="stable"):
        i, j = divmod(int(flat), k)
        if not inside[i, j]:
            break
        if out[i] is None and not taken[j]:
            taken[j] = True
            out[i] = _match(points, query, i, j, positions=int(inside[i].sum()))
    return [m or _none(query, i, _why_not(inside[i])) for i, m in enumerate(out)]


def detect_identities(
    points: Points,
    occupied: Occupied,
    count: int,
    margin: float | Sequence[float] = 0.0,
    limits: Limits | None = None,
) -> list[Detection]:
    """Up to `count` measurements of landmarks that are not in the map, lowest identity first.

    Only measurements at least `margin` (a number, or one per coordinate) inside `limits` are
    taken, so that a landmark is not started on the edge of the field of view.
    """
    if points.ids is None or count <= 0:
        return []
    known = {int(a) for a in occupied.appearances if a is not None}
    inside = np.ones(len(points.z), dtype=bool)
    if limits is not None and len(points.z):
        lo, hi = np.asarray(limits, dtype=np.float64).T
        inside = np.all((points.z >= lo + margin) & (points.z <= hi - margin), axis=-1)
    out: list[Detection] = []
    for k in np.argsort(points.ids, kind="stable"):
        identity = int(points.ids[k])
        if inside[k] and identity not in known:
            known.add(identity)
            R = None if points.R is None else points.R[k]
            out.append(Detection(points.z[k], identity, R))
            if len(out) == count:
                break
    return out


def nearest_identity(points: Points, z: Vec) -> Detection | None:
    """The measurement with an identity that lies nearest to where somebody pointed; z holds its
    leading components, as many as a picture shows."""
    if points.ids is None or len(points.z) == 0:
        return None
    k = int(np.argmin(np.sum((points.z[:, : len(z)] - z) ** 2, axis=-1)))
    R = None if points.R is None else points.R[k]
    return Detection(points.z[k], int(points.ids[k]), R)


def _match(points: Points, query: Query, i: int, k: int, positions: int) -> Match:
    return Match(
        query.mount,
        query.labels[i],
        points.z[k],
        score=1.0,
        threshold=1.0,
        positions=positions,
        R=None if points.R is None else points.R[k],
    )


def _none(query: Query, i: int, why: str) -> Match:
    return Match(query.mount, query.labels[i], None, score=0.0, threshold=1.0, why=why)


def _why_not(inside: np.ndarray) -> str:
    if inside.any():
        return "the measurements in its gate are nearer to other landmarks"
    return "no measurement inside its gate"
