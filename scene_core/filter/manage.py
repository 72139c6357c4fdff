"""The life of features: initialised, converted, deleted.

Source: Davison, Scene, section 5.2 and MonoSLAM's map management; Solà, toolbox, `initNewLmk`,
`reparametrizeLmk`, `smartDeleteLmk`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scene_core.filter.gaussian import augment, convert, drop
from scene_core.filter.observe import groups, sensor_state
from scene_core.filter.ports import Detection, Frame, Occupied, Source
from scene_core.filter.records import Event, Predictions
from scene_core.filter.world import Feature, Label, World
from scene_core.models.base import Fault, completed


def manage(
    world: World,
    frame: Frame,
    source: Source,
    mount: str,
    predictions: Sequence[Predictions],
    updated: Sequence[Label],
) -> tuple[World, list[Event]]:
    """Convert what has become certain, delete what fails, look for what is new."""
    world, events = convert_ready(world, mount, updated)
    world, deleted = delete_failing(world)
    events += deleted
    world, born = initialise_new(world, frame, source, mount, predictions)
    return world, events + born


def convert_ready(world: World, mount: str, labels: Sequence[Label]) -> tuple[World, list[Event]]:
    """Reparametrise those of the features whose model says they are ready."""
    events: list[Event] = []
    candidates = [label for label in labels if world.features[label].model.successor() is not None]
    if not candidates:
        return world, events
    xws = sensor_state(world, mount).xws
    for group in groups(world, candidates):
        y = world.gauss.x[group.columns]
        Pyy = world.gauss.P[group.columns[:, :, None], group.columns[:, None, :]]
        ready = group.model.ready(y, Pyy, xws)
        for i in np.flatnonzero(ready):
            world = _converted(world, group.labels[int(i)])
            f = world.features[group.labels[int(i)]]
            at = world.gauss.mean(f.block)
            sd = float(np.sqrt(np.linalg.eigvalsh(world.gauss.cov(f.block))[-1]))
            distance = float(np.linalg.norm(at - xws[: at.size]))
            text = (
                f"{f.label} became a {f.model.name}, {distance:.2f} m away, sd at most {sd:.3f} m"
            )
            events.append(Event(world.frame, "converted", text, f.label))
    return world, events


def _converted(world: World, label: Label) -> World:
    feature = world.features[label]
    successor = feature.model.successor()
    assert successor is not None
    y = world.gauss.mean(feature.block)
    value, J = completed(feature.model.convert(y), feature.model.convert, y)
    assert J is not None
    gauss = convert(world.gauss, feature.block, value, J)
    features = {**world.features, label: replace(feature, model=successor)}
    return replace(world, gauss=gauss, features=features)


def why_delete(world: World, feature: Feature) -> str:
    """The reason to forget a feature, empty to keep it."""
    rules = world.policies.management
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
    gauss = drop(world.gauss, [world.features[label].block for label in labels])
    features = {k: f for k, f in world.features.items() if k not in set(labels)}
    return replace(world, gauss=gauss, features=features)


def speed(world: World, robot: str) -> float | None:
    """Speed of a robot whose state has one, else None."""
    r = world.robots[robot]
    labels = [i for i, label in enumerate(r.motion.state_labels) if label in ("vx", "vy", "vz")]
    return float(np.linalg.norm(world.gauss.mean(r.block)[labels])) if labels else None


def wanted(world: World, mount: str, predictions: Sequence[Predictions], first: bool) -> int:
    """How many new features a sensor should start now."""
    rules = world.policies.management
    moving = speed(world, world.mounts[mount].robot)
    if moving is not None and moving < rules.min_speed:
        return 0
    visible = sum(int(np.count_nonzero(p.fault == 0)) for p in predictions)
    room = rules.max_features - len(world.features)
    per_frame = rules.max_new_first if first else rules.max_new
    return max(0, min(per_frame, rules.keep_visible - visible, room))


def initialise_new(
    world: World, frame: Frame, source: Source, mount: str, predictions: Sequence[Predictions]
) -> tuple[World, list[Event]]:
    """Start new features where the source detects something the map does not have."""
    count = wanted(world, mount, predictions, first=frame.index == 0)
    if count == 0:
        return world, []
    m = world.mounts[mount].sensor.measurement_size
    in_view = [p.h[(p.fault & Fault.BEHIND) == 0] for p in predictions]
    occupied = Occupied(
        h=np.concatenate(in_view) if in_view else np.zeros((0, m)),
        appearances=tuple(f.appearance for f in world.features.values()),
    )
    events = []
    for detection in source.detect(frame, mount, occupied, count, world.policies.vision):
        world, event = initialise(world, mount, detection)
        events.append(event)
    return world, events


def initialise(world: World, mount: str, detection: Detection) -> tuple[World, Event]:
    """Add a feature seen at z: y = initialise(xws, backproject(z, n, k)).

    P_yy = J P J' + dy/dz R dy/dz' + dy/dn N dy/dn', with the prior n, N of what z leaves open.
    """
    at = sensor_state(world, mount)
    sensor, model = at.mount.sensor, world.policies.landmark
    z = np.asarray(detection.z, dtype=np.float64)
    n, N = model.prior() if sensor.unmeasured else (np.zeros(0), np.zeros((0, 0)))
    R = sensor.R(z[None])[0] if detection.R is None else detection.R
    X, by_z, by_n, by_k = completed(sensor.backproject(z, n, at.k), sensor.backproject, z, n, at.k)
    y, by_xws, by_X = completed(model.initialise(at.xws, X), model.initialise, at.xws, X)
    assert by_z is not None and by_n is not None and by_xws is not None and by_X is not None
    J = by_xws @ at.dxws_by_dx
    if at.calib_columns is not None and by_k is not None:
        J[:, at.calib_columns] = by_X @ by_k
    dy_by_dz, dy_by_dn = by_X @ by_z, by_X @ by_n
    extra = dy_by_dz @ R @ dy_by_dz.T + dy_by_dn @ N @ dy_by_dn.T
    by: dict = {}
    start = 0
    for role in at.roles:
        size = world.gauss.layout[role].size
        by[role] = J[:, start : start + size]
        start += size
    label = world.next_label
    feature = Feature(label, model, mount, at.xws, z, detection.appearance, world.frame)
    gauss = augment(world.gauss, feature.block, y, by, extra)
    features = {**world.features, label: feature}
    where = ", ".join(
        f"{name} {value:.1f} {unit}"
        for name, value, unit in zip(sensor.labels, z, sensor.units, strict=True)
    )
    event = Event(world.frame, "born", f"{label} started as {model.name} at {where}", label)
    return replace(world, gauss=gauss, features=features, next_label=label + 1), event


def initialise_at(
    world: World, frame: Frame, source: Source, mount: str, z: Sequence[float]
) -> tuple[World, Event]:
    """Start a feature where somebody pointed at; an event says why when it can not be."""
    rules = world.policies.management
    if len(world.features) >= rules.max_features:
        text = f"no feature started: the map is full ({rules.max_features}); raise 'Map size, max'"
        return world, Event(world.frame, "info", text)
    where = np.asarray(z, dtype=np.float64)
    detection = source.appearance_at(frame, mount, where, world.policies.vision)
    if detection is None:
        text = "no feature started: there is nothing to recognise here; point at a corner"
        return world, Event(world.frame, "info", text)
    return initialise(world, mount, detection)
