"""The whole page in a real browser: play, step, edit, swap, click, reload; no console errors."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from scene_core.geometry import quaternion
from scene_core.session.commands import (
    LoadPreset,
    Select,
    SetSpeed,
    Transport,
    Undo,
    ZeroAxes,
)
from scene_core.session.presets import build
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from web_panels import gate
from web_panels.clouds import Clouds
from web_panels.style import STYLE_SHEET
from web_panels.view_loop import ViewLoop

FRAMES = 30
CONVERGED = 150
"""Frames after which ellipsoids are small enough to be hit one by one."""


@dataclass
class Site:
    url: str
    runner: Runner
    view: ViewLoop

    @property
    def latest(self) -> Published:
        return self.runner.latest


def wait(condition: Callable[[], bool], timeout: float = 20.0) -> bool:
    end = time.monotonic() + timeout
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


@pytest.fixture
def site() -> Iterator[Site]:
    """A paused run of the cloister, some frames in."""
    session = Session(build("cloister"))
    for _ in range(FRAMES):
        session.advance()
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    with Runner(session) as runner:
        server = gate.guarded_server("127.0.0.1", port, None)
        view = ViewLoop(server, runner)
        view.start()
        assert view.built.wait(20.0)
        yield Site(f"http://127.0.0.1:{port}", runner, view)
        view.stop()
        server.stop()


@pytest.fixture
def shown(site: Site, page: Page) -> Iterator[Page]:
    """The page, drawn; it leaves before the server does."""
    page.goto(site.url)
    expect(page.get_by_role("button", name="Play [Space]")).to_be_visible(timeout=30_000)
    assert wait(lambda: len(site.view.server.get_clients()) == 1)
    yield page
    page.goto("about:blank")
    assert wait(lambda: not site.view.server.get_clients())


def frame(site: Site) -> int:
    trace = site.latest.trace
    return -1 if trace is None else trace.frame.index


def test_the_page_shows_its_parts(site: Site, shown: Page) -> None:
    for text in ("preset", "Inspector", "Covariance", "Plots", "Events", "Models", "Estimator"):
        expect(shown.get_by_text(text, exact=True).first).to_be_visible()
    expect(shown.locator("#scene-legend")).to_contain_text("95 % in 3-D = 2.80 sigma")
    assert site.view.page.problems == {}


def test_play_and_pause(site: Site, shown: Page) -> None:
    before = frame(site)
    shown.get_by_role("button", name="Play [Space]").click()
    expect(shown.get_by_role("button", name="Pause [Space]")).to_be_visible(timeout=15_000)
    assert wait(lambda: frame(site) >= before + 5)
    shown.keyboard.press("Space")
    assert wait(lambda: site.latest.mode == "paused")
    stopped = frame(site)
    expect(shown.get_by_text(f"{stopped} of 400")).to_be_visible(timeout=15_000)


def test_keys_are_the_runs_after_a_click_on_a_control(site: Site, shown: Page) -> None:
    """Not those of what was clicked: Space would open a list again, or undo a tick."""
    shown.wait_for_function("!!window.sceneFocus")

    def plays_and_pauses() -> None:
        shown.wait_for_timeout(300)
        for mode in ("playing", "paused"):
            shown.keyboard.press("Space")
            assert wait(lambda mode=mode: site.latest.mode == mode)

    for tab in ("View", "Run"):
        shown.get_by_role("tab", name=tab, exact=True).click()
        plays_and_pauses()
    speed = shown.get_by_role("textbox", name="Speed").or_(
        shown.get_by_role("combobox", name="Speed")
    )
    speed.first.click()
    shown.get_by_role("option", name="0.5 ×", exact=True).click()
    assert wait(lambda: site.latest.speed == 0.5)
    plays_and_pauses()
    shown.get_by_role("tab", name="View", exact=True).click()
    truth = site.view.page.look.truth
    shown.get_by_role("checkbox", name="Truth").first.click()
    assert wait(lambda: site.view.page.look.truth != truth)
    plays_and_pauses()
    assert site.view.page.look.truth != truth


def test_what_the_style_sheet_is_about_is_marked_as_soon_as_it_comes(
    site: Site, shown: Page
) -> None:
    """By a script: a selector that looks into elements costs a fifth of the browser's time."""
    assert ":has(" not in STYLE_SHEET
    for tab, mark, marked in (
        ("Run", "data-half", "div>.mantine-Button-root[data-block]"),
        ("Estimator", "data-label", "p>label"),
        ("View", "data-half", "div>.mantine-Button-root[data-block]"),
    ):
        shown.get_by_role("tab", name=tab, exact=True).click()
        shown.wait_for_timeout(500)
        missed = shown.evaluate(
            "([mark, marked]) => [...document.querySelectorAll(marked)]"
            ".map(e => e.parentElement.hasAttribute(mark))",
            [mark, marked],
        )
        assert len(missed) >= 6 and all(missed)
    button = shown.get_by_role("button", name="Top").first.bounding_box()
    assert button is not None and button["width"] < 160, "two buttons beside each other"


