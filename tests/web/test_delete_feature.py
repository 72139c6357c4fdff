"""The button that forgets the selected feature."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from scene_core.session.commands import DeleteFeature, Select
from scene_core.session.presets import build
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from tests.web.fakes import FakeSession
from tests.web.raw_client import Message, raw_client
from tests.web.test_gate import free_port, wait
from web_panels import gate
from web_panels.delete_feature import deletable
from web_panels.view_loop import ViewLoop


def selected(preset: str, label: int | None = None) -> tuple[Session, Published]:
    session = Session(build(preset))
    for _ in range(8):
        session.advance()
    session.apply(Select(label or min(session.world.features)))
    return session, Runner(session).latest


def updates(message: Message, uuid: str) -> dict[str, Any]:
    """What a message changes of a widget."""
    return message.get("updates", {}) if message.get("uuid") == uuid else {}


def test_only_what_is_selected_and_in_the_map_can_be_deleted() -> None:
    session, p = selected("cloister")
    assert deletable(p) == session.selected is not None
    assert deletable(replace(p, selected=None)) is None
    assert deletable(replace(p, selected=999)) is None
    assert deletable(replace(p, trace=None)) is None


def test_a_marker_stays_as_long_as_its_robot() -> None:
    session, p = selected("cooperation")
    (marker,) = [f.label for f in session.world.features.values() if f.carrier]
    assert deletable(replace(p, selected=marker)) is None


def test_the_button_names_the_feature_and_is_gone_with_it() -> None:
    session, p = selected("cloister")
    label = session.selected
    assert label is not None
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    fake = FakeSession(replace(p, selected=None))
    view = ViewLoop(server, fake)
    view.start()
    try:
        assert view.built.wait(20.0)
        with raw_client(server) as me:
            button = me.input("Delete feature")
            uuid = button["uuid"]
            assert button["props"]["visible"] is False
            fake.latest = replace(p, seq=10)
            me.until(lambda m: updates(m, uuid).get("label") == f"Delete feature {label}")
            me.until(lambda m: updates(m, uuid).get("visible") is True)
            me.set(uuid, True)
            assert wait(lambda: fake.posted == [DeleteFeature(label)])
            session.apply(DeleteFeature(label))
            fake.latest = replace(Runner(session).latest, seq=11)
            me.until(lambda m: updates(m, uuid).get("visible") is False)
        assert view.page.problems == {}
    finally:
        view.stop()
        server.stop()
