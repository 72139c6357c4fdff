"""The page and a user's own models: reports, refusals, a hanging call, and nothing unescaped."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import viser

from scene_core.models import registry
from scene_core.models.judge import Line, Report
from scene_core.models.library import Library
from scene_core.models.plugins import UserFile, UserModel
from scene_core.session import commands
from scene_core.session.presets import build
from scene_core.session.published import Busy, Failure
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from tests.session.test_own_models import ROLE, TEXT
from tests.web.fakes import published
from tests.web.raw_client import raw_client
from tests.web.test_gate import free_port, wait
from web_panels import gate
from web_panels.head import head_html
from web_panels.main import watching
from web_panels.model_reports import reports_html
from web_panels.panel import Page
from web_panels.view_loop import ViewLoop

EVIL = "<img src=x onerror=alert(1)>"


def test_nothing_of_the_users_reaches_the_page_unescaped() -> None:
    report = Report(EVIL, "motion", (Line(EVIL, False, EVIL), Line(EVIL, True, "")), (EVIL,))
    models = (
        UserModel(EVIL, 1, "motion", EVIL, None, report, EVIL),
        UserModel(EVIL, 1, "motion", EVIL, None, None, EVIL),
    )
    text = reports_html([UserFile(EVIL, models, EVIL)])
    assert "<img" not in text and text.count("&lt;img") == 9
    p = dataclasses.replace(
        published("line"), busy=Busy(EVIL, EVIL, 3), failure=Failure(EVIL, EVIL), message=EVIL
    )
    assert "<img" not in head_html(p, Page())
    assert "has not returned for 3 s" in head_html(p, Page())


def test_a_report_is_open_where_a_law_is_broken() -> None:
    lines = (Line("kept", True, ""), Line("broken", False, "dfv_by_dxv[0, 2] is 1"))
    bad = UserModel("a.py", 1, "motion", "a", None, Report("a", "motion", lines), "does not")
    good = dataclasses.replace(bad, report=Report("a", "motion", lines[:1]), problem="")
    text = reports_html([UserFile("a.py", (bad,))])
    assert "<details open>" in text and "1 of 2 laws broken" in text and "not offered" in text
    assert text.index("✗") < text.index("✓")
    text = reports_html([UserFile("a.py", (good,))])
    assert "<details>" in text and "1 laws kept" in text and "conforms" in text
    assert reports_html([]) == ""


@dataclass
class Site:
    server: viser.ViserServer
    runner: Runner
    folder: Path

    def save(self, trouble: str) -> None:
        text = TEXT.replace("{trouble}", trouble)
        (self.folder / "mine.py").write_text(text, encoding="utf-8")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    monkeypatch.setattr("scene_core.session.runner.PATIENCE_S", 0.4)
    site = Site(None, None, tmp_path)  # type: ignore[arg-type]
    site.save("pass")
    library = Library(tmp_path)
    site.server = gate.guarded_server("127.0.0.1", free_port(), None)
    with Runner(Session(build("nomad")), files=library.files) as site.runner:
        view = ViewLoop(site.server, site.runner)
        view.start()
        watcher = watching(library, site.runner)
        assert view.built.wait(30.0)
        yield site
        watcher.stop()
        view.stop()
    site.server.stop()
    registry.add(registry.Added())


def test_a_model_is_chosen_saved_hangs_and_is_abandoned_in_the_page(site: Site) -> None:
    runner, gate_file = site.runner, site.folder / "open"
    with raw_client(site.server) as client:

        def shows(text: str) -> None:
            client.until(lambda m: text in str(m), timeout=20.0)

        shows("Your own models")
        shows("laws kept")
        motion = client.input("Motion of nomad")
        assert "mine" in motion["props"]["options"]
        client.set(motion["uuid"], "mine")
        shows("pose and map kept")
        site.save("1 / 0  # a bug")
        shows("mine.py was saved")
        runner.post(commands.SetSpeed(50.0))
        runner.post(commands.Transport("play"))
        shows("The run stopped.")
        shows("ZeroDivisionError")
        is_open = f"__import__('os').path.exists({str(gate_file)!r})"
        site.save(f"[time.sleep(0.02) for _ in iter(lambda: {is_open}, True)]")
        assert wait(lambda: "new version" in runner.latest.message, 20.0)
        assert runner.latest.failure is None
        button = client.until(lambda m: m.get("props", {}).get("label") == "Abandon")
        assert button["props"]["visible"] is False
        client.set(button["uuid"], True)  # it is not there: the gate does not let it through
        runner.post(commands.Transport("play"))
        shows("has not returned for")
        client.until(lambda m: m.get("updates", {}).get("visible") is True)
        stuck = runner._thread
        client.set(button["uuid"], True)
        shows("and was abandoned")
        assert runner._thread is not stuck
        gate_file.touch()
        stuck.join(5.0)
        assert not stuck.is_alive()
        runner.post(commands.Undo())
        frame = runner.latest.trace.frame.index if runner.latest.trace else -1
        assert wait(lambda: runner.latest.failure is None)
        runner.post(commands.SwapModel(ROLE, "planar nomad"))
        runner.post(commands.Transport("play"))
        assert wait(
            lambda: runner.latest.trace is not None and runner.latest.trace.frame.index > frame + 3
        )


def test_a_failing_model_is_shown_and_refused(site: Site) -> None:
    text = TEXT.replace("super().f(xv, u, dt, k)", "Transition(xv, 2 * np.eye(3))")
    (site.folder / "other.py").write_text(text.replace('"mine"', '"other"'), encoding="utf-8")
    with raw_client(site.server) as client:
        client.until(lambda m: "laws broken" in str(m), timeout=20.0)
        client.until(
            lambda m: (
                "other" in (m.get("props", {}).get("options") or ())
                and m["props"]["label"] == "Motion of nomad"
            ),
            timeout=20.0,
        )
        motion = [
            m
            for m in client.seen
            if m.get("props", {}).get("label") == "Motion of nomad"
            and "other" in m["props"]["options"]
        ][-1]
        client.set(motion["uuid"], "other")
        assert wait(lambda: "'other' does not conform" in site.runner.latest.message, 10.0)
        assert site.runner.latest.failure is None
        assert site.runner.latest.roles[0].current == "planar nomad"