def test_a_phone_shows_the_map_above_its_panels(site: Site, shown: Page) -> None:
    moved_up = "(() => { const v = __viserMutable.camera.view;"
    moved_up += " return v && v.enabled ? v.offsetY : 0; })()"
    assert shown.evaluate(moved_up) == 0
    shown.set_viewport_size({"width": 400, "height": 800})
    shown.wait_for_function(f"{moved_up} > 100", timeout=15_000)
    sheet = shown.locator('.mantine-Paper-root[style*="bottom: 0px"]').bounding_box()
    assert sheet is not None
    middle = 0.5 * 800 - shown.evaluate(moved_up)
    assert 0 < middle < sheet["y"]
    shown.set_viewport_size({"width": 1280, "height": 800})
    shown.wait_for_function(f"{moved_up} === 0", timeout=15_000)


def test_no_panel_of_a_phone_is_wider_than_the_screen(site: Site, shown: Page) -> None:
    shown.set_viewport_size({"width": 400, "height": 800})
    shown.wait_for_timeout(2000)
    sheet = '.mantine-Paper-root[style*="bottom: 0px"] .mantine-ScrollArea-viewport'
    for name in ("camera", "Inspector"):
        panel = shown.locator(sheet).get_by_text(name).filter(visible=True).last
        panel.click()
        shown.wait_for_timeout(1500)
        beyond = shown.locator(sheet).first.evaluate("e => e.scrollWidth - e.clientWidth")
        assert beyond <= 1, name


def test_the_panels_of_a_phone_are_above_the_controls(site: Site, shown: Page) -> None:
    """Below them nobody would find them."""
    shown.set_viewport_size({"width": 400, "height": 800})
    opener = shown.get_by_role("button", name="Expand panel camera")
    expect(opener).to_be_visible(timeout=15_000)
    row = opener.bounding_box()
    play = shown.get_by_role("button", name="Play [Space]").bounding_box()
    assert row is not None and play is not None
    assert row["y"] + row["height"] <= play["y"] < 800


def test_another_scenario_keeps_the_panels_where_they_are(site: Site, shown: Page) -> None:
    """Its sensor has another kind of picture; `page` fails on complaints in the console."""
    picture = shown.locator('img[src^="blob:"]').first
    expect(picture).to_be_visible(timeout=15_000)
    before = picture.bounding_box()
    run = site.latest.run
    site.runner.post(LoadPreset("nomad"))
    assert wait(lambda: site.latest.run != run)
    expect(shown.get_by_role("tab", name="scanner")).to_be_visible(timeout=15_000)
    site.runner.post(Transport("step frame"))
    expect(shown.get_by_text("range-bearing").or_(shown.get_by_text("b ±")).first).to_be_visible(
        timeout=15_000
    )
    shown.wait_for_timeout(1000)
    after = shown.locator('img[src^="blob:"]').filter(visible=True).first.bounding_box()
    assert before is not None and after is not None
    assert (after["x"], after["y"]) == (before["x"], before["y"])
    assert after["width"] == pytest.approx(before["width"], abs=2.0)


def test_step_by_phase_by_frame_back_and_redo(site: Site, shown: Page) -> None:
    before = frame(site)
    shown.keyboard.press("p")
    assert wait(lambda: frame(site) == before + 1)
    trace = site.latest.trace
    assert trace is not None and [r.phase for r in trace.records] == ["predict"]
    expect(shown.get_by_text("Predict", exact=True).first).to_be_visible(timeout=15_000)
    shown.keyboard.press("n")
    assert wait(lambda: (t := site.latest.trace) is not None and t.complete)
    assert frame(site) == before + 1
    shown.get_by_role("button", name="Back [B]").click()
    assert wait(lambda: frame(site) == before)
    shown.keyboard.press("r")
    assert wait(lambda: site.latest.message == f"frame {before} computed again")
    assert frame(site) == before


