"""The one thread that writes to the page: the latest published state, each panel at its rate."""

from __future__ import annotations

import logging
import operator
import threading
import time
from dataclasses import dataclass
from typing import Protocol

import viser

from scene_core.session.commands import Command
from scene_core.session.published import Published
from web_panels.head import Head
from web_panels.layout import Layout
from web_panels.panel import Look, Page, Panel

log = logging.getLogger(__name__)

POLL_S = 0.004
BROKEN_S = 2.0
"""A panel that raised is tried again after this time."""


class Session(Protocol):
    """What the page needs of a running session."""

    @property
    def latest(self) -> Published | None: ...

    def post(self, command: Command, /) -> None: ...


@dataclass
class Turn:
    """When a panel was drawn, and what it showed."""

    panel: Panel
    due: float = 0.0
    seq: int = -1
    look: Look | None = None

    def stale(self, p: Published, look: Look) -> bool:
        moving = getattr(self.panel, "restless", False)
        return moving or self.seq != p.seq or self.look is not look


class ViewLoop:
    """Builds the page when the session first has something to show, then keeps it up to date."""

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        self.server, self.session = server, session
        self.page = Page()
        self.layout: Layout | None = None
        self.turns: dict[int, Turn] = {}
        self._mounts: object = None
        self._answered: tuple[object, ...] = ()
        self._stop = threading.Event()
        self.built = threading.Event()
        """Set once the page stands."""
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End the thread; the page stays as it is."""
        self._stop.set()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                worked = self._turn()
            except Exception:
                log.exception("the page could not be drawn")
                worked = False
                self._stop.wait(BROKEN_S)
            if not worked:
                self._stop.wait(POLL_S)

    def _turn(self) -> bool:
        """Draw the panel that has waited longest; False when nothing is to be done."""
        p = self.session.latest
        if p is None:
            return False
        if self.layout is None:
            self._build(p)
            return True
        if not self.server.get_clients():
            return False
        if p.experiment.estimator.mounts is not self._mounts:
            self.layout.fit_sensors(p)
            self._mounts = p.experiment.estimator.mounts
        self._answer()
        now, look = time.monotonic(), self.page.look
        ready = [t for t in self._all_turns() if t.due <= now and t.stale(p, look)]
        if not ready:
            return False
        self._draw(min(ready, key=lambda t: t.due), p, look)
        if p.mode != "playing":
            self.server.flush()
        return True

    def _answer(self) -> None:
        """Draw the prompt panels and send them off, when somebody at the page did something."""
        p = self.session.latest
        if p is None:
            return
        done = (p.run, p.experiment, p.pending, p.mode, p.selected, p.failure, p.speed)
        if len(done) == len(self._answered) and all(map(operator.is_, done, self._answered)):
            return
        self._answered = done
        for turn in self._all_turns():
            if getattr(turn.panel, "prompt", False) and turn.seq != p.seq:
                self._draw(turn, p, self.page.look)
        self.server.flush()

    def _build(self, p: Published) -> None:
        """The whole page, before anybody sees a part of it; nothing is left of a failed attempt."""
        layout = Layout(self.server, self.session.post, self.page)
        try:
            layout.build()
            layout.fit_sensors(p)
        except Exception:
            self.server.gui.reset()
            raise
        layout.dock()
        self.layout, self._mounts = layout, p.experiment.estimator.mounts
        for turn in self._all_turns():
            self._draw(turn, p, self.page.look)
        self.page.between = self._answer
        self.built.set()

    def _all_turns(self) -> list[Turn]:
        assert self.layout is not None
        panels = self.layout.panels
        self.turns = {id(x): self.turns.get(id(x)) or Turn(x) for x in panels}
        return list(self.turns.values())

    def _draw(self, turn: Turn, p: Published, look: Look) -> None:
        """Render one panel; what goes wrong in it is shown and does not stop the others."""
        key, name = id(turn.panel), type(turn.panel).__name__
        turn.due = max(turn.due, time.monotonic() - 0.1) + 1.0 / turn.panel.rate_hz
        turn.seq, turn.look = p.seq, look
        problems = self.page.problems
        try:
            turn.panel.render(p)
        except Exception as error:
            turn.due = time.monotonic() + BROKEN_S
            turn.seq = -1
            if key not in problems:
                log.exception("panel %s failed", name)
            text = f"{name} could not be drawn. {type(error).__name__}: {error}"
            self._report({**problems, key: text})
        else:
            if key in problems:
                self._report({k: v for k, v in problems.items() if k != key})

    def _report(self, problems: dict[int, str]) -> None:
        """Let the head show what could not be drawn, also while nothing else changes."""
        self.page.problems = problems
        for turn in self.turns.values():
            if isinstance(turn.panel, Head):
                turn.seq = -1
