"""Which command took effect when, so that going back and forth in time repeats all of them."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.filter.records import PhaseRecord
from scene_core.filter.world import World
from scene_core.session.commands import Command
from scene_core.session.edits import Edit, Settings, values_of
from scene_core.session.frame_end import Deed


@dataclass(frozen=True)
class LoggedEdit:
    """A command, and the settings it led to."""

    command: Edit | None
    """None: they differ in what there is to undo only."""
    settings: Settings


class CommandLog:
    """Edits by the frame they begin with, and what is done at the end of a frame."""

    def __init__(self) -> None:
        self._edits: dict[int, list[LoggedEdit]] = {}
        self._deeds: dict[int, list[Deed]] = {}
        self._idle: dict[Deed, str] = {}

    @property
    def commands(self) -> tuple[tuple[int, Command], ...]:
        """The frame at which each command took effect, and the command."""
        edits = [(f, e.command) for f, es in self._edits.items() for e in es if e.command]
        ends = [(f, d.command) for f, ds in self._deeds.items() for d in ds]
        return tuple(sorted(edits + ends, key=lambda entry: entry[0]))

    def settings(self, frame: int, before: Settings) -> Settings:
        """With which a frame is computed; `before` where nothing was edited."""
        logged = self._edits.get(frame)
        return logged[-1].settings if logged else before

    def last_edit(self, frame: int) -> int:
        """The latest frame up to this one that begins with an edit; -1: there is none."""
        return max((f for f in self._edits if f <= frame), default=-1)

    def edit(self, frame: int, command: Edit, settings: Settings) -> None:
        """From a frame on. Repeated edits of the same parameters are one."""
        logged, values = self._edits.setdefault(frame, []), values_of(command)
        last = logged[-1].command if logged else None
        if values and last is not None and values_of(last).keys() == values.keys():
            logged.pop()
        logged.append(LoggedEdit(command, settings))

    def mark(self, frame: int, settings: Settings) -> None:
        """The same experiment, but from a frame on there is something else to undo."""
        self._edits.setdefault(frame, []).append(LoggedEdit(None, settings))

    def bring_forward(self, frame: int) -> bool:
        """Let the edits that wait for the frame after this one begin with it; whether there are
        any."""
        if not any(e.command for e in self._edits.get(frame + 1, ())):
            return False
        self._edits.setdefault(frame, []).extend(self._edits.pop(frame + 1))
        return True

    def add(self, deed: Deed) -> None:
        """Do something when a frame is complete."""
        self._deeds.setdefault(deed.frame, []).append(deed)

    def drop(self, deed: Deed) -> None:
        """It was never asked for. What was asked for after it came to nothing, or it would have
        been taken back before; some of that because of it, so that goes too."""
        deeds = self._deeds[deed.frame]
        del deeds[deeds.index(deed) :]
        self._deeds = {frame: ds for frame, ds in self._deeds.items() if frame <= deed.frame}
        self._idle = {d: why for d, why in self._idle.items() if self.holds(d)}

    def deeds_of(self, frame: int) -> tuple[Deed, ...]:
        """What is done when a frame is complete."""
        return tuple(self._deeds.get(frame, ()))

    def done(self, frame: int) -> tuple[Deed, ...]:
        """What was done at the ends of frames up to this one, in order, or waits for its end."""
        frames = sorted(f for f in self._deeds if f <= frame)
        return tuple(d for f in frames for d in self._deeds[f] if d not in self._idle)

    def holds(self, deed: Deed) -> bool:
        return deed in self._deeds.get(deed.frame, ())

    def did(self, deed: Deed, record: PhaseRecord, before: World) -> None:
        """What came of it, this time."""
        self._idle.pop(deed, None)
        if record.world is before:
            self._idle[deed] = record.events[-1].text

    def idle(self, deed: Deed) -> str:
        """Why nothing came of it; empty: something did, or may."""
        return self._idle.get(deed, "")

    def forget_after(self, frame: int) -> None:
        """Something new after the end of `frame` makes void what was logged later."""
        for later in [f for f in self._edits if f > frame + 1]:
            del self._edits[later]
        for later in [f for f in self._deeds if f > frame]:
            del self._deeds[later]
        self._idle = {deed: why for deed, why in self._idle.items() if deed.frame <= frame}
