"""The view loop: builds once, the latest state wins, a broken panel does not stop the others."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import viser

from scene_core.session import commands
from scene_core.session.published import Failure, Published
from tests.web.fakes import FakeSession, published
from tests.web.raw_client import RawClient, raw_client
from tests.web.test_gate import free_port, wait
from web_panels import gate, viser_hooks
from web_panels.head import head_html
from web_panels.panel import Page
from web_panels.view_loop import Turn, ViewLoop


@dataclasses.dataclass
class Site:
    server: viser.ViserServer
    session: FakeSession
    view: ViewLoop


@pytest.fixture(scope="module")
def start() -> Published:
    return published("line")


@pytest.fixture(scope="module")
def site(start: Published) -> Iterator[Site]:
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    session = FakeSession(start)
    view = ViewLoop(server, session)
    view.start()
    assert view.built.wait(20.0)
    yield Site(server, session, view)
    view.stop()
    server.stop()


class Counting:
    """A panel that counts, and raises when told to."""

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self.seen: list[int] = []
        self.broken = ""

    def build(self, server: viser.ViserServer, post: Any) -> None: ...

    def render(self, p: Published) -> None:
        if self.broken:
            raise RuntimeError(self.broken)
        self.seen.append(p.seq)


def with_seq(p: Published, seq: int, **changes: Any) -> Published:
    return dataclasses.replace(p, seq=seq, **changes)


def test_nothing_failed_to_draw(site: Site) -> None:
    assert site.view.page.problems == {}


@pytest.fixture
def counting(site: Site) -> Iterator[Counting]:
    panel = Counting(20.0)
    assert site.view.layout is not None
    site.view.layout.fixed.append(panel)
    yield panel
    site.view.layout.fixed.remove(panel)
    site.view.page.problems = {}


def test_without_a_browser_nothing_is_drawn(
    site: Site, counting: Counting, start: Published
) -> None:
    assert wait(lambda: not site.server.get_clients())
    site.session.latest = with_seq(start, start.seq + 1)
    time.sleep(0.2)
    assert counting.seen == []
    with raw_client(site.server):
        assert wait(lambda: counting.seen == [start.seq + 1])


def test_the_latest_state_wins_at_the_panels_own_rate(
    site: Site, counting: Counting, start: Published
) -> None:
    with raw_client(site.server):
        assert wait(lambda: len(site.server.get_clients()) > 0)
        t0, seq = time.monotonic(), start.seq + 1000
        while time.monotonic() - t0 < 1.0:
            seq += 1
            site.session.latest = with_seq(start, seq)
            time.sleep(0.002)
        assert wait(lambda: counting.seen[-1:] == [seq]), "the last state is always drawn"
    assert 5 <= len(counting.seen) <= 26
    assert counting.seen == sorted(set(counting.seen))


def test_a_broken_panel_is_reported_and_the_others_go_on(
    site: Site, counting: Counting, start: Published
) -> None:
    other = Counting(20.0)
    assert site.view.layout is not None
    site.view.layout.fixed.append(other)
    counting.broken = "no <such> thing"
    with raw_client(site.server) as client:
        assert wait(lambda: len(site.server.get_clients()) > 0)
        site.session.latest = with_seq(start, start.seq + 5000)
        assert wait(lambda: "Counting" in str(site.view.page.problems))
        assert wait(lambda: other.seen[-1:] == [start.seq + 5000])
        client.until(lambda m: "no &lt;such&gt; thing" in str(m.get("updates")))
        counting.broken = ""
        assert wait(lambda: site.view.page.problems == {})
    site.view.layout.fixed.remove(other)


class Slow(Counting):
    """A panel whose rendering has a seam; it remembers how often the prompt one was drawn there."""

    def __init__(self, page: Page, edit: Callable[[], None]) -> None:
        super().__init__(5.0)
        self.page, self.edit, self.inside = page, edit, []
        self.other: Counting | None = None

    def render(self, p: Published) -> None:
        super().render(p)
        assert self.other is not None
        self.edit()
        before = len(self.other.seen)
        self.page.between()
        self.inside.append(len(self.other.seen) - before)


def test_an_edit_is_answered_inside_a_long_rendering(
    site: Site, counting: Counting, start: Published
) -> None:
    counting.rate_hz = 0.1
    counting.prompt = True  # type: ignore[attr-defined]
    edited = with_seq(start, start.seq + 7001, pending=dataclasses.replace(start.experiment))
    slow = Slow(site.view.page, lambda: setattr(site.session, "latest", edited))
    slow.other = counting
    with raw_client(site.server):
        assert wait(lambda: len(counting.seen) > 0)
        assert site.view.layout is not None
        site.view.layout.fixed.append(slow)
        assert wait(lambda: len(slow.seen) >= 2 or slow.inside == [1])
        assert slow.inside[:1] == [1], "drawn in the seam, long before its own turn"
        assert counting.seen[-1] == edited.seq
    site.view.layout.fixed.remove(slow)


def test_a_changed_look_draws_everything_again(
    site: Site, counting: Counting, start: Published
) -> None:
    with raw_client(site.server):
        assert wait(lambda: len(counting.seen) > 0)
        before = len(counting.seen)
        site.view.page.change(confidence=0.5)
        assert wait(lambda: len(counting.seen) == before + 1)


def press(site: Site, client: RawClient, label: str) -> commands.Command:
    site.session.posted.clear()
    client.set(client.input(label)["uuid"], True)
    assert wait(lambda: len(site.session.posted) == 1)
    return site.session.posted[0]


@pytest.mark.parametrize(
    ("label", "action"),
    [
        ("Next frame [N]", "step frame"),
        ("Next phase [P]", "step phase"),
        ("Redo frame [R]", "redo"),
        ("Reset run", "reset"),
    ],
)
def test_buttons_post_their_command(site: Site, label: str, action: Any) -> None:
    with raw_client(site.server) as client:
        assert press(site, client, label) == commands.Transport(action)


def test_hotkeys_post_their_command(site: Site) -> None:
    with raw_client(site.server) as client:
        command = client.until(
            lambda m: m["type"] == "RegisterCommandMessage" and m["props"]["hotkey"] == "space"
        )
        site.session.posted.clear()
        client.send("CommandTriggerMessage", uuid=command["uuid"])
        assert wait(lambda: site.session.posted == [commands.Transport("toggle")])


@pytest.mark.parametrize(
    ("modifier", "command"),
    [("cmd/ctrl", commands.Undo()), ("cmd/ctrl+shift", commands.Redo())],
)
def test_one_hotkey_undoes_and_one_does_again(site: Site, modifier: str, command: Any) -> None:
    with raw_client(site.server) as client:
        client.settle()
        registered = [m for m in client.seen if m["type"] == "RegisterCommandMessage"]
        (key,) = [m for m in registered if m["props"]["modifier"] == modifier]
        assert key["props"]["hotkey"] == "Z"
        site.session.posted.clear()
        client.send("CommandTriggerMessage", uuid=key["uuid"])
        assert wait(lambda: site.session.posted == [command])


def test_parameters_and_models_post_their_command(site: Site, start: Published) -> None:
    with raw_client(site.server) as client:
        site.session.posted.clear()
        client.set(client.input("Select, max")["uuid"], 7)
        assert wait(lambda: len(site.session.posted) == 1)
        path = "estimator.policies.selection.budget"
        assert site.session.posted == [commands.SetParam(path, 7)]
        site.session.posted.clear()
        client.set(client.input("Update")["uuid"], "sequential")
        role = "estimator.policies.update.kind"
        assert wait(lambda: site.session.posted == [commands.SwapModel(role, "sequential")])


def test_another_scenario_brings_its_own_sensors_and_inputs(site: Site, start: Published) -> None:
    with raw_client(site.server) as client:
        assert wait(lambda: len(site.server.get_clients()) > 0)
        other = with_seq(published("nomad"), start.seq + 9000, run=start.run + 7)
        site.session.latest = other
        assert site.view.layout is not None
        layout = site.view.layout
        assert wait(lambda: set(layout.sensors) == set(other.experiment.estimator.mounts))
        client.until(lambda m: "speed" in str(m.get("props", {}).get("label", "")).lower())
        site.session.latest = with_seq(start, start.seq + 9001, run=start.run + 8)
        assert wait(lambda: set(layout.sensors) == set(start.experiment.estimator.mounts))
        time.sleep(0.3)
        assert site.view.page.problems == {}


def test_widgets_of_another_scenario_go_when_their_last_news_is_old(
    site: Site, start: Published, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A browser applies what came since its last picture at once, removals first."""
    monkeypatch.setattr(viser_hooks, "RETIRED_S", 0.8)
    hidden: dict[str, float] = {}
    gone: dict[str, float] = {}
    with raw_client(site.server) as client:
        assert wait(lambda: len(site.server.get_clients()) > 0)
        client.settle()
        site.session.latest = with_seq(published("nomad"), start.seq + 9100, run=start.run + 9)
        end = time.monotonic() + 20.0
        while not hidden.keys() & gone.keys():
            assert time.monotonic() < end, "nothing was hidden and removed"
            for m in client.receive():
                if m["type"] == "GuiRemoveMessage":
                    gone[m["uuid"]] = time.monotonic()
                elif m["type"] == "GuiUpdateMessage" and m["updates"].get("visible") is False:
                    hidden[m["uuid"]] = time.monotonic()
    assert all(gone[uuid] - hidden[uuid] > 0.6 for uuid in hidden.keys() & gone.keys())


