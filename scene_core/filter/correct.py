"""The measurement update: all accepted matches at once, or one after the other.

Stacked: one linearisation, H of all accepted matches. Sequential: after each match h, H and S are
computed again at the new state (the search is done once), and the gate is applied to the new d2.

Iterated: stacked, but linearised a second time where the first pass puts the sensor (its robot,
pose and calibration), the features staying where they were predicted. A step d of noisy odometry
with lateral variance s^2 is otherwise lengthened by s^2 / d^2 on average, because the direction of
motion is corrected along the tangent at the noisy prediction: in the cloister the map then comes
out 0.8 % too large, twice its standard deviation. Iterating the features too would put an open
depth at the mode of its skewed posterior, 2 % off in the first frames.

Source: Davison, Scene 1.0 (stacked); Solà, toolbox, `correctKnownLmks` (sequential); Jazwinski,
Stochastic processes and filtering theory, section 8.3 (iterated).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.associate import against, judge
from scene_core.filter.carry import carried
from scene_core.filter.gaussian import Rows, Workspace, add_noise, times_Ht, times_P
from scene_core.filter.groups import groups
from scene_core.filter.joint import odd_ones
from scene_core.filter.observe import SensorState, sensor_state
from scene_core.filter.particles import reweighted
from scene_core.filter.ports import Match
from scene_core.filter.predict import normalise_robots
from scene_core.filter.records import Association
from scene_core.filter.world import Feature, Gaussian, Label, World
from scene_core.geometry.ellipses import chi2_gate


def correct(
    world: World, mount: str, matches: Sequence[Match], verdicts: Sequence[Association]
) -> tuple[World, tuple[Association, ...], dict[str, float]]:
    """The world after the update, the final verdicts, and the numbers of the update."""
    work = Workspace(world.gauss)
    open_ = {label for label, f in world.features.items() if f.particles is not None}
    found = [m for m in matches if m.z is not None and m.label not in open_]
    trace = float(np.trace(work.P))
    if world.policies.update.kind == "sequential":
        final = _sequential(work, world, mount, found)
    else:
        final = {a.label: a for a in verdicts if a.z is not None and a.label not in open_}
        _stacked(work, world, mount, found, final)
    normalise_robots(work, world)
    # Open features move with what they are correlated with; particles need their rays of length 1.
    updated = {a.label for a in final.values() if a.verdict == "accepted"}
    normalise_features(work, world, [*(updated | open_)])
    verdicts = tuple(final.get(a.label, a) for a in verdicts)
    numbers = {
        "accepted": float(sum(a.verdict == "accepted" for a in verdicts)),
        "trace P before": trace,
        "trace P after": float(np.trace(work.P)),
    }
    world = replace(world, gauss=work.seal(), features=counted(world, verdicts))
    agreed = {a.label for a in verdicts if a.verdict == "accepted"} & open_
    if agreed:
        seen = reweighted(world, mount, [m for m in matches if m.label in agreed])
        world = replace(world, features={**world.features, **seen})
    return world, verdicts, numbers


def _stacked(
    work: Workspace,
    world: World,
    mount: str,
    found: Sequence[Match],
    verdicts: dict[Label, Association],
) -> None:
    accepted = {m.label: m for m in found if verdicts[m.label].verdict == "accepted"}
    if not accepted:
        return
    at, parts, nu, R = _linearised(work, world, mount, accepted)
    if world.policies.gate.joint and _reject_odd_ones(work, world, (parts, nu, R), verdicts):
        accepted = {k: m for k, m in accepted.items() if verdicts[k].verdict == "accepted"}
        at, parts, nu, R = _linearised(work, world, mount, accepted)
    axes = carried(world, world.mounts[mount].robot, work.x)
    for _ in range(linearisations(world) - 1):
        prior = work.x.copy()
        work.x[at.columns] += _gain_rows(work, parts, R, at.columns) @ nu
        moved = work.x - prior
        at, parts, nu, R = _linearised(work, world, mount, accepted)
        if axes is not None:
            parts = _told_before(parts, axes.robot_at(work.x))
        # What this linearisation, made elsewhere, says of the innovation at the prior.
        nu += times_Ht(moved[None], parts)[0]
        work.x[:] = prior
    work.update(parts, nu, R)
    if axes is not None:
        axes.carry(work)


def _reject_odd_ones(
    work: Workspace,
    world: World,
    linearised: tuple[list[Rows], Vec, Mat],
    verdicts: dict[Label, Association],
) -> bool:
    """Reject the matches that pass their own gate but disagree with all the others."""
    parts, nu, R = linearised
    labels = [k for k, v in verdicts.items() if v.verdict == "accepted"]
    labels = [label for group in groups(world, labels) for label in group.labels]
    S = times_Ht(times_P(parts, work.P), parts)
    add_noise(S, R)
    nus = nu.reshape(len(labels), -1)
    gate = chi2_gate(nus.shape[1], world.policies.gate.confidence)
    odd = odd_ones(nus, S, gate)
    for row, d2 in odd:
        why = f"disagrees with the other matches: d2 = {d2:.1f} > {gate:.2f} given them"
        verdicts[labels[row]] = replace(verdicts[labels[row]], verdict="rejected", why=why)
    return bool(odd)


def linearisations(world: World) -> int:
    """How often the matches of a frame are linearised before their update."""
    update = world.policies.update
    return update.iterations if update.kind == "iterated" else 1


def _told_before(parts: Sequence[Rows], T: Mat) -> list[Rows]:
    """Jacobians by the errors of a state whose robot has moved, by those before it has: of the
    shared columns its own are the first."""
    out = []
    for part in parts:
        H = part.H_shared.copy()
        H[..., : len(T)] = H[..., : len(T)] @ T
        out.append(replace(part, H_shared=H))
    return out


def _gain_rows(work: Workspace, parts: Sequence[Rows], R: Mat, rows: np.ndarray) -> Mat:
    """Rows of the gain K = P H' S^-1."""
    HP = times_P(parts, work.P)
    S = times_Ht(HP, parts)
    add_noise(S, R)
    K = np.linalg.solve(S, HP[:, rows]).T.astype(np.float64, copy=False)
    return K


