"""The headless session: an experiment, where it stands, its past, and what was asked of it.

`scene run` and the page use this object. The numbers of a run depend on its settings, its seed and
the commands only: pausing, stepping by phase, stepping back and redoing in between change no bit.
"""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from time import perf_counter
from typing import Any

from scene_core.filter.axes import redefine
from scene_core.filter.birth import initialise_at
from scene_core.filter.ports import EndOfData, Frame, SourceError
from scene_core.filter.records import Event, PhaseRecord, Trace
from scene_core.filter.step import step
from scene_core.filter.world import World
from scene_core.params import ParamError
from scene_core.session.axes import zeroed
from scene_core.session.commands import (
    Command,
    InitialiseAt,
    Redo,
    ResetParams,
    Seek,
    Select,
    SetParam,
    SetParams,
    SwapModel,
    Transport,
    Undo,
    ZeroAxes,
)
from scene_core.session.config import Experiment
from scene_core.session.edits import (
    Edit,
    Settings,
    same_values,
    set_params,
    until_reset,
    uses,
    values_of,
    waits,
)
from scene_core.session.history import History, Moment
from scene_core.session.metrics import Metrics
from scene_core.session.roles import outdated, swapped
from scene_core.session.start import initial_world, resting
from scene_core.session.swap import reconfigure

HISTORY_BYTES = 256 * 2**20
KEPT_EVENTS = 2000


AtEnd = InitialiseAt | ZeroAxes
"""Commands that act at the end of a frame."""


@dataclass
class OpenFrame:
    """A frame some phases of which are done."""

    frame: Frame
    start: World
    state: Any
    """Of the source, after the frame."""
    settings: Settings
    phases: Iterator[PhaseRecord]
    expected: int
    """How many phases it should have."""
    source_ms: float
    notes: tuple[str, ...] = ()
    """What a swap at its start kept and restarted."""
    records: list[PhaseRecord] = field(default_factory=list)

    def trace(self, complete: bool) -> Trace:
        return Trace(self.frame, self.start, tuple(self.records), complete)


@dataclass(frozen=True)
class LoggedEdit:
    """A command, and the settings it led to."""

    command: Edit
    settings: Settings


