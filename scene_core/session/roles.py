"""What can be swapped in an experiment, and the settings a swap leads to."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

from scene_core import params
from scene_core.models import registry
from scene_core.models.segments import seen_by
from scene_core.params import ParamError
from scene_core.session.config import Experiment, MountSettings, RobotSettings
from scene_core.session.exchange import exchangeable, exchanged
from scene_core.session.fit import fitted
from scene_core.session.instrument_roles import ROLE as INSTRUMENTS
from scene_core.session.instrument_roles import (
    instrument_models,
    instrument_roles,
    renewed,
    with_instrument,
)
from scene_core.session.published import RoleOptions
from scene_core.session.simulated_roles import simulated_roles, with_simulated
from scene_core.session.start import sd_labels, sds_of, start_state
from scene_core.session.true_motion import with_true_motion
from scene_core.session.versions import is_outdated, made

CHOICES = {
    "estimator.policies.selection.score": "Selection score",
    "estimator.policies.association.kind": "Association",
    "estimator.policies.update.kind": "Update",
}
LANDMARK = "estimator.policies.landmark"
LINE = "estimator.policies.line"
NO_LINES = "none"
"""Lines are seen by nobody and not mapped."""


def role_options(experiment: Experiment, base: Experiment | None = None) -> tuple[RoleOptions, ...]:
    """The rows of the Models tab: what there is of the same dimension. A choice that makes no
    sense is refused with its reason when it is made. The scenario's own settings, `base`, tell what
    can be put back that is not there any more."""
    estimator = experiment.estimator
    out = []
    for name, robot in estimator.robots.items():
        options = _names("motion", space=robot.motion.space)
        role = f"estimator.robots.{name}.motion"
        out.append(RoleOptions(role, f"Motion of {name}", robot.motion.name, options))
    for name, mount in estimator.mounts.items():
        alike = _names("sensors", space=mount.sensor.space, labels=mount.sensor.labels)
        options = tuple(dict.fromkeys((*alike, *exchangeable(experiment, name))))
        role = f"estimator.mounts.{name}.sensor"
        out.append(RoleOptions(role, f"Sensor {name}", mount.sensor.name, options))
    landmark = estimator.policies.landmark
    options = _names("features", space=landmark.space, shape="point")
    out.append(RoleOptions(LANDMARK, "New landmarks", landmark.name, options))
    if any(seen_by(mount.sensor) is None for mount in estimator.mounts.values()):
        line = estimator.policies.line
        options = (NO_LINES, *_names("features", shape="segment"))
        out.append(RoleOptions(LINE, "New lines", line.name if line else NO_LINES, options))
    out += instrument_roles(experiment, base or experiment)
    specs = {s.path: s for s in params.schema(estimator.policies, "estimator.policies")}
    for path, title in CHOICES.items():
        out.append(RoleOptions(path, title, specs[path].value, specs[path].choices or ()))
    for name, robot in true_robots(experiment).items():
        options = _names("motion", space=robot.motion.space)
        role = f"source.robots.{name}.motion"
        out.append(RoleOptions(role, f"Truth: motion of {name}", robot.motion.name, options))
    for name, mount in _true_mounts(experiment).items():
        options = _names("sensors", space=mount.sensor.space, labels=mount.sensor.labels)
        role = f"source.mounts.{name}.sensor"
        out.append(RoleOptions(role, f"Truth: sensor {name}", mount.sensor.name, options))
    return (*out, *simulated_roles(experiment))


def swapped(
    experiment: Experiment, base: Experiment, role: str, name: str
) -> tuple[Experiment, str]:
    """The experiment with another model in a role, and a sentence about what was fitted.

    The scenario's own model comes back with the scenario's own parameters. Raises ParamError with
    the reason when the swap makes no sense.
    """
    if role in CHOICES:
        note = f"{CHOICES[role].lower()}: {name} from the next frame on; poses and map kept"
        return params.replace(experiment, role, name), note
    if role.startswith(INSTRUMENTS):
        if role.removeprefix(INSTRUMENTS) in experiment.estimator.robots:
            return with_instrument(experiment, base, role, name)
    if role in instrument_models(experiment):
        return renewed(experiment, role, name), ""
    known = {r.role: r for r in role_options(experiment, base)}
    if role not in known:
        raise ParamError(f"no role '{role}': choose one of {', '.join(known)}")
    kind = _kind(role)
    if kind and name not in registry.models(kind) and name in registry.refused(kind):
        raise ParamError(registry.refused(kind)[name])
    mount = role.split(".")[2] if role.startswith("estimator.mounts.") else ""
    if mount and name in registry.models(kind) and _measures_else(experiment, mount, name):
        return exchanged(experiment, base, mount, name)
    what, row = "model " if kind else "", known[role]
    if name not in row.options:
        raise ParamError(f"no {what}'{name}' for {role}: choose {', '.join(row.options)}")
    if name == row.current and not (kind and is_outdated(params.get(experiment, role))):
        return experiment, f"{row.title} is already '{name}'"
    if not kind:
        return with_simulated(experiment, base, role, name)
    return _with_model(experiment, base, role, name)


def _with_model(
    experiment: Experiment, base: Experiment, role: str, name: str
) -> tuple[Experiment, str]:
    """The experiment with another motion model, sensor or parametrisation."""
    if role == LANDMARK:
        return _with_landmark(experiment, base, name), ""
    if role == LINE:
        return _with_line(experiment, base, name), ""
    owner_path = role.rpartition(".")[0]
    owner, original = params.get(experiment, owner_path), params.get(base, owner_path)
    if role.startswith("source.") and role.endswith(".motion"):
        own = original.motion.name == name and not is_outdated(original.motion)
        motion = original.motion if own else made("motion", name, owner.motion)
        return with_true_motion(experiment, base, role.split(".")[2], motion)
    if role.endswith(".motion"):
        after, note = _with_motion(owner, original, name), ""
    elif original.sensor.name == name and not is_outdated(original.sensor):
        after, note = original, "the scenario's own calibration"
    else:
        after, note = _with_sensor(owner, name)
    return params.put(experiment, owner_path, after), note


def outdated(experiment: Experiment) -> list[tuple[str, str]]:
    """Roles whose model is an earlier version of what its file holds now, with its name."""
    others = {*CHOICES, *(r.role for r in simulated_roles(experiment))}
    rows = (r for r in role_options(experiment) if not r.role.startswith(INSTRUMENTS))
    models = {r.role: params.get(experiment, r.role) for r in rows if r.role not in others}
    models |= instrument_models(experiment)
    return [(role, model.name) for role, model in models.items() if is_outdated(model)]


def _measures_else(experiment: Experiment, mount: str, name: str) -> bool:
    """Whether a sensor of the same dimension measures something else than the one at a mount."""
    now, new = experiment.estimator.mounts[mount].sensor, registry.model_class("sensors", name)()
    return new.space is now.space and new.labels != now.labels


def _kind(role: str) -> str:
    """The kind of model a role is for; nothing for a role that is not a model's."""
    if role in (LANDMARK, LINE):
        return "features"
    kinds = {"motion": "motion", "sensor": "sensors"}
    return kinds.get(role.rpartition(".")[2], "")


