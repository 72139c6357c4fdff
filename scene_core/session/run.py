"""One run of an experiment from its start: where it stands, what was, and what was asked for when.

The numbers depend on the settings, the seed and the commands only: pausing, stepping by phase,
going back and computing again change no bit.
"""

from __future__ import annotations

import copy
from dataclasses import replace

from scene_core.filter.records import PhaseRecord, Trace
from scene_core.filter.world import World
from scene_core.params import ParamError
from scene_core.session import frame_end
from scene_core.session.command_log import CommandLog
from scene_core.session.commands import ZeroAxes
from scene_core.session.config import Experiment
from scene_core.session.edits import Edit, Settings, until_reset
from scene_core.session.frame_end import AtEnd, Deed
from scene_core.session.history import Moment
from scene_core.session.open_frame import OpenFrame, opened
from scene_core.session.past import Past
from scene_core.session.start import initial_world
from scene_core.session.swap import Reconfigured, reconfigure

FRAMES_AGAIN = 200
"""Undo computes no more frames again at once: nothing else is answered meanwhile."""


class Run:
    """Frame by frame, phase by phase; back and forth."""

    def __init__(self, settings: Settings, history_bytes: int) -> None:
        """Raises ParamError or SourceError when the experiment can not be started."""
        experiment = settings.experiment
        world = initial_world(experiment)
        self._at = Moment(-1, world, experiment.source.start(), settings)
        """The end of the last complete frame."""
        self._trace: Trace | None = None
        self._source_ms = 0.0
        self._open: OpenFrame | None = None
        self._started = experiment
        self._held = (experiment, experiment)
        self.past = Past(self._at, experiment.align, history_bytes)
        self.log = CommandLog()

    # Where it stands.

    @property
    def frame(self) -> int:
        """The frame that is being stepped through, or was last completed; -1 before the first."""
        return self._open.frame.index if self._open else self._at.frame

    @property
    def half_stepped(self) -> bool:
        """Whether some phases of the present frame are still to come."""
        return self._open is not None

    @property
    def trace(self) -> Trace | None:
        """The present frame, as far as it was computed; None before the first."""
        return self._open.trace(complete=False) if self._open else self._trace

    @property
    def world(self) -> World:
        """The estimate after the last phase that was computed."""
        return self.trace.world if self.trace else self._at.world

    @property
    def in_force(self) -> Settings:
        """What the present frame is computed with."""
        return self._open.settings if self._open else self._at.settings

    @property
    def settings(self) -> Settings:
        """As last edited: in force now or with the next frame."""
        logged = self._logged.without_deeds(self._is_gone, self._not_again)
        # What was done again later than it was done is not in the settings of the time between.
        return logged.with_deeds(self.log.done(self.frame))

    @property
    def _logged(self) -> Settings:
        """With all deeds, also those still to come when frames are computed again."""
        return self.log.settings(self.frame + 1, self.in_force)

    def _is_gone(self, deed: Deed) -> bool:
        done = deed.frame <= self.frame and self.log.holds(deed)
        return not done or bool(self.log.idle(deed))

    def _not_again(self, deed: Deed) -> bool:
        return deed.frame > self.frame or self.log.holds(deed)

    def running(self, settings: Settings) -> Experiment:
        """Settings less what waits for a reset; the same object for the same settings."""
        if settings.experiment is not self._held[0]:
            experiment = until_reset(settings.experiment, self._started)
            self._held = (settings.experiment, experiment)
        return self._held[1]

    # Forward.

    def advance(self) -> Trace:
        """The remaining phases of one frame."""
        while True:
            self.step_phase()
            if self._open is None:
                assert self._trace is not None
                return self._trace

    def step_phase(self) -> PhaseRecord:
        """The next phase. What a model or the source raises drops the frame."""
        try:
            now = self._open or self._opened()
            record = now.next_phase()
            self._open = now
            if now.is_complete:
                self._finish(now)
        except BaseException:
            self._open = None
            raise
        return record

    def _opened(self) -> OpenFrame:
        settings = self._logged
        now = self.running(settings)
        return opened(self._at, settings, self.running(self._at.settings), now)

    def _finish(self, now: OpenFrame) -> None:
        trace = now.trace(complete=True)
        for deed in self.log.deeds_of(trace.frame.index):
            try:
                record = self._done(trace, deed.command)
            except ParamError as why:
                record = frame_end.refused(trace, why)
            self.log.did(deed, record, trace.world)
            trace = replace(trace, records=(*trace.records, record))
        at = Moment(trace.frame.index, trace.world, now.state, now.settings)
        self.past.enter(at, trace, now.source_ms)
        self._at, self._trace, self._source_ms, self._open = at, trace, now.source_ms, None

    # Back.

    def go_to(self, frame: int) -> None:
        """To the end of a frame that was computed before; -1: to the start."""
        self._open = None
        kept = self.past.history.whole(frame)
        if kept is not None:
            self._at, self._trace = kept
        else:
            # A checkpoint holds the state but not the phases, so start from one further back.
            self._at, self._trace = self.past.history.before(max(frame - 1, -1)), None
        self.past.metrics.show(self._at.frame)
        while self._at.frame < frame:
            self.advance()

    def compute_again(self) -> Trace:
        """The present frame from its start, with the settings as edited now."""
        at = self.frame
        if self.log.bring_forward(at):
            self._discard_future(at, computed=at - 1)
        self.go_to(at - 1)
        return self.advance()

    def without_open_frame(self) -> Run:
        """This run at its last complete frame; this one may not be used afterwards."""
        after = copy.copy(self)
        after._open = None
        return after

    # What is asked for.

    def reached(self, settings: Settings) -> Reconfigured:
        """The present estimate under other settings. Raises ParamError where it has no meaning."""
        now, then = self.running(self.in_force), self.running(settings)
        return reconfigure(self.world, now.estimator, then.estimator)

    def edit(self, command: Edit, settings: Settings) -> None:
        """Go on with other settings from the next frame on."""
        self._discard_future(self.frame, computed=self.frame)
        self.log.edit(self.frame + 1, command, settings)

    def same_gesture(self, playing: bool) -> bool:
        """Whether an edit now may continue the last one: both wait for the same frame, or a slider
        is being dragged while frames go by."""
        after = self.frame + 1
        edited_at = self.log.last_edit(after)
        rate = self.running(self.in_force).source.frame_rate
        return edited_at == after or (playing and after - edited_at <= rate / 2)

    def at_end(self, command: AtEnd) -> str:
        """Do something at the end of the present frame: now, if that is where the run stands.
        Returns a sentence; raises ParamError when it makes no sense."""
        measured = self.trace.frame.raw if self.trace else ()
        frame_end.check(command, self.world, self.frame, self.half_stepped, measured)
        if self._open and any(d.command == command for d in self.log.deeds_of(self.frame)):
            raise ParamError(f"{frame_end.waiting(command)}, as was asked for before")
        record = None if self._trace is None or self._open else self._done(self._trace, command)
        deed, before = Deed(self.frame, command), self.settings
        self._discard_future(self.frame, computed=self._at.frame)
        self.log.add(deed)
        if record is not None and self._trace is not None:
            self.log.did(deed, record, self._trace.world)
        if not self.log.idle(deed):
            self.log.mark(self.frame + 1, before.after(deed))
        if record is None or self._trace is None:
            return frame_end.waiting(command)
        trace = replace(self._trace, records=(*self._trace.records, record))
        at = replace(self._at, world=trace.world)
        self.past.enter_anew(at, trace, self._source_ms)
        self._at, self._trace = at, trace
        return record.events[-1].text

    def take_back(self, deed: Deed) -> str:
        """As if a deed, which was the last thing done, had not been; the run stays in its frame.
        Returns a sentence; raises ParamError when it was too many frames ago."""
        self._check_distance(deed)
        after = self.settings.undone()
        self._discard_future(self.frame, computed=deed.frame - 1)
        self.log.drop(deed)
        self.log.mark(self.frame + 1, after)
        return f"undone: {deed.name}{self._compute_since(deed)}"

    def do_again(self, deed: Deed) -> str:
        """What was taken back is done where it was done; the run stays in its frame."""
        self._check_distance(deed)
        after = self.settings.redone()
        self._discard_future(self.frame, computed=deed.frame - 1)
        self.log.add(deed)
        self.log.mark(self.frame + 1, after)
        again = self._compute_since(deed)
        return self.log.idle(deed) or f"done again: {deed.name}{again}"

    def _check_distance(self, deed: Deed) -> None:
        if self.frame - deed.frame > FRAMES_AGAIN:
            raise ParamError(
                f"{deed.name} was at the end of frame {deed.frame}, more than {FRAMES_AGAIN} "
                "frames ago: go to that frame, and try again there"
            )

    def _compute_since(self, deed: Deed) -> str:
        """To where the run stands now, from before a deed; a sentence when that is a way."""
        complete, phases = self._at.frame, len(self._open.records) if self._open else 0
        self.go_to(complete)
        for _ in range(phases):
            self.step_phase()
        frames = f"frames {deed.frame} to {self.frame}"
        return f"; {frames} computed again" if self.frame > deed.frame else ""

    def _done(self, trace: Trace, command: AtEnd) -> PhaseRecord:
        now = self.running(self.in_force)
        record = frame_end.done(trace, command, now.source)
        if isinstance(command, ZeroAxes):
            # An edit that waits for the next frame must go with the new axes.
            reconfigure(record.world, now.estimator, self.running(self.settings).estimator)
        return record

    def _discard_future(self, frame: int, computed: int) -> None:
        """Something new after the end of `frame` makes void what was logged later; what was
        computed is right only to the end of `computed`."""
        self.log.forget_after(frame)
        self.past.forget_after(computed)
        self.past.metrics.show(self._at.frame)
