"""How features begin: where a source detects something the map does not have, or where somebody
points.

Source: Davison, Scene, section 5.2 and MonoSLAM's map management; Solà, toolbox, `initNewLmk`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.gaussian import augment
from scene_core.filter.observe import SensorState, sensor_state
from scene_core.filter.ports import Detection, Frame, Image, Occupied, Source
from scene_core.filter.records import Event, Predictions
from scene_core.filter.world import Feature, Label, World
from scene_core.models import segments
from scene_core.models.base import Fault, FeatureModel, Sensor, Shape, completed
from scene_core.models.registry import compatible


def speed(world: World, robot: str) -> float | None:
    """Speed of a robot whose state has one, else None."""
    r = world.robots[robot]
    labels = [i for i, label in enumerate(r.motion.state_labels) if label in ("vx", "vy", "vz")]
    return float(np.linalg.norm(world.gauss.mean(r.block)[labels])) if labels else None


def wanted(
    world: World,
    mount: str,
    predictions: Sequence[Predictions],
    first: bool,
    shape: Shape = "point",
) -> int:
    """How many new features of a shape a sensor should start now."""
    rules = world.policies.management
    moving = speed(world, world.mounts[mount].robot)
    if moving is not None and moving < rules.min_speed:
        return 0
    same = [p for p in predictions if p.shape == shape]
    visible = sum(int(np.count_nonzero(p.fault == 0)) for p in same)
    room = rules.max_features - len(world.features)
    if world.policies.landmark.free_labels and shape == "point":
        carried = sum(f.particles is not None for f in world.features.values())
        room = min(room, rules.max_open - carried)
    per_frame = rules.max_new_first if first else rules.max_new
    return max(0, min(per_frame, rules.keep_visible - visible, room))


def initialise_new(
    world: World, frame: Frame, source: Source, mount: str, predictions: Sequence[Predictions]
) -> tuple[World, list[Event]]:
    """Start new features where the source detects something the map does not have."""
    events: list[Event] = []
    for shape in wished(world, mount):
        count = wanted(world, mount, predictions, frame.index == 0, shape)
        if count == 0:
            continue
        occupied = _occupied(world, mount, predictions, shape)
        for detection in source.detect(frame, mount, occupied, count, world.policies.vision):
            world, event = initialise(world, mount, detection)
            events.append(event)
    return world, events


def wished(world: World, mount: str) -> list[Shape]:
    """What a sensor can start new features of, in their present parametrisations."""
    sensor, policies = world.mounts[mount].sensor, world.policies
    models = (policies.landmark, policies.line)
    return [m.shape for m in models if m is not None and compatible(sensor, m) is None]


def _occupied(
    world: World, mount: str, predictions: Sequence[Predictions], shape: Shape
) -> Occupied:
    same = [p for p in predictions if p.shape == shape]
    h = [(p.h if p.ends is None else p.ends)[(p.fault & Fault.BEHIND) == 0] for p in same]
    m = world.mounts[mount].sensor.measurement_size * (2 if shape == "segment" else 1)
    mapped = [f for f in world.features.values() if f.model.shape == shape]
    return Occupied(
        h=np.concatenate(h) if h else np.zeros((0, m)),
        appearances=tuple(f.appearance for f in mapped),
        shape=shape,
    )


def initialise(world: World, mount: str, detection: Detection) -> tuple[World, Event]:
    """Add a feature seen at z: y = initialise(xws, backproject(z, n, k)).

    P_yy = J P J' + dy/dz R dy/dz' + dy/dn N dy/dn', with the prior n, N of what z leaves open.
    """
    at = sensor_state(world, mount)
    policies = world.policies
    model = policies.landmark if detection.shape == "point" else policies.line
    assert model is not None
    z = np.asarray(detection.z, dtype=np.float64)
    y, by, extra = birth(world, at, model, z, detection.R)
    label = world.next_label
    feature = Feature(label, model, mount, at.xws, z, detection.appearance, world.frame)
    if model.free_labels:
        feature = replace(feature, particles=model.particles0())
    if model.shape == "segment":
        t = model.along(y, at.xws[:3], end_rays(at, z))
        feature = replace(feature, extent=(float(t.min()), float(t.max())))
    gauss = augment(world.gauss, feature.block, y, by, extra)
    features = {**world.features, label: feature}
    text = f"{label} started as {model.name} at {_place(at.mount.sensor, z)}"
    event = Event(world.frame, "born", text, label)
    return replace(world, gauss=gauss, features=features, next_label=label + 1), event


def birth(
    world: World, at: SensorState, model: FeatureModel, z: Vec, R: Mat | None = None
) -> tuple[Vec, dict[str, Mat], Mat]:
    """y of a new feature, its Jacobian by block, and the covariance that is all its own."""
    sensor = at.mount.sensor
    n, N = _open(sensor, model)
    if model.shape == "segment":
        seen = segments.backproject(sensor, z, n, at.k)
        noise = segments.noise(sensor, z) if R is None else R
    else:
        seen = completed(sensor.backproject(z, n, at.k), sensor.backproject, z, n, at.k)
        noise = sensor.R(z[None])[0] if R is None else R
    X, by_z, by_n, by_k = seen
    assert by_z is not None and by_n is not None and by_k is not None
    y, by_xws, by_X = completed(model.initialise(at.xws, X), model.initialise, at.xws, X)
    assert by_xws is not None and by_X is not None
    J = by_xws @ at.dxws_by_dx
    if at.calib_columns is not None:
        J[:, at.calib_columns] = by_X @ by_k
    dy_by_dz, dy_by_dn = by_X @ by_z, by_X @ by_n
    by: dict[str, Mat] = {}
    start = 0
    for role in at.roles:
        size = world.gauss.layout[role].size
        by[role] = J[:, start : start + size]
        start += size
    return y, by, dy_by_dz @ noise @ dy_by_dz.T + dy_by_dn @ N @ dy_by_dn.T


def _open(sensor: Sensor, model: FeatureModel) -> tuple[Vec, Mat]:
    """Mean and covariance of what one measurement leaves open, in the sensor's order."""
    n, N = model.prior()
    known, ends = len(model.unmeasured), 2 if model.shape == "segment" else 1
    one = [model.unmeasured.index(name) for name in sensor.unmeasured]
    index = [known * end + i for end in range(ends) for i in one]
    return n[index], N[np.ix_(index, index)]


