"""The thread that owns a session: takes commands from a queue, keeps pace, publishes.

Browser callbacks only `post`; readers only look at `latest`. There is no lock. A second thread
looks whether the first is still inside a user's model after two seconds, says so, and takes another
one in its place when asked to.
"""

from __future__ import annotations

import itertools
import math
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from time import monotonic
from typing import Literal

from threadpoolctl import threadpool_limits

from scene_core.filter.ports import EndOfData, SourceError
from scene_core.models import guard
from scene_core.models.plugins import UserFile
from scene_core.params import ParamError
from scene_core.session import presets
from scene_core.session.commands import (
    Abandon,
    Command,
    LoadPreset,
    ModelsSaved,
    Refresh,
    Seek,
    Select,
    SetSpeed,
    Transport,
)
from scene_core.session.failures import failure
from scene_core.session.inbox import Inbox, Nothing
from scene_core.session.pace import Pace
from scene_core.session.published import Busy, Failure, Published, RoleOptions
from scene_core.session.roles import role_options
from scene_core.session.session import Session

PUBLISH_HZ = 60.0
LEAST_SPEED = 1e-3
PATIENCE_S = 2.0
"""A call of a user's model that takes longer is named, and may be abandoned."""
WATCH_S = 0.1


class Runner:
    """Runs a session in a thread of its own. Use as a context manager or call start and stop."""

    def __init__(
        self, session: Session, playing: bool = False, files: tuple[UserFile, ...] = ()
    ) -> None:
        self._session, self._files = session, files
        self._inbox = Inbox()
        self._mode: Literal["playing", "paused", "finished"] = "playing" if playing else "paused"
        self._speed = 1.0
        self._pace = Pace()
        self._failure: Failure | None = None
        self._seq = itertools.count(1)
        self._published_at = -math.inf
        self._roles: tuple[object, tuple[RoleOptions, ...]] = (None, ())
        self.latest: Published = self._published()
        """The session as it stands; replaced as a whole, never changed."""
        self._stopped, self._abandon = threading.Event(), threading.Event()
        self._thread = self._new_thread()
        self._watcher = threading.Thread(target=self._watch, name="watch", daemon=True)

    def _new_thread(self) -> threading.Thread:
        return threading.Thread(target=self._loop, name="ekf", daemon=True)

    def start(self) -> Runner:
        self._thread.start()
        self._watcher.start()
        return self

    def post(self, command: Command) -> None:
        """Ask for something; from any thread, returns at once."""
        if isinstance(command, Abandon):
            self._abandon.set()
        else:
            self._inbox.post(command)

    def stop(self, timeout: float = 5.0) -> None:
        """End the thread after the phase it is in."""
        self._stopped.set()
        self._inbox.post(None)
        if self._thread.is_alive():
            self._thread.join(timeout)

    def __enter__(self) -> Runner:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    # The thread that watches.

    def _watch(self) -> None:
        while not self._stopped.wait(WATCH_S):
            call = guard.under_way(self._thread.ident)
            if call is None or call.seconds < PATIENCE_S:
                self._abandon.clear()
            elif self._abandon.is_set():
                self._abandon.clear()
                self._give_up(call)
            else:
                self._show_busy(call)

    def _show_busy(self, call: guard.Call) -> None:
        busy = Busy(call.model, call.method, int(call.seconds))
        if self.latest.busy == busy:
            return
        self.latest = replace(self.latest, seq=next(self._seq), busy=busy)
        if guard.under_way(self._thread.ident) is not call:
            # It came back meanwhile, and what it published may just have been overwritten.
            self.post(Refresh())

    def _give_up(self, call: guard.Call) -> None:
        """Go on in another thread; the old one ends when the call returns, its result unseen."""
        seconds = call.seconds
        if not call.claim():
            return
        self._session = self._session.without(call.cls)
        self._set_playing(False)
        # A key that was pressed while nothing answered would go on at once, unseen.
        dropped = self._inbox.drop_requests()
        meanwhile = "; what was asked for meanwhile was not done" if dropped else ""
        self._failure = Failure(
            f"'{call.model}'.{call.method} did not return in {seconds:.0f} s and was abandoned, "
            f"the run is paused at the last good frame: {self._session.message}{meanwhile}."
        )
        self._publish()
        self._thread = self._new_thread()
        self._thread.start()

    # The thread that runs.

    def _loop(self) -> None:
        try:
            self._serve()
        except guard.Abandoned:
            return  # another thread has taken over

    def _serve(self) -> None:
        # The default of 5 ms lets a busy server thread stall every hand-over of the interpreter.
        sys.setswitchinterval(1e-3)
        threadpool_limits(1)
        while True:
            command = self._wait()
            if command is None:
                return
            if isinstance(command, Nothing):
                self._play()
            else:
                self._obey(command)

    def _wait(self) -> Command | Nothing | None:
        """The next command, Nothing when it is time for the next phase, None to stop."""
        if self._mode != "playing":
            return self._inbox.next()
        return self._inbox.next(0.0 if self._session.half_stepped else self._pace.wait(self._speed))

    def _play(self) -> None:
        if self._guarded(self._session.step_phase, True) and not self._session.half_stepped:
            self._pace.frame_done(self._session.running.source.frame_rate, self._speed)
            if monotonic() - self._published_at >= 1.0 / PUBLISH_HZ:
                self._publish()

    def _obey(self, command: Command) -> None:
        if not isinstance(command, (Select, Refresh, ModelsSaved)):
            self._failure = None
        match command:
            case Transport(action="play"):
                self._set_playing(True)
            case Transport(action="pause"):
                self._pause()
            case Transport(action="toggle"):
                self._pause() if self._mode == "playing" else self._set_playing(True)
            case Transport(action="reset"):
                if self._guarded(lambda: self._session.apply(command)):
                    self._mode = "paused" if self._mode == "finished" else self._mode
            case Transport() | Seek():
                self._set_playing(False)
                self._guarded(lambda: self._session.apply(command), isinstance(command, Transport))
            case SetSpeed(factor):
                self._set_speed(factor)
            case LoadPreset(name):
                if self._guarded(lambda: self._session.load(presets.build(name))):
                    self._mode = "paused" if self._mode == "finished" else self._mode
                    self._pace = Pace()
            case ModelsSaved(files, said):
                self._files, self._roles = files, (None, ())
                self._guarded(lambda: self._renew(said))
            case Refresh():
                pass
            case _:
                playing = self._mode == "playing"
                self._guarded(lambda: self._session.apply(command, playing))
        self._publish()

    def _renew(self, said: tuple[str, ...]) -> None:
        if self._session.renew(said):
            self._failure = None

    def _pause(self) -> None:
        """Stop at the end of the frame that is under way: what stays on the page is complete."""
        if self._mode == "playing" and self._session.half_stepped:
            if not self._guarded(self._session.advance, True):
                return
        self._set_playing(False)

    def _set_playing(self, playing: bool) -> None:
        self._mode = "playing" if playing else "paused"
        self._pace = Pace()

    def _set_speed(self, factor: float) -> None:
        if not factor >= LEAST_SPEED:
            self._session.message = (
                f"speed {factor:g}: give a factor of at least {LEAST_SPEED:g}; 1 is real time"
            )
            return
        self._speed = factor
        self._pace = Pace()
        self._session.message = (
            "as fast as possible" if factor == math.inf else f"{factor:g} x real time"
        )

    def _guarded(self, work: Callable[[], object], is_frame: bool = False) -> bool:
        """Do something that may fail; the session keeps the state of its last good frame. A frame
        that fails pauses the run and says why; a command that is refused is a message."""
        try:
            work()
            return True
        except EndOfData:
            self._mode = "finished"
            self._session.message = "the end: step back, seek or reset to go on"
        except Exception as e:
            # Whatever a model raises, the thread lives on.
            if isinstance(e, (ParamError, SourceError)) and not is_frame:
                self._session.message = str(e)
            else:
                self._mode = "paused"
                self._failure = failure(e, self._session.frame + 1 if is_frame else None)
        self._publish()
        return False

    def _publish(self) -> None:
        self._published_at = monotonic()
        self.latest = self._published()

    def _published(self) -> Published:
        s = self._session
        if self._roles[0] is not s.settings.experiment:
            self._roles = (s.settings.experiment, role_options(s.settings.experiment, s.base))
        return Published(
            seq=next(self._seq),
            run=s.run,
            experiment=s.experiment,
            pending=s.pending,
            base=s.base,
            roles=self._roles[1],
            presets=presets.loadable(),
            mode=self._mode,
            trace=s.trace,
            first_frame=s.first_frame,
            last_frame=s.last_frame,
            frame_count=s.frame_count,
            speed=self._speed,
            real_time_factor=self._pace.factor if self._mode == "playing" else 0.0,
            series=s.metrics.series(),
            light=s.metrics.light(),
            events=s.events,
            message=s.message,
            failure=self._failure,
            selected=s.selected,
            can_undo=bool(s.settings.past),
            can_redo=bool(s.settings.future),
            files=self._files,
        )
