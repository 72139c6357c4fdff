"""The ticks that put a calibration or a pose into the state."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from scene_core.session.commands import SetParam
from scene_core.session.estimated import estimables
from scene_core.session.presets import build
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from tests.web.fakes import FakeSession
from tests.web.raw_client import RawClient, raw_client
from tests.web.test_gate import free_port, wait
from web_panels import gate
from web_panels.estimate_this import now_html, offered
from web_panels.view_loop import ViewLoop

SCALE = "estimator.robots.nomad.calib_sd.speed scale"


@pytest.fixture
def nomad() -> Session:
    session = Session(build("nomad"))
    for _ in range(5):
        session.advance()
    return session


@pytest.fixture
def client(nomad: Session) -> Iterator[tuple[RawClient, FakeSession]]:
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    fake = FakeSession(Runner(nomad).latest)
    view = ViewLoop(server, fake)
    view.start()
    assert view.built.wait(20.0)
    with raw_client(server) as client:
        yield client, fake
    assert view.page.problems == {}
    view.stop()
    server.stop()


def posted(fake: FakeSession) -> object:
    assert wait(lambda: len(fake.posted) == 1)
    return fake.posted.pop()


def test_a_tick_puts_it_into_the_state_and_takes_it_out(
    client: tuple[RawClient, FakeSession],
) -> None:
    me, fake = client
    tick, sd = me.input("Estimate speed scale"), me.input("speed scale ±")
    assert tick["value"] is True and sd["value"] == 0.2
    me.set(tick["uuid"], False)
    assert posted(fake) == SetParam(SCALE, None)
    me.set(sd["uuid"], 0.4)
    assert posted(fake) == SetParam(SCALE, 0.4)


def test_of_what_is_not_ticked_the_sd_waits_for_the_tick(
    client: tuple[RawClient, FakeSession],
) -> None:
    me, fake = client
    tick, sd = me.input("Estimate phi"), me.input("phi ± °")
    assert tick["value"] is False and sd["value"] == 1.0
    me.set(sd["uuid"], 5.0)
    time.sleep(0.5)
    assert fake.posted == []
    me.set(tick["uuid"], True)
    command = posted(fake)
    assert isinstance(command, SetParam)
    assert command.path == "estimator.mounts.scanner.pose_sd.phi"
    assert command.value == pytest.approx(5.0 / 57.29577951308232)


def test_the_numbers_are_those_of_the_state(nomad: Session) -> None:
    settings = nomad.experiment.estimator
    by_block = {e.block: e for e in estimables(settings)}
    scale, pose = by_block["robot:nomad:calib"], by_block["mount:scanner:pose"]
    assert "±" in now_html(nomad.world, scale) and "known" not in now_html(nomad.world, scale)
    assert now_html(nomad.world, pose).count("known") == 3
    nomad.apply(SetParam(f"{pose.path}.phi", 0.1))
    nomad.advance()
    text = now_html(nomad.world, pose)
    assert text.count("known") == 2 and text.count("±") == 1


def test_an_sd_is_offered_by_unit_unless_the_scenario_has_one(nomad: Session) -> None:
    settings = nomad.experiment.estimator
    by_block = {e.block: e for e in estimables(settings)}
    assert offered(by_block["robot:nomad:calib"], "speed scale", settings) == 0.2
    assert offered(by_block["mount:scanner:pose"], "x", settings) == 0.05
    camera = build("cloister").estimator
    calib = next(e for e in estimables(camera) if e.block == "mount:camera:calib")
    assert offered(calib, calib.labels[0], camera) == 10.0
