"""What can be swapped in a simulation: its world, and who drives its robots."""

from __future__ import annotations

from typing import Any

from scene_core import params
from scene_core.filter.ports import SourceError
from scene_core.params import ParamError
from scene_core.session import polymorphic
from scene_core.session.config import Experiment
from scene_core.session.published import RoleOptions
from scene_core.sources import wheel
from scene_core.sources.drivers import Driver
from scene_core.sources.simulated import Simulation
from scene_core.sources.worlds import SimulatedWorld

WORLD = "source.world"


def simulated_roles(experiment: Experiment) -> tuple[RoleOptions, ...]:
    """The world and the drivers of a simulation; none of a recording. Rendered images are those of
    the one world that can be rendered."""
    source = experiment.source
    if not isinstance(source, Simulation):
        return ()
    out = []
    if source.rendering is None:
        fits = [name for name, cls in _classes(SimulatedWorld).items() if _fits(cls, source)]
        out.append(RoleOptions(WORLD, "Truth: world", source.world.name, tuple(fits)))
    drivers = tuple(_classes(Driver))
    for name, robot in source.robots.items():
        role = f"source.robots.{name}.driver"
        out.append(RoleOptions(role, f"Truth: driver of {name}", robot.driver.name, drivers))
    return tuple(out)


def with_simulated(
    experiment: Experiment, base: Experiment, role: str, name: str
) -> tuple[Experiment, str]:
    """The experiment with another world or driver, and a sentence about it. The scenario's own
    comes back as the scenario has it. Raises ParamError where it makes no sense."""
    original = params.get(base, role)
    if role == WORLD:
        if experiment.estimator.known and name != original.name:
            raise ParamError(
                f"the estimator is given landmarks of the world '{original.name}' at the start: "
                f"they are not in '{name}'; load a scenario without known landmarks"
            )
        new = original if original.name == name else _classes(SimulatedWorld)[name]()
        return _with_world(experiment, new)
    assert isinstance(experiment.source, Simulation)
    own = original.name == name
    new = original if own else _classes(Driver)[name]().upright(experiment.source.up)
    after, who = params.put(experiment, role, new), role.split(".")[2]
    check_truth(after)
    return after, f"'{name}' drives '{who}' from the next frame on"


def check_truth(experiment: Experiment) -> None:
    """Raises ParamError when a simulation could not be started: a driver that can not drive its
    robot, a calibration nothing has, no ground below a robot that is kept on it."""
    source = experiment.source
    if not isinstance(source, Simulation):
        return
    try:
        # A world that waits for its file can not be started whatever robots and sensors are.
        wheel.check_drivers(source.robots) if source.world.wanting() else source.start()
    except SourceError as e:
        raise ParamError(str(e)) from e


def _with_world(experiment: Experiment, world: SimulatedWorld) -> tuple[Experiment, str]:
    """Raises ParamError for a world in which this simulation can not be started."""
    after = params.put(experiment, WORLD, world)
    wanting = world.wanting()
    if wanting:
        return after, f"takes effect on reset; before that {wanting}"
    try:
        after.source.start()
    except SourceError as e:
        raise ParamError(str(e)) from e
    return after, "takes effect on reset"


def _classes(base: type[Any]) -> dict[str, type[Any]]:
    found = polymorphic.variants(base)
    assert found is not None
    return dict(found[1])


def _fits(cls: type[SimulatedWorld], source: Simulation) -> bool:
    """Whether what measures this simulation can measure a world of this class."""
    spaces = [mount.sensor.space for mount in source.mounts.values()]
    if not source.world.any_space:
        spaces.append(source.world.space)
    return cls.any_space or cls.space in spaces
