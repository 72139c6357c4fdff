"""Looking again at the phases of a finished frame."""

from __future__ import annotations

import dataclasses

from scene_core.session.presets import build
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from tests.web.fakes import FakeSession
from tests.web.raw_client import raw_client
from tests.web.test_gate import free_port, wait
from web_panels import gate
from web_panels.phase_bodies import _sigma
from web_panels.phase_card import LAST, card_html, phase_names
from web_panels.view_loop import ViewLoop


def test_every_phase_has_a_name_and_its_own_card() -> None:
    session = Session(build("nomad"))
    trace = session.advance()
    names = phase_names(trace)
    assert names[:3] == ["1 Predict", "2 Internal", "3 Select · scanner"]
    cards = [card_html(trace, i) for i in range(len(names))]
    assert len(set(cards)) == len(names) == 7
    assert card_html(trace) == cards[-1]


def test_points_are_told_by_their_identity_and_have_no_correlation() -> None:
    session = Session(build("nomad"))
    session.advance()
    trace = session.advance()
    card = card_html(trace, 3)
    assert "told by" in card and "NCC" not in card and "positions" not in card


def test_a_chosen_phase_is_shown_until_the_frame_goes_and_nothing_is_asked_of_the_run() -> None:
    session = Session(build("nomad"))
    session.advance()
    fake = FakeSession(Runner(session).latest)
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    view = ViewLoop(server, fake)
    view.start()
    assert view.built.wait(20.0)
    with raw_client(server) as client:
        choice = client.input("Look at")
        client.set(choice["uuid"], "1 Predict")
        client.until(lambda m: "border-left:3px solid #4895ff" in str(m.get("updates")))
        assert fake.posted == []
        session.advance()
        assert fake.latest is not None
        fake.latest = dataclasses.replace(Runner(session).latest, seq=fake.latest.seq + 1)
        uuid = choice["uuid"]
        client.until(lambda m: m.get("uuid") == uuid and m.get("updates") == {"value": LAST})
        assert wait(lambda: view.page.problems == {})
    view.stop()
    server.stop()


def test_what_rounding_leaves_of_no_uncertainty_is_none() -> None:
    assert _sigma(5.1e-19) == "0"
    assert _sigma(0.0084) == "0.0084"
