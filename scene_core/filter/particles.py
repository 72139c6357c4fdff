"""Partial features: what the filter does not know yet is carried by particles.

A particle lam_k with weight w_k predicts h_k + b_k with S_k = B_k + R. A match z reweights them,
w_k <- w_k N(z; h_k + b_k, S_k), without touching the state.

b_k with covariance B_k is the error that all measurements of the feature have in common: that of
its first view, and of the way since. It begins as 0 with E_k = H_k P H_k' and grows by what E_k
grows; given lam_k, a match tells it too,
    K = B_k S_k^-1,  b_k <- b_k + K nu,  B_k <- B_k - K S_k K'.
With 0 and E_k in every frame, as in SceneLib, N measurements that repeat one error pass for N
independent ones.

b_k is told in the axes of the sensor: a robot that turns meets another part of the error of its
way, of which b_k says nothing. So what can not be undone is decided by the first view and one match
alone, by N(z; h_k, E_k + R): the gate, which particles are pruned, and when the feature becomes a
complete one (`settle`). A range ring forgot the right one of two mirror images otherwise.

Source: Davison, *Real-Time Simultaneous Localisation and Mapping with a Single Camera*, ICCV 2003,
section 4; SceneLib 1.0's numbers. The common error is the bias of Friedland, *Treatment of bias in
recursive filtering*, TAC 1969.
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
from scene_core.filter.world import Feature, Label, Learnt, World
from scene_core.models.base import Particles, completed


@dataclass(frozen=True)
class Hypotheses:
    """The predictions of every particle of every feature of a group."""

    h: Vec
    """h_k + b_k (N, K, m)"""
    S: Mat
    """B_k + R (N, K, m, m)"""
    b: Vec
    """(N, K, m)"""
    B: Mat
    """(N, K, m, m)"""
    E: Mat
    """H_k P H_k' (N, K, m, m)"""
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
    m = seen.h.shape[-1]
    E = innovation_covariance(world.gauss.P, parts).reshape(n, K, m, m)
    b, B = common(world, at.mount.id, group.labels, E)
    h = seen.h.reshape(n, K, m) + b
    return Hypotheses(
        h,
        B + sensor.R(h),
        b,
        B,
        E,
        w,
        seen.H_shared.reshape(n, K, m, -1),
        seen.H_own.reshape(n, K, m, -1),
    )


def common(world: World, mount: str, labels: Sequence[Label], E: Mat) -> tuple[Vec, Mat]:
    """b (N, K, m) and B (N, K, m, m) of the features before a measurement, from E (N, K, m, m)."""
    b, B = np.zeros(E.shape[:-1]), E.copy()
    for i, label in enumerate(labels):
        past = world.features[label].learnt.get(mount)
        if past is not None:
            K = len(past.b)
            values, vectors = np.linalg.eigh(E[i, :K] - past.E)
            grown = (vectors * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(vectors, -1, -2)
            b[i, :K], B[i, :K] = past.b, past.B + grown
    return b, B


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


def nearest(world: World, mount: str, matches: Sequence[Match]) -> dict[Label, float]:
    """The smallest d2 of every match over all particles of its feature."""
    if not matches:
        return {}
    at, found = sensor_state(world, mount), {m.label: m for m in matches}
    out: dict[Label, float] = {}
    for group in groups(world, list(found)):
        hyp = hypotheses(world, at, group)
        nu, S = _unlearnt(hyp, *_against(at, hyp, [found[label] for label in group.labels]))
        d2 = np.where(hyp.w > 0.0, _squared(nu, S), np.inf).min(axis=1)
        out |= dict(zip(group.labels, d2.tolist(), strict=True))
    return out


def reweighted(world: World, mount: str, matches: Sequence[Match]) -> dict[Label, Feature]:
    """The partial features among the matches, with the particles that agree with them.

    Those are dropped that one match alone makes less probable than the part of the average that the
    model names.
    """
    at = sensor_state(world, mount)
    found = {m.label: m for m in matches if m.z is not None}
    out: dict[Label, Feature] = {}
    for group in groups(world, list(found)):
        hyp = hypotheses(world, at, group)
        nu, S = _against(at, hyp, [found[label] for label in group.labels])
        single, every = _log_likelihoods(*_unlearnt(hyp, nu, S)), _log_likelihoods(nu, S)
        for i, (label, cloud) in enumerate(zip(group.labels, group.particles, strict=True)):
            K = len(cloud.w)
            once = np.exp(single[i, :K])
            keep = once >= group.model.prune * once.mean()
            log_w = (np.log(np.maximum(cloud.w, 1e-300)) + every[i, :K])[keep]
            w = np.exp(log_w - log_w.max())
            learnt = _kept(_taught(hyp, i, nu[i, :K], S[i, :K]), keep)
            feature = world.features[label]
            out[label] = replace(
                feature,
                particles=Particles(frozen(cloud.lam[keep]), frozen(w / w.sum())),
                learnt={
                    **{name: _kept(past, keep) for name, past in feature.learnt.items()},
                    mount: learnt,
                },
            )
    return out


def alone(world: World, mount: str, match: Match) -> tuple[Particles, Vec]:
    """The particles of a feature, weighted by nothing but its first view and a match, and what the
    match is off the prediction of each (K, m)."""
    group = groups(world, [match.label])[0]
    at = sensor_state(world, mount)
    hyp = hypotheses(world, at, group)
    nu, S = _unlearnt(hyp, *_against(at, hyp, [match]))
    w = np.exp(_log_likelihoods(nu, S)[0])
    return Particles(group.particles[0].lam, frozen(w / w.sum())), nu[0]


def _unlearnt(hyp: Hypotheses, nu: Vec, S: Mat) -> tuple[Vec, Mat]:
    """nu and S without what the measurements before have taught."""
    return nu + hyp.b, S - hyp.B + hyp.E


def _taught(hyp: Hypotheses, i: int, nu: Vec, S: Mat) -> Learnt:
    """b_k and B_k of the i-th feature after a match."""
    K = len(nu)
    B = hyp.B[i, :K]
    gain = B @ np.linalg.inv(S)
    b = hyp.b[i, :K] + (gain @ nu[..., None])[..., 0]
    return Learnt(b, B - gain @ S @ np.swapaxes(gain, -1, -2), hyp.E[i, :K])


def _log_likelihoods(nu: Vec, S: Mat) -> Vec:
    """log N(nu; 0, S) (N, K) against the largest of each feature."""
    log = -0.5 * (_squared(nu, S) + np.linalg.slogdet(S)[1])
    return log - log.max(axis=1, keepdims=True)


def _against(at: SensorState, hyp: Hypotheses, matches: Sequence[Match]) -> tuple[Vec, Mat]:
    """nu (N, K, m) and S (N, K, m, m) of a match for each feature; a measurement's own covariance
    goes before the sensor's."""
    z, S = np.array([match.z for match in matches]), hyp.S.copy()
    for i, match in enumerate(matches):
        if match.R is not None:
            S[i] = hyp.B[i] + match.R
    return at.mount.sensor.nu(hyp.h, z[:, None]).nu, S


def _kept(past: Learnt, keep: np.ndarray) -> Learnt:
    return Learnt(frozen(past.b[keep]), frozen(past.B[keep]), frozen(past.E[keep]))


def _means(group: Group) -> Vec:
    """Mean free parameters (N, f)."""
    return np.array([group.model.moments(p)[0] for p in group.particles])


def _squared(nu: Vec, S: Mat) -> Vec:
    """nu' S^-1 nu (...,)."""
    return np.vecdot(nu, np.linalg.solve(S, nu[..., None])[..., 0])
