"""What was asked for and not yet done: from any thread, to the one that runs."""

from __future__ import annotations

import queue

from scene_core.session.commands import Command, ModelsSaved, Refresh


class Nothing:
    """What is there when no command came in time."""


NOTHING = Nothing()


class Inbox:
    """Commands in the order they were posted."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Command | None] = queue.SimpleQueue()

    def post(self, command: Command | None) -> None:
        """Ask for something, None for the end; returns at once."""
        self._queue.put(command)

    def next(self, wait: float | None = None) -> Command | Nothing | None:
        """The next command, waiting for it this long [s], or for ever."""
        try:
            if wait is None:
                return self._queue.get()
            return self._queue.get(timeout=wait) if wait > 0 else self._queue.get_nowait()
        except queue.Empty:
            return NOTHING

    def drop_requests(self) -> int:
        """Forget what a person asked for and nobody answered; returns how many commands."""
        waiting, dropped = [], 0
        while not isinstance(command := self.next(0.0), Nothing):
            if command is None or isinstance(command, (ModelsSaved, Refresh)):
                waiting.append(command)
            else:
                dropped += 1
        for command in waiting:
            self.post(command)
        return dropped
