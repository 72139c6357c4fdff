"""What may be done at the end of a frame: a feature is started at a click, the axes are moved."""

from __future__ import annotations

from time import perf_counter

from scene_core.filter.axes import redefine
from scene_core.filter.birth import initialise_at
from scene_core.filter.ports import Source
from scene_core.filter.records import Event, PhaseRecord, Trace
from scene_core.filter.world import World
from scene_core.params import ParamError
from scene_core.session.axes import zeroed
from scene_core.session.commands import InitialiseAt, ZeroAxes

AtEnd = InitialiseAt | ZeroAxes
"""Commands that act at the end of a frame."""


def check(command: AtEnd, world: World, frame: int, half_stepped: bool) -> None:
    """Raise ParamError when a command makes no sense in a frame: what is refused is refused now,
    not when the frame is complete."""
    if isinstance(command, InitialiseAt):
        _check_click(command, world, frame)
    elif frame < 0:
        raise ParamError("no frame yet to put the axes into: step to the first one")
    elif half_stepped:
        redefine(world, command.robot)


def _check_click(command: InitialiseAt, world: World, frame: int) -> None:
    if command.mount not in world.mounts:
        raise ParamError(f"there is no sensor '{command.mount}' to point into")
    if frame < 0:
        raise ParamError("no frame yet to point into: step to the first one")
    if command.frame != frame:
        raise ParamError(
            f"the feature was pointed at in frame {command.frame}, but this is frame "
            f"{frame}: pause, then click"
        )
    size = world.mounts[command.mount].sensor.measurement_size
    if not 1 <= len(command.z) <= size:
        raise ParamError(f"a place in sensor '{command.mount}' has up to {size} coordinates")


def waiting(command: AtEnd) -> str:
    """What is said until the frame is complete."""
    if isinstance(command, InitialiseAt):
        return "the feature is started when this frame is complete"
    return "the axes are moved when this frame is complete"


def done(trace: Trace, command: AtEnd, source: Source) -> PhaseRecord:
    """One more phase of a complete frame. Raises ParamError when it can not be."""
    if isinstance(command, ZeroAxes):
        return zeroed(trace, command.robot)
    t0 = perf_counter()
    world, event = initialise_at(trace.world, trace.frame, source, command.mount, command.z)
    ms = 1e3 * (perf_counter() - t0)
    return PhaseRecord("manage", command.mount, world, ms, events=(event,))


def refused(trace: Trace, why: ParamError) -> PhaseRecord:
    """The phase that says why nothing was done."""
    event = Event(trace.frame.index, "info", str(why))
    return PhaseRecord("manage", None, trace.world, 0.0, events=(event,))