def _linearised(
    work: Workspace, world: World, mount: str, accepted: Mapping[Label, Match]
) -> tuple[SensorState, list[Rows], Vec, Mat]:
    """H, nu and the blocks of R of the accepted matches at the present x."""
    at = sensor_state(world, mount, Gaussian(work.x, work.P, work.layout))
    parts: list[Rows] = []
    nus, Rs = [], []
    for group in groups(world, list(accepted)):
        _, found = against(at, group, work.x, [accepted[label] for label in group.labels])
        parts.append(found.rows)
        nus.append(found.nu.ravel())
        Rs.append(found.R)
    return at, parts, np.concatenate(nus), np.concatenate(Rs)


def _sequential(
    work: Workspace, world: World, mount: str, found: Sequence[Match]
) -> dict[Label, Association]:
    final: dict[Label, Association] = {}
    confidence = world.policies.gate.confidence
    for match in found:
        gauss = Gaussian(work.x, work.P, work.layout)
        at = sensor_state(world, mount, gauss)
        group = groups(world, [match.label])[0]
        h, one = against(at, group, work.x, [match])
        HP = times_P([one.rows], work.P)
        S = times_Ht(HP, [one.rows]) + one.R[0]
        verdict = judge(at.mount, match, h[0], one.nu[0], S, confidence)
        final[match.label] = verdict
        if verdict.verdict == "accepted":
            axes = carried(world, at.mount.robot, work.x)
            work.gain(HP, S, one.nu[0])
            if axes is not None:
                axes.carry(work)
            normalise_robots(work, world)
            normalise_features(work, world, [match.label])
    return final


def normalise_features(work: Workspace, world: World, labels: Sequence[Label]) -> None:
    """Put the given features back on their constraints."""
    for group in groups(world, [k for k in labels if not world.features[k].carrier]):
        result = group.model.normalise(work.x[group.columns])
        if result is None:
            continue
        for i, label in enumerate(group.labels):
            block = work.layout[world.features[label].block]
            if not np.array_equal(result.value[i], work.x[block.slice]):
                J = result.jacobian
                own = J[i] if J is not None and J.ndim == 3 else J
                work.set_block(block, result.value[i], own)


def counted(world: World, verdicts: Sequence[Association]) -> dict[Label, Feature]:
    """Features with their counters of searches, matches and updates advanced."""
    features = dict(world.features)
    for a in verdicts:
        if a.verdict == "not selected":
            continue
        f = features[a.label]
        features[a.label] = replace(
            f,
            attempts=f.attempts + 1,
            matches=f.matches + (a.z is not None),
            updates=f.updates + (a.verdict == "accepted"),
            misses=0 if a.z is not None else f.misses + 1,
        )
    return features
