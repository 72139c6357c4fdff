"""The headless session: an experiment, where it stands, its past, and what was asked of it.

`scene run` and the page use this object. The numbers of a run depend on its settings, its seed and
the commands only: pausing, stepping by phase, stepping back and redoing in between change no bit.
"""

from __future__ import annotations

import copy
from typing import Any

from scene_core.filter.records import Event, PhaseRecord, Trace
from scene_core.filter.world import World
from scene_core.params import ParamError
from scene_core.session.commands import (
    Command,
    DeleteFeature,
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
    edited,
    gesture_of,
    same_values,
    uses,
    values_of,
    waits,
)
from scene_core.session.frame_end import Deed
from scene_core.session.metrics import Metrics
from scene_core.session.roles import outdated
from scene_core.session.run import Run
from scene_core.session.start import resting

HISTORY_BYTES = 256 * 2**20


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

    def load(self, experiment: Experiment) -> None:
        """Start another experiment. Raises ParamError or SourceError before anything is changed."""
        self._start(Settings(experiment))
        self.base = experiment
        """The scenario's own settings, to mark what was changed."""
        self.selected = None
        self._say(experiment.about)

    def reset(self) -> None:
        """Start the scenario again, with the settings as edited."""
        self._start(self.settings.edits_only())
        self._say("started again with the settings as they are")

    def _start(self, settings: Settings) -> None:
        self._live = Run(settings, self._history_bytes)
        self.run += 1

    def _say(self, text: str) -> None:
        """What a start did, and what it left out."""
        self.message = "; ".join([text, *resting(self.experiment.estimator).values()])

    # What there is.

    @property
    def experiment(self) -> Experiment:
        """Settings in force."""
        return self._live.in_force.experiment

    @property
    def running(self) -> Experiment:
        """What the frames are computed with: the settings in force, less what waits for a reset."""
        return self._live.running(self._live.in_force)

    @property
    def pending(self) -> Experiment | None:
        """Settings from the next frame on, when they differ."""
        now = self.settings.experiment
        return None if now is self.experiment else now

    @property
    def settings(self) -> Settings:
        """As last edited: in force now or with the next frame."""
        return self._live.settings

    @property
    def frame(self) -> int:
        """The frame that is being stepped through, or was last completed; -1 before the first."""
        return self._live.frame

    @property
    def half_stepped(self) -> bool:
        """Whether some phases of the present frame are still to come."""
        return self._live.half_stepped

    @property
    def world(self) -> World:
        """The estimate after the last phase that was computed."""
        return self._live.world

    @property
    def trace(self) -> Trace | None:
        """The present frame, as far as it was computed; None before the first."""
        return self._live.trace

    @property
    def first_frame(self) -> int:
        """The oldest frame `seek` can reach."""
        return 0 if self.last_frame >= 0 else -1

    @property
    def last_frame(self) -> int:
        """The newest frame `seek` can reach."""
        return self._live.past.history.last

    @property
    def frame_count(self) -> int | None:
        """How many frames the run can have; None when it has no end."""
        counts = [self.experiment.frames, self.running.source.frame_count]
        return min((c for c in counts if c is not None), default=None)

    @property
    def metrics(self) -> Metrics:
        """How well the filter did, frame by frame."""
        return self._live.past.metrics

    @property
    def events(self) -> tuple[Event, ...]:
        """Of the complete frames up to here; newest first, at most 200."""
        return self._live.past.events(self.frame - self.half_stepped)

    @property
    def log(self) -> tuple[tuple[int, Command], ...]:
        """The frame at which each command took effect, and the command."""
        return self._live.log.commands

    # In time.

    def advance(self) -> Trace:
        """All phases (the remaining ones, of a half-stepped frame) of one frame.

        Raises what the source or a model raises; the state is then that of the last good frame.
        """
        while True:
            self.step_phase()
            if self.trace is not None and not self.half_stepped:
                return self.trace

    def step_phase(self) -> PhaseRecord:
        """The next phase. After the last one of a frame the frame is complete."""
        record = self._live.step_phase()
        if not self.half_stepped and self._live.log.deeds_of(self.frame) and self.trace:
            self.message = self.trace.records[-1].events[-1].text
        return record

    def redo(self) -> Trace | None:
        """Compute the present frame again from its start, with the settings as edited now."""
        if self.frame < 0:
            self.message = "no frame to redo yet: step to the first one"
            return None
        trace = self._live.compute_again()
        self.message = f"frame {self.frame} computed again"
        return trace

    def back(self) -> Trace | None:
        """To the end of the frame before; state and settings as they were then."""
        if self.frame < 0:
            self.message = "this is the start"
            return None
        self._live.go_to(self.frame - 1)
        self.message = f"back at frame {self.frame}" if self.frame >= 0 else "at the start"
        return self.trace

    def seek(self, frame: int) -> Trace | None:
        """To the end of a frame of the kept history."""
        if not self.first_frame <= frame <= self.last_frame:
            raise ParamError(
                f"frame {frame} is not kept: choose one of {self.first_frame} to {self.last_frame}"
            )
        self._live.go_to(frame)
        self.message = f"at frame {frame}"
        return self.trace

    # Commands.

    def apply(self, command: Command, playing: bool = False) -> None:
        """Do what a command says at once, or with the next frame for an edit.

        Play, pause, speed and presets are the runner's. Raises ParamError with a sentence when the
        command makes no sense; nothing has changed then.
        """
        match command:
            case Undo() if isinstance(deed := self.settings.undoes, Deed):
                self.message = self._live.take_back(deed)
            case Redo() if isinstance(deed := self.settings.redoes, Deed):
                self.message = self._live.do_again(deed)
            case SetParam() | SetParams() | SwapModel() | Undo() | Redo() | ResetParams():
                self._edit(command, playing)
            case InitialiseAt() | DeleteFeature() | ZeroAxes():
                self.message = self._live.at_end(command)
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

    def _edit(self, command: Edit, playing: bool = False) -> None:
        before, values = self.settings, values_of(command)
        # The end of a gesture is an edit also where it changes nothing: of what undo goes back to.
        ends = gesture_of(command) in dict(before.gestures)
        if values and not ends and same_values(before.experiment, values):
            self.message = "; ".join(f"{path} is already {new}" for path, new in values.items())
            return
        after, note = edited(before, self.base, command, self._live.same_gesture(playing))
        reached = self._live.reached(after)
        running = self._live.running(after)
        if any(waits(running, after.experiment, path) for path in values):
            note = "takes effect on reset"
        self._live.edit(command, after)
        self.message = "; ".join(filter(None, (note, *reached.notes)))

    # Models of the user's own.

    def renew(self, said: tuple[str, ...]) -> int:
        """Swap every model in use whose file was saved in a version that can be used to this
        version, from the next frame on; `said` is what became of the files. Returns how many."""
        notes, count = list(said), 0
        for role, name in outdated(self.settings.experiment):
            try:
                self._edit(SwapModel(role, name))
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
        after._live = self._live.without_open_frame()
        settings = after.settings
        while settings.past and uses(settings.experiment, model):
            settings = settings.undone()
        if uses(settings.experiment, model):
            after.message = "no other model was there before: choose one, or save a corrected file"
            return after
        if settings is not after.settings:
            after._live.edit(Undo(), settings)
            after.message = "back to the model before it, from the next frame on"
        return after
