"""A session that runs nothing: it shows what it is given and writes down what it is asked."""

from __future__ import annotations

from scene_core.session.commands import Command
from scene_core.session.presets import build
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session


class FakeSession:
    """What the page needs of a runner."""

    def __init__(self, latest: Published | None) -> None:
        self.latest = latest
        self.posted: list[Command] = []

    def post(self, command: Command) -> None:
        self.posted.append(command)


def published(preset: str = "line", frames: int = 3) -> Published:
    """What a real session shows after some frames."""
    session = Session(build(preset))
    for _ in range(frames):
        session.advance()
    return Runner(session).latest
