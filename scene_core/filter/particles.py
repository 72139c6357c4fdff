"""Partial features: what the filter does not know yet is carried by particles.

A particle lam_k with weight w_k makes its own prediction h_k with S_k = H_k P H_k' + R. A match z
reweights them, w_k <- w_k N(z; h_k, S_k), without touching the state; what has become improbable
is pruned. Once they have collapsed the feature is settled and has a place in the state like others,
    y = g(yp, lam),  P_yy = G_y P_pp G_y' + G_lam var(lam) G_lam'.

Source: Davison, *Real-Time Simultaneous Localisation and Mapping with a Single Camera*, ICCV 2003,
section 4; SceneLib 1.0's numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scene_core.arrays import Mat, Vec, frozen
from scene_core.filter.gaussian import Rows
from scene_core.filter.groups import Group, groups
from scene_core.filter.observe import SensorState, innovation_covariance, see, sensor_state
from scene_core.filter.ports import Match
from scene_core.filter.records import Predictions
from scene_core.filter.scores import score
from scene_core.filter.world import Feature, Label, World
from scene_core.models.base import Particles, completed

PRUNE = 0.05
"""A particle is dropped when its weight falls below this part of the average weight."""


@dataclass(frozen=True)
class Hypotheses:
    """The predictions of every particle of every feature of a group."""

    h: Vec
    """(N, K, m)"""
    S: Mat
    """(N, K, m, m)"""
    w: Vec
    """(N, K), zero where a feature has fewer than K particles."""
    H_shared: Mat
    """(N, K, m, ns)"""
    H_own: Mat
    """(N, K, m, s)"""


def hypotheses(world: World, at: SensorState, group: Group) -> Hypotheses:
    """h_k and S_k of all particles of all features of a group in one batch."""
    sensor = at.mount.sensor
    n, K = len(group.labels), max(len(p.w) for p in group.particles)
    lam = np.stack([np.resize(p.lam, (K, p.lam.shape[1])) for p in group.particles])
    w = np.stack([np.pad(p.w, (0, K - len(p.w))) for p in group.particles])
    y = np.repeat(world.gauss.x[group.columns][:, None], K, axis=1)
    X_W, by_y, _ = completed(group.model.point(y, lam), group.model.point, y, lam)
    assert by_y is not None
    d1 = X_W.shape[-1]
    by_y = np.broadcast_to(by_y, (n, K, *by_y.shape[-2:])).reshape(n * K, d1, -1)
    each = group.rows(np.repeat(np.arange(n), K))
    seen = see(at, each, X_W.reshape(n * K, d1), by_y)
    parts = Rows(at.columns, seen.H_shared, each.columns, seen.H_own)
    S = innovation_covariance(world.gauss.P, parts) + sensor.R(seen.h)
    m = seen.h.shape[-1]
    return Hypotheses(
        seen.h.reshape(n, K, m),
        S.reshape(n, K, m, m),
        w,
        seen.H_shared.reshape(n, K, m, -1),
        seen.H_own.reshape(n, K, m, -1),
    )


def open_predictions(world: World, at: SensorState, group: Group) -> Predictions:
    """The mixture of all particles as one mean and covariance for selection and search:

    h = sum w_k h_k,   S = sum w_k (S_k + (h_k - h)(h_k - h)').
    H is that of the heaviest particle.
    """
    sensor = at.mount.sensor
    hyp = hypotheses(world, at, group)
    every = np.arange(len(group.labels))
    best = hyp.w.argmax(axis=1)
    start = hyp.h[every, best]
    off = sensor.nu(start[:, None], hyp.h).nu
    mean = np.einsum("nk,nkm->nm", hyp.w, off)
    spread = off - mean[:, None]
    S = np.einsum("nk,nkab->nab", hyp.w, hyp.S + spread[..., :, None] * spread[..., None, :])
    h = start + mean
    R = sensor.R(h)
    X_W = group.model.point(world.gauss.x[group.columns], _means(group)).X
    X_S = sensor.space.to_local(at.xws, X_W).X
    H, at_column = {}, 0
    for role in at.roles:
        size = world.gauss.layout[role].size
        H[role] = hyp.H_shared[every, best, :, at_column : at_column + size]
        at_column += size
    return Predictions(
        mount=at.mount.id,
        model=group.model.name,
        labels=group.labels,
        h=h,
        H=H | {"feature": hyp.H_own[every, best]},
        E=S - R,
        R=R,
        fault=sensor.visibility(h, X_S, at.xws, group.pose0, X_W),
        score=score(sensor, world.policies.selection.score, S - R, R),
        selected=np.zeros(len(group.labels), dtype=bool),
        particles=(hyp.h, hyp.w),
    )


def nearest(world: World, mount: str, match: Match) -> float:
    """The smallest d2 of a match over all particles of its feature."""
    at, z = sensor_state(world, mount), match.z
    assert z is not None
    hyp = hypotheses(world, at, groups(world, [match.label])[0])
    nu = at.mount.sensor.nu(hyp.h[0], z).nu
    return float(_squared(nu, hyp.S[0])[hyp.w[0] > 0.0].min())


def reweighted(world: World, mount: str, matches: Sequence[Match]) -> dict[Label, Feature]:
    """The partial features among the matches, with the particles that agree with them.

    Weights below PRUNE of the average are dropped.
    """
    at = sensor_state(world, mount)
    found = {m.label: m.z for m in matches if m.z is not None}
    out: dict[Label, Feature] = {}
    for group in groups(world, list(found)):
        hyp = hypotheses(world, at, group)
        for i, label in enumerate(group.labels):
            z, cloud = found[label], group.particles[i]
            K = len(cloud.w)
            nu = at.mount.sensor.nu(hyp.h[i, :K], z).nu
            S = hyp.S[i, :K]
            log_w = np.log(np.maximum(cloud.w, 1e-300)) - 0.5 * (
                _squared(nu, S) + np.linalg.slogdet(S)[1]
            )
            w = np.exp(log_w - log_w.max())
            keep = w >= PRUNE * w.mean()
            w = w[keep] / w[keep].sum()
            cloud = Particles(frozen(cloud.lam[keep]), frozen(w))
            out[label] = replace(world.features[label], particles=cloud)
    return out


def _means(group: Group) -> Vec:
    """Mean free parameters (N, f)."""
    return np.array([group.model.moments(p)[0] for p in group.particles])


def _squared(nu: Vec, S: Mat) -> Vec:
    """nu' S^-1 nu (K,)."""
    return np.einsum("ki,ki->k", nu, np.linalg.solve(S, nu[..., None])[..., 0])
