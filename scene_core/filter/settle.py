"""A partial feature becomes a complete one: its particles' mean goes into the state.

    y = g(yp, lam),  P_yy = G_y P_pp G_y' + G_lam (WIDER^2 var(lam)) G_lam',
and then the match of this frame, which has only weighted particles so far, updates the state if it
passes the gate of the complete feature, whose nu is that of the mean. Otherwise it stays open.

The error of lam is that of the way between the views it was triangulated from, which other features
of the same frames share. Particles can not say so: with var(lam) alone a whole map that was born
together passes for as many independent measurements of that way. Made wider, all that is known of
lam comes from the first view and this one, with every correlation. So these two alone must make the
particles agree, and so near to each other that what they predict is linear in lam: of two mirror
images in one cloud it is not, and the mean is between them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.associate import against, judge
from scene_core.filter.carry import carried
from scene_core.filter.correct import normalise_features
from scene_core.filter.gaussian import Gaussian, Workspace, add_noise, convert, times_Ht, times_P
from scene_core.filter.groups import groups
from scene_core.filter.observe import sensor_state
from scene_core.filter.particles import alone
from scene_core.filter.ports import Match
from scene_core.filter.predict import normalise_robots
from scene_core.filter.world import Feature, World
from scene_core.geometry.spaces import wrap
from scene_core.models.base import FeatureModel, Particles, completed

WIDER = 10.0
"""Times the standard deviation of the particles."""
CURVED = 0.1
"""Of what the predictions of the particles vary, at most this part of what is linear in lam may be
curved; both are squares. Mirror images at bearings of +-b from the way, sd apart each, reach it at
b = 2.2 sd."""


def settled(world: World, mount: str, match: Match) -> World | None:
    """The world with a partial feature in its successor's parametrisation, updated with its match;
    None where the match and the first view do not suffice for that, or where the match is not what
    the mean of the particles predicts."""
    label, open_ = match.label, [k for k, f in world.features.items() if f.particles is not None]
    feature = world.features[label]
    successor = feature.model.successor()
    assert successor is not None
    cloud, off = alone(world, mount, match)
    if not feature.model.settled(world.gauss.mean(feature.block), cloud):
        return None
    if curvature(feature.model, cloud, off) > CURVED:
        return None
    gauss = placed(world.gauss, replace(feature, particles=cloud), WIDER)
    # What its particles agreed with speaks for all of them: the place they settled at, which may be
    # the mirror image, is judged by what comes from now on.
    counters = dict(attempts=0, matches=0, updates=0)
    settled = replace(feature, model=successor, particles=None, learnt={}, **counters)
    features = {**world.features, label: settled}
    world = replace(world, gauss=gauss, features=features)
    at = sensor_state(world, mount)
    h, found = against(at, groups(world, [label])[0], gauss.x, [match])
    work, nu = Workspace(gauss), found.nu[0]
    HP = times_P([found.rows], work.P)
    S = times_Ht(HP, [found.rows])
    add_noise(S, found.R)
    confidence = world.policies.gate.confidence
    if judge(at.mount, match, h[0], nu, S, confidence).verdict != "accepted":
        return None
    axes = carried(world, at.mount.robot, work.x)
    work.gain(HP, S, nu)
    if axes is not None:
        axes.carry(work)
    normalise_robots(work, world)
    # Other rays move with what they are correlated with: their particles need them of length 1.
    normalise_features(work, world, open_)
    return replace(world, gauss=work.seal())


def curvature(model: FeatureModel, cloud: Particles, off: Vec) -> float:
    """The part of `off` (K, m), told of each particle, that is not linear in lam, against what is;
    weighted mean squares."""
    lam = cloud.lam - model.moments(cloud)[0]
    angles = np.array([unit == "rad" for unit in model.free_units])
    lam[:, angles] = wrap(lam[:, angles])
    w = np.sqrt(cloud.w)[:, None]
    A = w * np.concatenate([np.ones_like(w), lam], axis=1)
    fit = np.linalg.lstsq(A, w * off)[0]
    linear, rest = A[:, 1:] @ fit[1:], w * off - A @ fit
    return float((rest**2).sum() / max((linear**2).sum(), 1e-300))


def placed(gauss: Gaussian, feature: Feature, wider: float = 1.0) -> Gaussian:
    """The state with a partial feature's block replaced by its successor's, the standard deviation
    of its particles taken `wider` times."""
    model, cloud = feature.model, feature.particles
    assert cloud is not None
    y = gauss.mean(feature.block)
    lam, var = model.moments(cloud)
    value, by_y, by_lam = completed(model.settle(y, lam), model.settle, y, lam)
    assert by_y is not None and by_lam is not None
    noise: Mat = wider**2 * by_lam @ var @ by_lam.T
    return convert(gauss, feature.block, value, by_y, noise)
