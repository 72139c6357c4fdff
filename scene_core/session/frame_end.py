"""What may be done at the end of a frame: a feature is started at a click or deleted by hand, the
axes are moved."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from time import perf_counter

from scene_core.filter.axes import redefine
from scene_core.filter.birth import initialise_at
from scene_core.filter.manage import delete
from scene_core.filter.ports import Source
from scene_core.filter.records import Event, PhaseRecord, Trace
from scene_core.filter.world import World
from scene_core.params import ParamError
from scene_core.session.axes import zeroed
from scene_core.session.commands import DeleteFeature, InitialiseAt, ZeroAxes

AtEnd = InitialiseAt | DeleteFeature | ZeroAxes
"""Commands that act at the end of a frame."""


@dataclass(frozen=True, eq=False)
class Deed:
    """A command at the end of a frame; given twice it is two deeds."""

    frame: int
    command: AtEnd

    @property
    def name(self) -> str:
        match self.command:
            case InitialiseAt():
                return "the feature started by hand"
            case DeleteFeature(label):
                return f"the deletion of feature {label}"
            case ZeroAxes():
                return "the move of the axes"


def check(
    command: AtEnd, world: World, frame: int, half_stepped: bool, measured: Container[str]
) -> None:
    """Raise ParamError when a command makes no sense in a frame, in which the sensors `measured`
    did measure: what is refused is refused now, not when the frame is complete."""
    if isinstance(command, InitialiseAt):
        _check_click(command, world, frame, measured)
    elif isinstance(command, DeleteFeature):
        if frame < 0:
            raise ParamError("no frame yet to delete a feature in: step to the first one")
        _check_deletion(command, world)
    elif frame < 0:
        raise ParamError("no frame yet to put the axes into: step to the first one")
    elif half_stepped:
        redefine(world, command.robot)


def _check_click(command: InitialiseAt, world: World, frame: int, measured: Container[str]) -> None:
    if command.mount not in world.mounts:
        raise ParamError(f"there is no sensor '{command.mount}' to point into")
    if frame < 0:
        raise ParamError("no frame yet to point into: step to the first one")
    if command.frame != frame:
        raise ParamError(
            f"the feature was pointed at in frame {command.frame}, but this is frame "
            f"{frame}: pause, then click"
        )
    _check_place(command, world, measured)


def _check_place(command: InitialiseAt, world: World, measured: Container[str]) -> None:
    """Whether the sensor measured, and that many coordinates: at a replay it may be another one, or
    have another rate."""
    if command.mount not in measured:
        raise ParamError(
            f"no feature started: sensor '{command.mount}' measured nothing in this frame; step "
            "to one in which it does, then click"
        )
    size = world.mounts[command.mount].sensor.measurement_size
    if not 1 <= len(command.z) <= size:
        raise ParamError(
            f"no feature started: a place in sensor '{command.mount}' has up to {size} coordinates"
        )


def _check_deletion(command: DeleteFeature, world: World) -> None:
    feature = world.features.get(command.label)
    if feature is None:
        raise ParamError(f"there is no feature {command.label} to delete")
    if feature.carrier:
        raise ParamError(
            f"feature {command.label} is a marker on robot '{feature.carrier}': it is there as "
            "long as the robot"
        )


def waiting(command: AtEnd) -> str:
    """What is said until the frame is complete."""
    match command:
        case InitialiseAt():
            return "the feature is started when this frame is complete"
        case DeleteFeature(label):
            return f"feature {label} is deleted when this frame is complete"
        case ZeroAxes():
            return "the axes are moved when this frame is complete"


def done(trace: Trace, command: AtEnd, source: Source) -> PhaseRecord:
    """One more phase of a complete frame. Raises ParamError when it can not be."""
    t0, mount = perf_counter(), None
    match command:
        case ZeroAxes(robot):
            return zeroed(trace, robot)
        case DeleteFeature(label):
            _check_deletion(command, trace.world)
            world = delete(trace.world, [label])
            event = Event(trace.frame.index, "deleted", f"{label} deleted: by hand", label)
        case InitialiseAt(mount, z, _):
            _check_place(command, trace.world, trace.frame.raw)
            world, event = initialise_at(trace.world, trace.frame, source, mount, z)
    ms = 1e3 * (perf_counter() - t0)
    return PhaseRecord("manage", mount, world, ms, events=(event,))


def refused(trace: Trace, why: ParamError) -> PhaseRecord:
    """The phase that says why nothing was done."""
    event = Event(trace.frame.index, "info", str(why))
    return PhaseRecord("manage", None, trace.world, 0.0, events=(event,))
