"""The life of features: converted, deleted; how they begin is told in `birth`, how segments grow in
`extents`.

Source: Davison, Scene, section 5.2 and MonoSLAM's map management; Solà, toolbox,
`reparametrizeLmk`, `smartDeleteLmk`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.birth import initialise_new
from scene_core.filter.extents import extended
from scene_core.filter.gaussian import convert, drop
from scene_core.filter.groups import groups
from scene_core.filter.observe import sensor_state
from scene_core.filter.ports import Frame, Match, Source
from scene_core.filter.records import Event, Predictions
from scene_core.filter.settle import settled
from scene_core.filter.world import Feature, Label, World
from scene_core.models.base import completed


def manage(
    world: World,
    frame: Frame,
    source: Source,
    mount: str,
    predictions: Sequence[Predictions],
    accepted: Sequence[Match],
) -> tuple[World, list[Event]]:
    """Convert what has become certain, delete what fails, look for what is new."""
    if world.policies.management.extend_lines:
        ends = {match.label: match.z for match in accepted if match.z is not None}
        world = extended(world, mount, list(ends), list(ends.values()))
    world, events = convert_ready(world, mount, accepted)
    world, deleted = delete_failing(world)
    events += deleted
    world, born = initialise_new(world, frame, source, mount, predictions)
    return world, events + born


def convert_ready(world: World, mount: str, accepted: Sequence[Match]) -> tuple[World, list[Event]]:
    """Reparametrise those of the measured features whose model says they are ready."""
    events: list[Event] = []
    found = {m.label: m for m in accepted if world.features[m.label].model.successor() is not None}
    if not found:
        return world, events
    xws = sensor_state(world, mount).xws
    for label in _ready(world, list(found), xws):
        if world.features[label].particles is None:
            world = _converted(world, label, xws)
        else:
            complete = settled(world, mount, found[label])
            if complete is None:
                continue
            world = complete
        f = world.features[label]
        events.append(Event(world.frame, "converted", _about(world, f, xws), f.label))
    return world, events


def _ready(world: World, labels: Sequence[Label], xws: Vec) -> list[Label]:
    """Which features their models would convert now; all are asked before one changes the state."""
    out: list[Label] = []
    for group in groups(world, labels):
        y = world.gauss.x[group.columns]
        Pyy = world.gauss.P[group.columns[:, :, None], group.columns[:, None, :]]
        if group.partial:
            clouds = zip(y, group.particles, strict=True)
            ready = np.array([group.model.settled(each, cloud) for each, cloud in clouds])
        else:
            ready = group.model.ready(y, Pyy, xws)
        out += [group.labels[int(i)] for i in np.flatnonzero(ready)]
    return out


def _about(world: World, f: Feature, xws: Vec) -> str:
    sd = float(np.sqrt(np.linalg.eigvalsh(world.gauss.cov(f.block))[-1]))
    text = f"{f.label} became a {f.model.name}"
    if f.model.state_size != f.model.space.d:
        return text
    distance = float(np.linalg.norm(world.gauss.mean(f.block) - xws[: f.model.space.d]))
    return f"{text}, {distance:.2f} m away, sd at most {sd:.3f} m"


def _converted(world: World, label: Label, xws: Vec) -> World:
    feature = world.features[label]
    successor = feature.model.successor()
    assert successor is not None
    y = world.gauss.mean(feature.block)
    value, J = completed(feature.model.convert(y), feature.model.convert, y)
    assert J is not None
    gauss = convert(world.gauss, feature.block, value, J)
    now = replace(feature, model=successor)
    if feature.extent is not None:
        # The same ends, in the words of the new parametrisation.
        X = feature.model.ends(y, np.array(feature.extent)).reshape(2, 4)
        t = successor.along(value, xws[:3], X[:, :3] - X[:, 3:] * xws[:3])
        now = replace(now, extent=(float(t.min()), float(t.max())))
    return replace(world, gauss=gauss, features={**world.features, label: now})


def why_delete(world: World, feature: Feature) -> str:
    """The reason to forget a feature, empty to keep it."""
    rules = world.policies.management
    if feature.carrier:
        return ""
    if feature.particles is not None:
        if feature.model.spent(feature.particles):
            return f"only {len(feature.particles.w)} of its particles are left"
        if feature.attempts >= rules.open_attempts:
            return f"still open after {feature.attempts} searches"
    if feature.attempts < rules.min_attempts or (feature.known and not rules.delete_known):
        return ""
    if feature.matches < rules.min_match_ratio * feature.attempts:
        return f"only {feature.matches} of {feature.attempts} searches found it"
    if feature.updates < rules.min_accept_ratio * feature.matches:
        return f"only {feature.updates} of {feature.matches} matches passed the gate"
    return ""


def delete_failing(world: World) -> tuple[World, list[Event]]:
    """Forget the features that are searched in vain or keep being rejected."""
    reasons = {label: why_delete(world, f) for label, f in world.features.items()}
    gone = [label for label, why in reasons.items() if why]
    events = [
        Event(world.frame, "deleted", f"{label} deleted: {reasons[label]}", label) for label in gone
    ]
    return (delete(world, gone) if gone else world), events


def delete(world: World, labels: Sequence[Label]) -> World:
    """The world without some features; every sensor forgets them at once."""
    gone = [f for f in map(world.features.__getitem__, labels) if not f.carrier]
    gauss = drop(world.gauss, [f.block for f in gone])
    forgotten = set(labels)
    features = {k: f for k, f in world.features.items() if k not in forgotten}
    return replace(world, gauss=gauss, features=features)