def test_drag_a_slider(site: Site, shown: Page) -> None:
    def budget() -> int:
        now = site.latest.pending or site.latest.experiment
        return now.estimator.policies.selection.budget

    before = budget()
    shown.get_by_role("tab", name="Estimator").click()
    row = shown.get_by_text("Select, max", exact=True)
    row.scroll_into_view_if_needed()
    thumb = shown.locator(".mantine-Slider-thumb").filter(visible=True)
    slider = _beside(shown, thumb, row.bounding_box())
    box = thumb.nth(slider).bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    shown.mouse.move(x, y)
    shown.mouse.down()
    for i in range(1, 6):
        shown.mouse.move(x + 6 * i, y)
        shown.wait_for_timeout(60)
    shown.mouse.up()
    assert wait(lambda: budget() > before)
    expect(shown.get_by_text("from the next frame").first).to_be_visible(timeout=15_000)
    expect(shown.get_by_text("Changed from the scenario").first).to_be_attached()
    undo = shown.get_by_role("button", name="Undo").filter(visible=True)
    assert wait(lambda: site.latest.can_undo)
    while site.latest.can_undo:
        seq = site.latest.seq
        undo.click()
        assert wait(lambda s=seq: site.latest.seq > s)
        shown.wait_for_timeout(80)
    assert budget() == before


def test_a_number_box_left_without_a_number_shows_what_is_in_force(site: Site, shown: Page) -> None:
    shown.get_by_role("tab", name="Estimator").click()
    row = shown.locator("label", has_text="Select, max")
    box = row.locator("xpath=ancestor::*[.//input][1]//input").last
    budget = site.latest.experiment.estimator.policies.selection.budget
    expect(box).to_have_value(str(budget), timeout=15_000)
    for typed in ("", "-"):
        box.click()
        shown.keyboard.press("Control+a")
        shown.keyboard.press("Delete")
        box.press_sequentially(typed)
        expect(box).to_have_value(typed)
        shown.keyboard.press("Tab")
        expect(box).to_have_value(str(budget))
    assert not site.latest.can_undo


def test_a_feature_that_was_deleted_comes_back_with_ctrl_z(site: Site, shown: Page) -> None:
    def mapped(label: int) -> bool:
        return (t := site.latest.trace) is not None and label in t.world.features

    label = 1
    assert mapped(label)
    site.runner.post(Select(label))
    shown.get_by_role("button", name=f"Delete feature {label}").click(timeout=15_000)
    assert wait(lambda: not mapped(label))
    shown.keyboard.press("Control+z")
    assert wait(lambda: mapped(label))
    expect(shown.get_by_text(f"undone: the deletion of feature {label}").first).to_be_visible()
    shown.keyboard.press("Control+Shift+z")
    assert wait(lambda: not mapped(label))


def test_the_room_is_in_its_place_again_when_a_move_of_the_axes_is_undone(
    site: Site, shown: Page
) -> None:
    """A browser leaves what is made anew where it was before."""
    place = "(() => { const n = __viserMutable.nodeRefFromName['/map/room'];"
    place += " return n ? [...n.position.toArray(), ...n.quaternion.toArray()] : null; })()"
    shown.wait_for_function(f"{place} !== null", timeout=15_000)
    at_first = shown.evaluate(place)
    # While the map is made anew there is no room for a moment, and NaN is neither more nor less.
    off = f"(p => p ? Math.max(...p.map((x, i) => Math.abs(x - {at_first}[i]))) : NaN)({place})"
    site.runner.post(ZeroAxes(next(iter(site.latest.experiment.estimator.robots))))
    shown.wait_for_function(f"{off} > 0.1", timeout=15_000)
    site.runner.post(Undo())
    shown.wait_for_function(f"{off} < 1e-6", timeout=15_000)


def _beside(page: Page, thumbs: object, row: object) -> int:
    """The thumb on the line of a label."""
    assert isinstance(row, dict)
    middle = row["y"] + row["height"] / 2
    boxes = [b for b in (t.bounding_box() for t in thumbs.all()) if b is not None]  # type: ignore[attr-defined]
    off = [abs(b["y"] + b["height"] / 2 - middle) for b in boxes]
    assert min(off) < 20
    return off.index(min(off))


def test_swap_a_model(site: Site, shown: Page) -> None:
    shown.get_by_role("tab", name="Models").click()
    choice = shown.get_by_role("textbox", name="Update").or_(
        shown.get_by_role("combobox", name="Update")
    )
    choice.first.click()
    shown.get_by_role("option", name="stacked").click()
    role = "estimator.policies.update.kind"

    def current() -> str:
        now = site.latest.pending or site.latest.experiment
        return now.estimator.policies.update.kind

    assert wait(lambda: current() == "stacked"), role
    before = frame(site)
    shown.keyboard.press("Escape")
    site.runner.post(Transport("step frame"))
    assert wait(lambda: frame(site) == before + 1 and site.latest.pending is None)
    assert site.latest.failure is None