@cache
def _example(model: type[Any]) -> Any:
    """A model with its defaults: what a class is may follow from its fields."""
    return model()


def _names(kind: str, **same: Any) -> tuple[str, ...]:
    """Names of the models of a kind whose attributes are as given."""
    found = ((name, _example(cls)) for name, cls in registry.models(kind).items())
    fitting = [n for n, model in found if all(getattr(model, k) == v for k, v in same.items())]
    # One that does not conform can be looked for here, and is refused with the reason.
    return tuple(dict.fromkeys((*fitting, *registry.refused(kind))))


def true_robots(experiment: Experiment) -> dict[str, Any]:
    """The simulator's own robots; a recording has none."""
    robots = getattr(experiment.source, "robots", None)
    return dict(robots) if isinstance(robots, dict) else {}


def _true_mounts(experiment: Experiment) -> dict[str, Any]:
    """The simulator's own mounts; a recording has none."""
    mounts = getattr(experiment.source, "mounts", None)
    return dict(mounts) if isinstance(mounts, dict) else {}


def _with_landmark(experiment: Experiment, base: Experiment, name: str) -> Experiment:
    original = base.estimator.policies.landmark
    if original.name == name and not is_outdated(original):
        model = original
    else:
        model = made("features", name, experiment.estimator.policies.landmark)
    for mount in experiment.estimator.mounts.values():
        reason = registry.compatible(mount.sensor, model)
        if reason:
            raise ParamError(reason)
    return params.put(experiment, LANDMARK, model)


def _with_line(experiment: Experiment, base: Experiment, name: str) -> Experiment:
    """New lines in another parametrisation, or none; one sensor that sees them is enough."""
    if name == NO_LINES:
        return params.put(experiment, LINE, None)
    original, old = (e.estimator.policies.line for e in (base, experiment))
    if original is not None and original.name == name and not is_outdated(original):
        model = original
    else:
        model = made("features", name, old)
    reasons = [registry.compatible(m.sensor, model) for m in experiment.estimator.mounts.values()]
    if all(reasons):
        raise ParamError(str(reasons[0]))
    return params.put(experiment, LINE, model)


def _with_motion(settings: RobotSettings, original: RobotSettings, name: str) -> RobotSettings:
    """Another motion model. Where the robot starts is said in the new model's components; those
    it did not have start as its `lift` says."""
    if original.motion.name == name and not is_outdated(original.motion):
        return original
    motion = made("motion", name, settings.motion)
    xv, _ = start_state("start", settings)
    lifted = motion.lift(settings.motion.xp(xv).xp)
    labels = motion.state_labels
    start = {s: float(x) for s, x in zip(labels, lifted.xv, strict=True)}
    start |= {s: x for s, x in settings.start.items() if s in labels}
    rest = sds_of(labels, lifted.xv, lifted.P_rest)
    had = sd_labels(settings.motion.state_labels)
    sd = {s: v for s, v in rest.items() if v > 0 and s not in had}
    sd |= {s: x for s, x in settings.start_sd.items() if s in sd_labels(labels)}
    calib_sd = {s: x for s, x in settings.calib_sd.items() if s in motion.calib_labels}
    return replace(settings, motion=motion, start=start, start_sd=sd, calib_sd=calib_sd)


def _with_sensor(settings: MountSettings | Any, name: str) -> tuple[Any, str]:
    """Another sensor that sees the same; of a mount of the estimator or of the simulator."""
    new = made("sensors", name, settings.sensor)
    is_fitted = settings.sensor.name != name and hasattr(new, "with_calib")
    sensor, rms = fitted(settings.sensor, new) if is_fitted else (new, 0.0)
    labels = sensor.calib_labels
    if isinstance(settings, MountSettings):
        kept = {s: x for s, x in settings.calib_sd.items() if s in labels}
        after = replace(settings, sensor=sensor, calib_sd=kept)
    else:
        after = replace(settings, sensor=sensor, calib={}, calib_sd={})
    if not is_fitted:
        return after, ""
    unit = sensor.units[0]
    return after, f"calibration fitted so that it sees the same, to {rms:.2g} {unit} rms"
