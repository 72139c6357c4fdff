"""Which command took effect when, so that going back and forth in time repeats all of them."""

from __future__ import annotations

from dataclasses import dataclass

from scene_core.session.commands import Command
from scene_core.session.edits import Edit, Settings, values_of
from scene_core.session.frame_end import AtEnd


@dataclass(frozen=True)
class LoggedEdit:
    """A command, and the settings it led to."""

    command: Edit
    settings: Settings


class CommandLog:
    """Edits by the frame they begin with, and what is done at the end of a frame."""

    def __init__(self) -> None:
        self._edits: dict[int, list[LoggedEdit]] = {}
        self._at_ends: dict[int, list[AtEnd]] = {}

    @property
    def commands(self) -> tuple[tuple[int, Command], ...]:
        """The frame at which each command took effect, and the command."""
        edits = [(f, e.command) for f, logged in self._edits.items() for e in logged]
        ends = [(f, c) for f, cs in self._at_ends.items() for c in cs]
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
        if values and logged and values_of(logged[-1].command).keys() == values.keys():
            logged.pop()
        logged.append(LoggedEdit(command, settings))

    def bring_forward(self, frame: int) -> bool:
        """Let the edits that wait for the frame after this one begin with it; whether there are
        any."""
        waiting = self._edits.pop(frame + 1, [])
        if waiting:
            self._edits.setdefault(frame, []).extend(waiting)
        return bool(waiting)

    def at_end(self, frame: int, command: AtEnd) -> None:
        """Do something when a frame is complete."""
        self._at_ends.setdefault(frame, []).append(command)

    def ends_of(self, frame: int) -> tuple[AtEnd, ...]:
        """What is done when a frame is complete."""
        return tuple(self._at_ends.get(frame, ()))

    def forget_after(self, frame: int) -> None:
        """Something new after the end of `frame` makes void what was logged later."""
        for later in [f for f in self._edits if f > frame + 1]:
            del self._edits[later]
        for later in [f for f in self._at_ends if f > frame]:
            del self._at_ends[later]