def test_click_a_feature_in_the_image(site: Site, shown: Page) -> None:
    trace = site.latest.trace
    assert trace is not None
    chosen = next(a for a in trace.associations("camera") if a.verdict == "accepted")
    picture = shown.locator('img[src^="blob:"]').first
    expect(picture).to_be_visible(timeout=15_000)
    box = picture.bounding_box()
    assert box is not None
    shown.wait_for_timeout(500)
    u, v = (chosen.h + 0.5) / (640.0, 480.0)
    shown.mouse.click(box["x"] + u * box["width"], box["y"] + v * box["height"])
    assert wait(lambda: site.latest.selected == chosen.label)
    expect(shown.get_by_text(f"Feature {chosen.label}", exact=True)).to_be_visible(timeout=15_000)


def test_click_a_feature_in_the_map(site: Site, shown: Page) -> None:
    for command in (SetSpeed(float("inf")), Transport("play")):
        site.runner.post(command)
    assert wait(lambda: frame(site) >= CONVERGED)
    site.runner.post(Transport("pause"))
    assert wait(lambda: site.latest.mode == "paused")
    shown.wait_for_timeout(1500)
    label, (x, y) = _most_isolated(site, shown)
    shown.mouse.click(x, y)
    assert wait(lambda: site.latest.selected == label), (label, site.latest.selected)


def _most_isolated(site: Site, page: Page) -> tuple[int, tuple[float, float]]:
    """The feature that is farthest from all others on the screen, and where it is."""
    (client,) = site.view.server.get_clients().values()
    trace = site.latest.trace
    assert trace is not None
    cloud = Clouds().of(trace.world, 0.95, 0.0)
    camera = client.camera
    R = quaternion.matrix(np.asarray(camera.wxyz))
    seen = (cloud.positions - camera.position) @ R
    focal = 0.5 / np.tan(camera.fov / 2)
    canvas = page.evaluate(
        "(()=>{const r=window.__viserMutable.canvas.getBoundingClientRect();"
        "return [r.left,r.top,r.width,r.height]})()"
    )
    left, top, width, height = canvas
    at = np.c_[left + width / 2, top + height / 2] + height * focal * seen[:, :2] / seen[:, 2:]
    inside = (
        (seen[:, 2] > 0)
        & (np.abs(at[:, 0] - left - width / 2) < 0.45 * width)
        & (np.abs(at[:, 1] - top - 0.42 * height) < 0.38 * height)
    )
    apart = np.linalg.norm(at[:, None] - at[None], axis=2) + 1e9 * np.eye(len(at))
    size = height * focal * cloud.scales.max(axis=1) / np.abs(seen[:, 2])
    clear = np.where(inside, (apart - size).min(axis=1), -np.inf)
    best = int(clear.argmax())
    return cloud.labels[best], (float(at[best, 0]), float(at[best, 1]))


def test_a_reload_keeps_run_selection_and_camera(site: Site, shown: Page) -> None:
    trace = site.latest.trace
    assert trace is not None
    label = next(iter(trace.world.features))
    site.runner.post(Select(label))
    assert wait(lambda: site.latest.selected == label)
    box = shown.evaluate(
        "(()=>{const r=window.__viserMutable.canvas.getBoundingClientRect();"
        "return [r.left+r.width/2,r.top+r.height/2]})()"
    )
    shown.wait_for_timeout(1200)
    shown.mouse.move(*box)
    shown.mouse.down()
    for i in range(1, 12):
        shown.mouse.move(box[0] + 8 * i, box[1])
        shown.wait_for_timeout(100)
    shown.mouse.up()
    shown.wait_for_timeout(1500)
    (client,) = site.view.server.get_clients().values()
    kept, run = client.camera.position.copy(), site.latest.run
    start = np.asarray(site.view.server.initial_camera.position)
    assert np.linalg.norm(kept - start) > 0.2
    shown.reload()
    expect(shown.get_by_role("button", name="Play [Space]")).to_be_visible(timeout=30_000)

    def restored() -> bool:
        clients = list(site.view.server.get_clients().values())
        return len(clients) == 1 and float(np.linalg.norm(clients[0].camera.position - kept)) < 0.1

    assert wait(restored), [c.camera.position for c in site.view.server.get_clients().values()]
    assert (site.latest.run, site.latest.selected, frame(site)) == (run, label, FRAMES - 1)
