"""Draw the pictures of the documentation: drive the real page in Chromium, into docs/pictures.

Run by `make pictures`. Every picture is of a fixed frame of a fixed seed, so that it shows the same
numbers again. CHROMIUM names the browser where it is not Debian's.
"""

from __future__ import annotations

import argparse
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from playwright.sync_api import Browser, Page, expect, sync_playwright

from scene_core.filter.records import Association
from scene_core.session.presets import build
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from web_panels import gate
from web_panels.view_loop import ViewLoop

FOLDER = Path(__file__).parent.parent / "docs" / "pictures"
CHROMIUM = os.environ.get("CHROMIUM") or "/usr/bin/chromium"
FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-dev-shm-usage",
]
MAX_BYTES = 350_000
PLAYED = 60
"""So many frames are played by the page itself, the ones before them without it."""


@dataclass
class Site:
    """The running application and a browser that looks at it."""

    runner: Runner
    page: Page

    @property
    def latest(self) -> Published:
        return self.runner.latest

    @property
    def frame(self) -> int:
        return -1 if self.latest.trace is None else self.latest.trace.frame.index


def wait(condition: Callable[[], bool], what: str, timeout: float = 60.0) -> None:
    """Until the condition holds; a picture of anything else would be wrong."""
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"waited {timeout:g} s for {what}")
        time.sleep(0.02)


@contextmanager
def shown(
    browser: Browser, preset: str, frame: int, size: tuple[int, int] = (1440, 900)
) -> Iterator[Site]:
    """The page of a preset, played up to a frame and paused there."""
    session = Session(build(preset))
    for _ in range(frame + 1 - PLAYED):
        session.advance()
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    with Runner(session) as runner:
        server = gate.guarded_server("127.0.0.1", port, None)
        view = ViewLoop(server, runner)
        view.start()
        wait(view.built.is_set, "the page to be built")
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        try:
            page.goto(f"http://127.0.0.1:{port}")
            expect(page.get_by_role("button", name="Play [Space]")).to_be_visible(timeout=60_000)
            site = Site(runner, page)
            page.wait_for_timeout(2000)
            _close_notices(page)
            _play_to(site, frame)
            yield site
        finally:
            page.close()
            view.stop()
            server.stop()


def _close_notices(page: Page) -> None:
    """Software rendering is this script's, not the reader's: close the warning about it."""
    buttons = page.locator(".mantine-Notification-closeButton")
    for _ in range(buttons.count()):
        buttons.first.click()


def _play_to(site: Site, frame: int) -> None:
    before = site.frame
    site.page.get_by_role("button", name="Play [Space]").click()
    wait(lambda: site.frame > before, "the run to play")
    site.page.keyboard.press("Space")
    wait(lambda: site.latest.mode == "paused", "the run to pause")
    while site.frame != frame:
        at = site.frame
        if at == frame - 1:  # the page is at rest, so that the time per phase is the filter's
            site.page.wait_for_timeout(3000)
        site.page.keyboard.press("n" if at < frame else "b")
        wait(lambda at=at: site.frame != at, "the next frame")


def click_feature(site: Site, mount: str, wanted: Callable[[Association], float]) -> int:
    """Click the accepted match that is wanted most, in the image; its label."""
    trace = site.latest.trace
    assert trace is not None
    judged = [a for r in trace.records if r.mount == mount for a in r.associations]
    accepted = [a for a in judged if a.verdict == "accepted"]
    chosen = max(accepted, key=wanted)
    sensor = trace.world.mounts[mount].sensor
    size = [high - low for low, high in sensor.limits]
    picture = site.page.locator('img[src^="blob:"]').first
    expect(picture).to_be_visible(timeout=60_000)
    site.page.wait_for_timeout(2000)
    box = picture.bounding_box()
    assert box is not None
    u, v = (chosen.h + 0.5) / size
    site.page.mouse.click(box["x"] + u * box["width"], box["y"] + v * box["height"])
    wait(lambda: site.latest.selected == chosen.label, f"feature {chosen.label} to be selected")
    return chosen.label


def save(site: Site, name: str) -> None:
    """What the page shows, once it has settled, as a JPEG within the limit."""
    site.page.mouse.move(700, 30)
    site.page.wait_for_timeout(2500)
    path = FOLDER / f"{name}.jpg"
    for quality in (90, 84, 78, 70, 60):
        site.page.screenshot(path=path, type="jpeg", quality=quality)
        if path.stat().st_size <= MAX_BYTES:
            print(f"{path.name}: frame {site.frame}, {path.stat().st_size // 1000} kB")
            return
    raise ValueError(f"{path} is larger than {MAX_BYTES} bytes at any quality")


def room(browser: Browser) -> None:
    """The page as it opens, some seconds in, with a feature in the inspector."""
    with shown(browser, "room", 270) as site:
        click_feature(site, "camera", lambda a: float(np.linalg.det(a.S)))
        save(site, "room")


def phases(browser: Browser) -> None:
    """A frame stopped at its gate."""
    with shown(browser, "cloister", 120) as site:
        for phase in ("predict", "internal", "select", "search", "associate"):
            site.page.keyboard.press("p")
            wait(lambda p=phase: _last_phase(site) == p, f"phase {phase}")
        click_feature(site, "camera", lambda a: float(np.linalg.det(a.S)))
        save(site, "phases")


def _last_phase(site: Site) -> str:
    trace = site.latest.trace
    return trace.records[-1].phase if trace and trace.records else ""


def plots(browser: Browser) -> None:
    """Error, NEES and NIS of a whole circle."""
    with shown(browser, "cloister", 398) as site:
        site.page.get_by_role("tab", name="Plots").click()
        save(site, "plots")


def covariance(browser: Browser) -> None:
    """The covariance by blocks, and the map coloured by correlation."""
    with shown(browser, "nomad", 250) as site:
        site.page.get_by_role("tab", name="Covariance").click()
        save(site, "covariance")


PICTURES: dict[str, Callable[[Browser], None]] = {
    f.__name__: f for f in (room, phases, plots, covariance)
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", nargs="*", choices=[[], *PICTURES], help="only these pictures")
    names = parser.parse_args().name or list(PICTURES)
    FOLDER.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        for name in names:
            PICTURES[name](browser)
        browser.close()


if __name__ == "__main__":
    main()