def _place(sensor: Sensor, z: Vec) -> str:
    """Where something was seen, in words; of a segment both ends."""
    ends = z.reshape(-1, sensor.measurement_size)
    units = list(zip(sensor.labels, sensor.units, strict=True))
    return " to ".join(
        ", ".join(
            f"{name} {value:.{1 if unit == 'px' else 3}f} {unit}"
            for (name, unit), value in zip(units, end, strict=True)
        )
        for end in ends
    )


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
        at = "a corner" if isinstance(frame.raw.get(mount), Image) else "a measurement"
        text = f"no feature started: there is nothing to recognise here; point at {at}"
        return world, Event(world.frame, "info", text)
    there = _mapped_as(world, detection)
    if there is not None:
        text = f"no feature started: this is feature {there} already; click it to select it"
        return world, Event(world.frame, "info", text)
    return initialise(world, mount, detection)


def _mapped_as(world: World, detection: Detection) -> Label | None:
    """The feature that has the identity of a detection: none is mapped twice."""
    if not isinstance(detection.appearance, int | np.integer):
        return None
    alike = (f for f in world.features.values() if f.model.shape == detection.shape)
    return next((f.label for f in alike if f.appearance == detection.appearance), None)


def end_rays(at: SensorState, z: Vec) -> Vec:
    """Unit rays (..., 2, 3), in the world, through both ends z (..., 4) of segments."""
    sensor, ends = at.mount.sensor, z.reshape(*z.shape[:-1], 2, 2)
    X = sensor.backproject(ends, np.zeros((*ends.shape[:-1], 1)), at.k).X
    return sensor.space.to_world(at.xws, X).X[..., :3]