def test_the_sensors_panel_always_keeps_a_tab(site: Site, start: Published) -> None:
    """Without, browsers would give up its place and its width."""
    assert site.view.layout is not None
    layout = site.view.layout
    with raw_client(site.server):
        assert wait(lambda: len(site.server.get_clients()) > 0)
        for i, preset in enumerate(("cloister", "two_cameras", "line")):
            before = {tab._id for _, tab, _ in layout.sensors.values()}
            other = with_seq(published(preset), start.seq + 9200 + i, run=start.run + 10 + i)
            site.session.latest = other
            names = list(other.experiment.estimator.mounts)
            assert wait(lambda names=names: list(layout.sensors) == names)
            now = {tab._id: tab._label for _, tab, _ in layout.sensors.values()}
            assert before & now.keys() and list(now.values()) == names


def test_nothing_of_the_run_before_stays_in_sight(site: Site, start: Published) -> None:
    assert site.view.layout is not None
    layout = site.view.layout
    told = layout.panels

    def texts() -> str:
        handles = [h for panel in told for h in vars(panel).values()]
        return " ".join(h.content for h in handles if isinstance(h, viser.GuiHtmlHandle))

    with raw_client(site.server):
        assert wait(lambda: len(site.server.get_clients()) > 0)
        site.session.latest = with_seq(start, start.seq + 9300, run=start.run + 20)
        assert wait(lambda: "Blocks of H" in texts() and "partial 0" in texts())
        told = layout.panels
        fresh = dataclasses.replace(start, trace=None, series=published("line", 0).series)
        site.session.latest = with_seq(fresh, start.seq + 9301, run=start.run + 21)
        assert wait(lambda: "Blocks of H" not in texts() and "partial 0" not in texts())
        for what in ("No frame yet", "Nothing to inspect yet", "No state yet", "second frame"):
            assert wait(lambda what=what: what in texts()), what


def test_the_head_shows_failures_and_pending_edits_escaped(start: Published) -> None:
    failed = dataclasses.replace(
        start,
        failure=Failure("<script>alert(1)</script>: give a smaller noise", "Traceback <x>"),
        pending=start.experiment,
        message="swap & keep",
    )
    text = head_html(failed, Page())
    assert "&lt;script&gt;" in text and "<script>" not in text
    assert "Traceback &lt;x&gt;" in text and "swap &amp; keep" in text
    assert "from the next frame" in text
    assert "from the next frame" not in head_html(start, Page())


def test_a_turn_is_stale_until_drawn(start: Published) -> None:
    page = Page()
    turn = Turn(Counting(5.0))
    assert turn.stale(start, page.look)
    turn.seq, turn.look = start.seq, page.look
    assert not turn.stale(start, page.look)
    page.change(truth=False)
    assert turn.stale(start, page.look)