class Session:
    """One run of one experiment at a time. Not thread-safe: one thread owns it."""

    def __init__(self, experiment: Experiment, history_bytes: int = HISTORY_BYTES) -> None:
        self.run = 0
        """Grows when a scenario is loaded or reset."""
        self.selected: int | None = None
        self.message = ""
        """What the last command did."""
        self._history_bytes = history_bytes
        self.load(experiment)

    # What there is.

    @property
    def experiment(self) -> Experiment:
        """Settings in force."""
        return self._in_force.experiment

    @property
    def running(self) -> Experiment:
        """What the frames are computed with: the settings in force, less what waits for a reset."""
        return self._running(self._in_force)

    @property
    def pending(self) -> Experiment | None:
        """Settings from the next frame on, when they differ."""
        edited = self.settings.experiment
        return None if edited is self.experiment else edited

    @property
    def settings(self) -> Settings:
        """As last edited: in force now or with the next frame."""
        return self._settings_at(self._next)

    @property
    def frame(self) -> int:
        """The frame that is being stepped through, or was last completed; -1 before the first."""
        return self._open.frame.index if self._open else self._at.frame

    @property
    def half_stepped(self) -> bool:
        """Whether some phases of the present frame are still to come."""
        return self._open is not None

    @property
    def world(self) -> World:
        """The estimate after the last phase that was computed."""
        return self.trace.world if self.trace else self._at.world

    @property
    def trace(self) -> Trace | None:
        """The present frame, as far as it was computed; None before the first."""
        return self._open.trace(complete=False) if self._open else self._trace

    @property
    def first_frame(self) -> int:
        """The oldest frame `seek` can reach."""
        return 0 if self.last_frame >= 0 else -1

    @property
    def last_frame(self) -> int:
        """The newest frame `seek` can reach."""
        return self._history.last

    @property
    def frame_count(self) -> int | None:
        """How many frames the run can have; None when it has no end."""
        counts = [self.experiment.frames, self.running.source.frame_count]
        return min((c for c in counts if c is not None), default=None)

    @property
    def events(self) -> tuple[Event, ...]:
        """Newest first, at most 200."""
        past = (event for event in reversed(self._events) if event.frame <= self.frame)
        return tuple(islice(past, 200))

    @property
    def log(self) -> tuple[tuple[int, Command], ...]:
        """The frame at which each command took effect, and the command."""
        edits = [(f, e.command) for f, logged in self._edits.items() for e in logged]
        clicks = [(f, c) for f, cs in self._at_ends.items() for c in cs]
        return tuple(sorted(edits + clicks, key=lambda entry: entry[0]))

    # Running.

    def advance(self) -> Trace:
        """All phases (the remaining ones, of a half-stepped frame) of one frame.

        Raises what the source or a model raises; the state is then that of the last good frame.
        """
        while True:
            self.step_phase()
            if self._open is None:
                assert self._trace is not None
                return self._trace

    def step_phase(self) -> PhaseRecord:
        """The next phase. After the last one of a frame the frame is complete."""
        now = self._open or self._begin()
        try:
            record = next(now.phases)
            if not now.records and now.notes:
                swaps = tuple(Event(now.frame.index, "swap", note) for note in now.notes)
                record = replace(record, events=swaps + record.events)
            now.records.append(record)
            self._open = now
            if len(now.records) >= now.expected:
                self._finish(now)
        except BaseException:
            self._open = None
            raise
        return record

    def redo(self) -> Trace | None:
        """Compute the present frame again from its start, with the settings as edited now."""
        at = self.frame
        if at < 0:
            self.message = "no frame to redo yet: step to the first one"
            return None
        if edits := self._edits.pop(at + 1, []):
            self._edits.setdefault(at, []).extend(edits)
            self._discard_future(at, computed=at - 1)
        self._goto(at - 1)
        trace = self.advance()
        self.message = f"frame {at} computed again"
        return trace

    def back(self) -> Trace | None:
        """To the end of the frame before; state and settings as they were then."""
        if self._open is None and self._at.frame < 0:
            self.message = "this is the start"
            return None
        self._goto(self._at.frame if self._open else self._at.frame - 1)
        self.message = f"back at frame {self._at.frame}" if self._at.frame >= 0 else "at the start"
        return self._trace

    def seek(self, frame: int) -> Trace | None:
        """To the end of a frame of the kept history."""
        if not self.first_frame <= frame <= self.last_frame:
            raise ParamError(
                f"frame {frame} is not kept: choose one of {self.first_frame} to {self.last_frame}"
            )
        self._goto(frame)
        self.message = f"at frame {frame}"
        return self._trace

    def reset(self) -> None:
        """Start the scenario again, with the settings as edited."""
        self._restart(self.settings)
        self._say("started again with the settings as they are")

    def load(self, experiment: Experiment) -> None:
        """Start another experiment. Raises ParamError or SourceError before anything is changed."""
        self._restart(Settings(experiment))
        self.base = experiment
        """The scenario's own settings, to mark what was changed."""
        self.selected = None
        self._say(experiment.about)

    def _say(self, text: str) -> None:
        """What a start did, and what it left out."""
        self.message = "; ".join([text, *resting(self.experiment.estimator).values()])

    # Commands.

    def apply(self, command: Command, playing: bool = False) -> None:
        """Do what a command says at once, or with the next frame for an edit.

        Play, pause, speed and presets are the runner's. Raises ParamError with a sentence when the
        command makes no sense; nothing has changed then.
        """
        match command:
            case SetParam() | SetParams() | SwapModel() | Undo() | Redo() | ResetParams():
                self._edit(command, playing)
            case InitialiseAt():
                self._click(command)
            case ZeroAxes(robot):
                self._zero(robot)
            case Select(label):
                self.selected, self.message = label, ""
            case Seek(frame):
                self.seek(frame)
            case Transport(action="step frame"):
                self.advance()
            case Transport(action="step phase"):
                self.step_phase()
            case Transport(action="back"):
                self.back()
            case Transport(action="redo"):
                self.redo()
            case Transport(action="reset"):
                self.reset()
            case _:
                raise ParamError(f"{command} is for a runner, not for a session")

    def renew(self, said: tuple[str, ...]) -> int:
        """Swap every model in use whose file was saved in a version that can be used to this
        version, from the next frame on; `said` is what became of the files. Returns how many."""
        notes, count = list(said), 0
        for role, name in outdated(self.settings.experiment):
            try:
                self._edit(SwapModel(role, name), playing=False)
            except ParamError as why:
                notes.append(f"'{name}' goes on in its earlier version: {why}")
                continue
            count += 1
            kept = f": {self.message}" if self.message else ""
            notes.append(f"'{name}' runs in its new version from the next frame on{kept}")
        self.message = "; ".join(notes)
        return count

    def without(self, model: type[Any]) -> Session:
        """This run at its last good frame, with the latest settings that did not use a model.

        For another thread, when the one that owns this session is inside that model and was told
        not to come back: nothing of this session may be used afterwards.
        """
        after = copy.copy(self)
        after._open = None
        settings = after.settings
        while settings.past and uses(settings.experiment, model):
            settings = settings.undone()
        if uses(settings.experiment, model):
            after.message = "no other model was there before: choose one, or save a corrected file"
            return after
        if settings is not after.settings:
            frame = after._next
            after._discard_future(frame - 1, computed=frame - 1)
            after._edits.setdefault(frame, []).append(LoggedEdit(Undo(), settings))
            after.message = "back to the model before it, from the next frame on"
        return after

    def _edit(self, command: Edit, playing: bool) -> None:
        before, values = self.settings, values_of(command)
        if values and same_values(before.experiment, values):
            self.message = "; ".join(f"{path} is already {new}" for path, new in values.items())
            return
        after, note = self._edited(before, command, playing)
        frame = self._next
        running = self._running(after)
        reached = reconfigure(self.world, self.running.estimator, running.estimator)
        if running is not after.experiment:
            if any(waits(running, after.experiment, path) for path in values):
                note = "takes effect on reset"
        self._discard_future(frame - 1, computed=frame - 1)
        logged = self._edits.setdefault(frame, [])
        if values and logged and values_of(logged[-1].command).keys() == values.keys():
            logged.pop()
        logged.append(LoggedEdit(command, after))
        self.message = "; ".join(filter(None, (note, *reached.notes)))

    def _edited(self, before: Settings, command: Edit, playing: bool) -> tuple[Settings, str]:
        """The settings a command leads to, and a sentence about it."""
        match command:
            case SetParam() | SetParams():
                values = values_of(command)
                after, path = set_params(before.experiment, values), " ".join(values)
                return before.edited(after, path, self._same_step(before, path, playing)), ""
            case SwapModel(role, name):
                after, note = swapped(before.experiment, self.base, role, name)
                return before.edited(after), note
            case Undo():
                return before.undone(), "last edit undone"
            case Redo():
                return before.redone(), "edit done again"
            case ResetParams():
                base = replace(
                    self.base, seed=before.experiment.seed, frames=before.experiment.frames
                )
                return before.edited(base), "all parameters as the scenario has them"

    def _same_step(self, before: Settings, path: str, playing: bool) -> bool:
        """Whether an edit continues the last one: both wait for the same frame, or a slider is
        being dragged while frames go by."""
        if before.path != path:
            return False
        edited_at = max((f for f in self._edits if f <= self._next), default=-1)
        drag = playing and self._next - edited_at <= self.running.source.frame_rate / 2
        return edited_at == self._next or drag

    def _click(self, command: InitialiseAt) -> None:
        if command.mount not in self.world.mounts:
            raise ParamError(f"there is no sensor '{command.mount}' to point into")
        if command.frame != self.frame:
            raise ParamError(
                f"the feature was pointed at in frame {command.frame}, but this is frame "
                f"{self.frame}: pause, then click"
            )
        size = self.world.mounts[command.mount].sensor.measurement_size
        if not 1 <= len(command.z) <= size:
            raise ParamError(f"a place in sensor '{command.mount}' has up to {size} coordinates")
        self._at_end(command, "the feature is started when this frame is complete")

    def _zero(self, robot: str) -> None:
        if self.frame < 0:
            raise ParamError("no frame yet to put the axes into: step to the first one")
        if self._open is not None:
            # What is refused is refused now, not at the end of the frame.
            redefine(self.world, robot)
        self._at_end(ZeroAxes(robot), "the axes are moved when this frame is complete")

    def _at_end(self, command: AtEnd, waiting: str) -> None:
        """Do something at the end of the present frame: now, if that is where the run stands."""
        record = None
        if self._open is None:
            assert self._trace is not None
            record = self._last(self._trace, command)
        self._discard_future(self.frame, computed=self._at.frame)
        self._at_ends.setdefault(self.frame, []).append(command)
        if record is None:
            self.message = waiting
            return
        assert self._trace is not None
        self.metrics.truncate(self.frame - 1)
        self._forget_events(self.frame - 1)
        trace = replace(self._trace, records=(*self._trace.records, record))
        self._complete(trace, replace(self._at, world=trace.world), self._source_ms)
        self.message = record.events[-1].text

    # Inside a frame.

    @property
    def _in_force(self) -> Settings:
        return self._open.settings if self._open else self._at.settings

    @property
    def _next(self) -> int:
        """The frame an edit made now takes effect with."""
        return self.frame + 1

    def _settings_at(self, frame: int) -> Settings:
        logged = self._edits.get(frame)
        return logged[-1].settings if logged else self._in_force

    def _running(self, settings: Settings) -> Experiment:
        """Settings less what waits for a reset; the same object for the same settings."""
        if settings.experiment is not self._held[0]:
            experiment = until_reset(settings.experiment, self._started)
            self._held = (settings.experiment, experiment)
        return self._held[1]

    def _begin(self) -> OpenFrame:
        index = self._next
        settings = self._settings_at(index)
        experiment = self._running(settings)
        if experiment.frames is not None and index >= experiment.frames:
            raise EndOfData
        reached = reconfigure(
            self._at.world, self._running(self._at.settings).estimator, experiment.estimator
        )
        t0 = perf_counter()
        frame, state = experiment.source.advance(self._at.state, index)
        source_ms = 1e3 * (perf_counter() - t0)
        unknown = [m for m in frame.raw if m not in reached.world.mounts]
        if unknown:
            known = ", ".join(reached.world.mounts)
            raise SourceError(
                f"the input comes from a sensor '{unknown[0]}' the estimator does not have (it has "
                f"{known}): give them the same name"
            )
        return OpenFrame(
            frame=frame,
            start=reached.world,
            state=state,
            settings=settings,
            phases=step(reached.world, frame, experiment.source),
            expected=2 + 5 * len(frame.raw),
            source_ms=source_ms,
            notes=reached.notes,
        )

    def _finish(self, now: OpenFrame) -> None:
        trace = now.trace(complete=True)
        for command in self._at_ends.get(trace.frame.index, []):
            try:
                record = self._last(trace, command)
            except ParamError as why:
                event = Event(trace.frame.index, "info", str(why))
                record = PhaseRecord("manage", None, trace.world, 0.0, events=(event,))
            trace = replace(trace, records=(*trace.records, record))
            self.message = record.events[-1].text
        at = Moment(trace.frame.index, trace.world, now.state, now.settings)
        self._complete(trace, at, now.source_ms)
        self._open = None

    def _last(self, trace: Trace, command: AtEnd) -> PhaseRecord:
        """One more phase of a complete frame. Raises ParamError when it can not be."""
        if isinstance(command, InitialiseAt):
            return self._initialised(trace, command)
        record = zeroed(trace, command.robot)
        # An edit that waits for the next frame must go with the new axes.
        now, then = self.running, self._running(self._settings_at(self._next))
        reconfigure(record.world, now.estimator, then.estimator)
        return record

    def _initialised(self, trace: Trace, click: InitialiseAt) -> PhaseRecord:
        source = self.running.source
        t0 = perf_counter()
        world, event = initialise_at(trace.world, trace.frame, source, click.mount, click.z)
        ms = 1e3 * (perf_counter() - t0)
        return PhaseRecord("manage", click.mount, world, ms, events=(event,))

    def _complete(self, trace: Trace, at: Moment, source_ms: float) -> None:
        """Enter a complete frame (or one that got a feature more) into the books."""
        index = trace.frame.index
        # First what uses the models: if one of them raises, the books are as before the frame.
        self.metrics.add(trace, source_ms)
        self._trace, self._at, self._source_ms = trace, at, source_ms
        self._history.add(at, trace)
        if index > self._events_until:
            self._events_until = index
            for record in trace.records:
                self._events.extend(record.events)

    # Elsewhere in time.

    def _restart(self, settings: Settings) -> None:
        world = initial_world(settings.experiment)
        state = settings.experiment.source.start()
        self._open: OpenFrame | None = None
        self._trace: Trace | None = None
        self._source_ms = 0.0
        self._edits: dict[int, list[LoggedEdit]] = {}
        self._at_ends: dict[int, list[AtEnd]] = {}
        self._events: deque[Event] = deque(maxlen=KEPT_EVENTS)
        self._events_until = -1
        """The last frame whose events are in."""
        self._at = Moment(-1, world, state, settings)
        self._history = History(self._history_bytes)
        self._history.add(self._at, None)
        self.metrics = Metrics(settings.experiment.align)
        self._started = settings.experiment
        self._held = (settings.experiment, settings.experiment)
        self.run += 1

    def _goto(self, frame: int) -> None:
        """To the end of a frame that was computed before."""
        self._open = None
        kept = self._history.whole(frame)
        if kept is not None:
            self._at, self._trace = kept
        else:
            # A checkpoint holds the state but not the phases, so start from one further back.
            self._at, self._trace = self._history.before(max(frame - 1, -1)), None
        self.metrics.show(self._at.frame)
        while self._at.frame < frame:
            self.advance()

    def _forget_events(self, frame: int) -> None:
        self._events_until = min(self._events_until, frame)
        while self._events and self._events[-1].frame > frame:
            self._events.pop()

    def _discard_future(self, frame: int, computed: int) -> None:
        """Something new after the end of `frame` makes void what was logged later; what was
        computed is right only to the end of `computed`."""
        for later in [f for f in self._edits if f > frame + 1]:
            del self._edits[later]
        for later in [f for f in self._at_ends if f > frame]:
            del self._at_ends[later]
        self._history.truncate(computed)
        self.metrics.truncate(computed)
        self._forget_events(computed)
