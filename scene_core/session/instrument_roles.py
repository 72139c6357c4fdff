"""Instruments put on robots and taken off while the run goes on: a simulation gets what the
estimator gets, a recording has what it has."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from scene_core import params
from scene_core.models import registry
from scene_core.models.base import InternalMeasurementModel
from scene_core.params import ParamError
from scene_core.session.config import EstimatorSettings, Experiment, InstrumentSettings
from scene_core.session.published import RoleOptions
from scene_core.session.versions import latest, made
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueInstrument

ROLE = "estimator.instruments:"
"""Followed by the robot."""
ADD, REMOVE, NONE = "add ", "remove ", "none"


def instrument_roles(experiment: Experiment, base: Experiment) -> list[RoleOptions]:
    """A row per robot that may have any: what it has, and what could be added or taken off."""
    out = []
    for robot in experiment.estimator.robots:
        on, off = _on(experiment, robot), _off(experiment, base, robot)
        choices = (*(REMOVE + name for name in on), *(ADD + name for name in off))
        if choices:
            title = f"Instruments of {robot}"
            out.append(RoleOptions(ROLE + robot, title, ", ".join(on) or NONE, choices))
    return out


def with_instrument(
    experiment: Experiment, base: Experiment, role: str, choice: str
) -> tuple[Experiment, str]:
    """The experiment with an instrument more or less, and a sentence. Raises ParamError with the
    reason when a robot has no use for it, or when nothing measures it."""
    robot = role.removeprefix(ROLE)
    on, off = _on(experiment, robot), _off(experiment, base, robot)
    if choice.startswith(REMOVE) and choice.removeprefix(REMOVE) in on:
        name = choice.removeprefix(REMOVE)
        return _without(experiment, name), f"{robot} has no {name} any more"
    name = choice.removeprefix(ADD)
    if not choice.startswith(ADD) or name not in off:
        raise ParamError(_why_not(experiment, robot, name, (*on, *off)))
    model, true = off[name]
    settings = experiment.estimator.instruments
    believed = {**settings, name: InstrumentSettings(robot, model)}
    after = _put(experiment, believed)
    if isinstance(experiment.source, Simulation):
        truly = {**experiment.source.instruments, name: TrueInstrument(robot, true)}
        after = replace(after, source=replace(experiment.source, instruments=truly))
        return after, f"{robot} has a {name}, in belief and in truth"
    return after, f"{robot} has its {name} again"


def instrument_models(experiment: Experiment) -> dict[str, InternalMeasurementModel]:
    """The models of all instruments, as believed and as they truly are, by their path."""
    believed, source = experiment.estimator.instruments, experiment.source
    truly = source.instruments if isinstance(source, Simulation) else {}
    return {
        f"{side}.instruments.{name}.model": one.model
        for side, there in (("estimator", believed), ("source", truly))
        for name, one in there.items()
    }


def renewed(experiment: Experiment, role: str, name: str) -> Experiment:
    """The experiment with an instrument in the version its file holds now. Raises ParamError where
    that can not be measured."""
    old = params.get(experiment, role)
    if name != old.name:
        raise ParamError(
            f"'{name}' can not take the place of '{old.name}': take that off, then add the other"
        )
    new = made("internal", name, old)
    source = experiment.source
    if isinstance(source, Simulation):
        # Belief and truth stay at one version: both are refused what the truth can not feel.
        true = source.instruments.get(role.split(".")[2])
        reason = true and registry.runs_on(new, source.robots[true.robot].motion)
        if reason:
            raise ParamError(reason)
    elif new.labels != old.labels:
        raise ParamError(f"the recording has {', '.join(old.labels)} for '{name}', nothing else")
    return params.put(experiment, role, new)


def _on(experiment: Experiment, robot: str) -> tuple[str, ...]:
    """Instruments of a robot."""
    there = experiment.estimator.instruments.items()
    return tuple(name for name, one in there if one.robot == robot)


def _off(experiment: Experiment, base: Experiment, robot: str) -> dict[str, tuple[Any, Any]]:
    """Instruments that could be added to a robot, as they are believed to be and truly are: those
    of the scenario that were taken off, and in a simulation every other that runs on it."""
    on = experiment.estimator.instruments
    estimator: EstimatorSettings = base.estimator
    own = {
        n: latest(i.model)
        for n, i in estimator.instruments.items()
        if i.robot == robot and n not in on
    }
    source = experiment.source
    if not isinstance(source, Simulation):
        return {name: (model, model) for name, model in own.items()}
    truth = base.source.instruments if isinstance(base.source, Simulation) else {}
    out = {n: (m, latest(truth[n].model) if n in truth else m) for n, m in own.items()}
    used = {one.model.name for one in on.values() if one.robot == robot}
    used |= {model.name for model in own.values()}
    motions = [experiment.estimator.robots[robot].motion]
    motions += [source.robots[robot].motion] if robot in source.robots else []
    for name, cls in registry.models("internal").items():
        model = cls()
        fits = all(registry.runs_on(model, motion) is None for motion in motions)
        if robot in source.robots and fits and name not in used:
            out[name if name not in on else f"{name} of {robot}"] = (model, model)
    return out


def _why_not(experiment: Experiment, robot: str, name: str, known: tuple[str, ...]) -> str:
    if name in registry.refused("internal"):
        return registry.refused("internal")[name]
    if name in registry.models("internal"):
        model = registry.model_class("internal", name)()
        reason = registry.runs_on(model, experiment.estimator.robots[robot].motion)
        if reason:
            return reason
        if not isinstance(experiment.source, Simulation):
            return f"the recording has no measurements of '{name}'"
    return f"no instrument '{name}' for {robot}: there are {', '.join(known) or NONE}"


def _without(experiment: Experiment, name: str) -> Experiment:
    rest = {n: i for n, i in experiment.estimator.instruments.items() if n != name}
    after, source = _put(experiment, rest), experiment.source
    if not isinstance(source, Simulation):
        return after
    truly = {n: i for n, i in source.instruments.items() if n != name}
    return replace(after, source=replace(source, instruments=truly))


def _put(experiment: Experiment, instruments: dict[str, InstrumentSettings]) -> Experiment:
    return replace(experiment, estimator=replace(experiment.estimator, instruments=instruments))
