"""A sensor of another measurement type, in a simulation: the estimator and the simulator get it
together, at the same place and looking the same way."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from scene_core import params
from scene_core.arrays import Mat, Vec
from scene_core.geometry import quaternion
from scene_core.models import registry
from scene_core.models.base import FeatureModel, Sensor, completed
from scene_core.params import ParamError
from scene_core.session.config import Experiment, MountSettings
from scene_core.session.start import final_model
from scene_core.sources.simulated import Simulation


def exchangeable(experiment: Experiment, mount: str) -> tuple[str, ...]:
    """Names of the sensors of another measurement type that could be at a mount: in a simulation
    of landmarks with identities those of its world's dimension; on anything recorded, none."""
    source, now = experiment.source, experiment.estimator.mounts[mount]
    if not _has(source, mount):
        return ()
    motion = experiment.estimator.robots[now.robot].motion
    return tuple(
        name
        for name, sensor in _sensors()
        if sensor.space is now.sensor.space
        and sensor.labels != now.sensor.labels
        and registry.carriable(motion, sensor) is None
    )


def exchanged(
    experiment: Experiment, base: Experiment, mount: str, name: str
) -> tuple[Experiment, str]:
    """The experiment with a sensor of another measurement type at a mount, in belief and in truth,
    and a sentence about it. The scenario's own comes back as the scenario has it. Raises ParamError
    where there is nothing else to measure."""
    source, now = experiment.source, experiment.estimator.mounts[mount]
    if not isinstance(source, Simulation) or not _has(source, mount):
        new: Sensor = registry.model_class("sensors", name)()
        raise ParamError(
            f"'{name}' measures {', '.join(new.labels)}, and the input has "
            f"{', '.join(now.sensor.labels)} of '{mount}': only a simulation without pictures can "
            "measure something else"
        )
    true = source.mounts[mount]
    if type(now.sensor) is not type(true.sensor):
        # Equal names mean the same thing in one model only, e.g. focal lengths of two lenses.
        now = replace(now, sensor=true.sensor)
    own = base.estimator.mounts[mount].sensor.name == name
    source_mounts = base.source.mounts if isinstance(base.source, Simulation) else {}
    believed = base.estimator.mounts[mount] if own else _fitted(now, name)
    after = params.put(experiment, f"estimator.mounts.{mount}", believed)
    really = source_mounts[mount] if own else _fitted(true, name)
    after = params.put(after, f"source.mounts.{mount}", really)
    note = f"the estimator and the truth measure {', '.join(believed.sensor.labels)} from now on"
    landmark = _landmark(base, experiment.estimator.policies.landmark, believed.sensor)
    if landmark is None:
        return after, f"{note}; it starts no landmarks of its own"
    if landmark is not experiment.estimator.policies.landmark:
        note = f"{note}; new landmarks by '{landmark.name}', which it can start"
    return params.put(after, "estimator.policies.landmark", landmark), note


def _has(source: Any, mount: str) -> bool:
    if not isinstance(source, Simulation) or source.rendering is not None:
        return False
    return mount in source.mounts


def _sensors() -> list[tuple[str, Sensor]]:
    return [(name, cls()) for name, cls in registry.models("sensors").items()]


def _fitted(mount: Any, name: str) -> Any:
    """A mount, of the estimator or of the simulator, with another sensor that has what the old one
    has by the same name, e.g. the size of its pictures, and looks the same way."""
    old = mount.sensor
    new: Any = registry.model_class("sensors", name)()
    shared = {f.name for f in fields(new)} & {f.name for f in fields(old)}
    # A noise in pixels is none in metres: only what has the same unit is the same thing.
    same = {f for f in shared if _unit(old, f) == _unit(new, f)}
    sensor = replace(new, **{f: getattr(old, f) for f in same})
    labels = sensor.calib_labels
    pose = _facing(mount.pose, old, sensor)
    sd = {s: x for s, x in mount.calib_sd.items() if s in labels}
    fitted = replace(mount, sensor=sensor, pose=pose, calib_sd=sd)
    if isinstance(mount, MountSettings):
        return fitted
    true = {s: k for s, k in mount.calib.items() if s in labels}
    return replace(fitted, calib=true, margin=0.0)


def _unit(sensor: Any, name: str) -> Any:
    return next(f.metadata.get("param", {}).get("unit") for f in fields(sensor) if f.name == name)


def _facing(pose: tuple[float, ...], old: Sensor, new: Sensor) -> tuple[float, ...]:
    """x_RS in which the new sensor looks where the old one did."""
    if old.space.d < 3:
        return pose
    R = _ahead(old) @ _ahead(new).T
    w, x, y, z = quaternion.product(np.array(pose[3:]), quaternion.from_matrix(R))
    return (*pose[:3], float(w), float(x), float(y), float(z))


def _ahead(sensor: Sensor) -> Mat:
    """Forward, left and up as columns (3, 3) in a sensor's own axes: forward is the middle of what
    it measures; up is where its elevation grows, or where an image's v falls."""
    z = np.array(sensor.limits).mean(axis=1)
    n, k = np.ones(len(sensor.unmeasured)), sensor.calib0
    X, by_z, _, _ = completed(sensor.backproject(z, n, k), sensor.backproject, z, n, k)
    assert by_z is not None
    vertical = next(
        (i for i, s in enumerate(sensor.labels) if s == "elevation" or s.startswith("v")), None
    )
    forward = _nearest_axis(X[:3])
    if vertical is None:
        raise ParamError(f"'{sensor.name}' does not say which way is up: it can not take over")
    sign = 1.0 if sensor.labels[vertical] == "elevation" else -1.0
    up = _nearest_axis(sign * by_z[:3, vertical])
    return np.column_stack([forward, np.cross(up, forward), up])


def _nearest_axis(v: Vec) -> Vec:
    out = np.zeros(3)
    i = int(np.argmax(np.abs(v)))
    out[i] = np.sign(v[i])
    return out


def _landmark(base: Experiment, now: FeatureModel, sensor: Sensor) -> FeatureModel | None:
    """What the sensor starts new landmarks as: what is used now, what the scenario has, what that
    ends as, or the smallest parametrisation that ends as the same; None if there is none."""
    last = final_model(now)
    others = [cls() for cls in registry.models("features").values()]
    kin = [m for m in others if m.shape == last.shape and type(final_model(m)) is type(last)]
    order = (now, base.estimator.policies.landmark, last, *sorted(kin, key=_plainness))
    return next((m for m in order if registry.compatible(sensor, m) is None), None)


def _plainness(model: FeatureModel) -> tuple[int, int]:
    return len(model.free_labels), model.state_size
