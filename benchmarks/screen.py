"""From a key to the screen: how long a real browser takes to show that an edit is in force.

The served page plays `room`; a slider is moved by its arrow keys. Three times are taken in the page
itself: when the key went down, when the card of changes said so, and when that frame was painted.
Without a graphics card Chromium draws the map on the processors that also run the filter: the same
is measured with the map covered, which is closer to a machine with a graphics card.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

from benchmarks.figures import machine, spread, table
from tests.browser.conftest import CHROMIUM, FLAGS

EDITED = "Select, max"
SETTLE_MS = 4000
"""The first seconds of a page are spent on shaders."""

WATCH = """
(label) => {
  const rows = () => [...document.querySelectorAll('.e .card tr')]
    .filter(r => r.firstChild.textContent === label && r.offsetParent);
  const text = () => rows().map(r => r.textContent).join('');
  const seen = window.sceneSeen = {key: 0, told: 0, painted: 0, busy: false, before: ''};
  addEventListener('keydown', e => {
    if (seen.busy) return;
    Object.assign(seen, {key: e.timeStamp, told: 0, painted: 0, busy: true, before: text()});
  }, true);
  new MutationObserver(() => {
    if (!seen.busy || seen.told || text() === seen.before) return;
    seen.told = performance.now();
    requestAnimationFrame(() => {
      const after = new MessageChannel();
      after.port1.onmessage = () => { seen.painted = performance.now(); seen.busy = false; };
      after.port2.postMessage(0);
    });
  }).observe(document.body, {childList: true, subtree: true, characterData: true});
}
"""

FRAME_TIMES = """
() => new Promise(done => {
  const times = []; let last = performance.now();
  const tick = now => {
    times.push(now - last); last = now;
    times.length < 20 ? requestAnimationFrame(tick) : done(times.slice(1));
  };
  requestAnimationFrame(tick);
})
"""

COVER = "() => { window.__viserMutable.canvas.parentElement.style.display = 'none'; }"


@contextmanager
def served(port: int) -> Iterator[str]:
    """`scene serve` in a process of its own; gives its address."""
    app = Path(__file__).resolve().parents[1] / "app.py"
    command = [sys.executable, str(app), "serve", "--preset", "room", "--port", str(port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        for line in process.stdout:
            if found := re.search(r"http://\S+", line):
                yield found[0]
                break
        else:
            raise RuntimeError(f"the page did not start on port {port}")
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=20)


def thumb_of(page: Page, label: str) -> Any:
    """The thumb of the slider that stands beside a label."""
    page.get_by_role("tab", name="Estimator").click()
    row = page.get_by_text(label, exact=True).filter(visible=True).first
    row.scroll_into_view_if_needed()
    page.wait_for_timeout(500)
    thumbs = page.locator(".mantine-Slider-thumb").filter(visible=True).all()
    at = row.bounding_box()
    assert at is not None
    boxes = [thumb.bounding_box() for thumb in thumbs]
    off = [abs(b["y"] + b["height"] / 2 - at["y"] - at["height"] / 2) if b else 1e9 for b in boxes]
    return thumbs[int(np.argmin(off))]


def delays(page: Page, edits: int) -> np.ndarray:
    """Milliseconds (edits, 2) from a key to the words that tell of it, and to their painting."""
    thumb = thumb_of(page, EDITED)
    page.evaluate(WATCH, EDITED)
    rng, out = np.random.default_rng(0), []
    for i in range(edits + 1):
        thumb.focus()
        page.keyboard.press("ArrowRight" if i < 4 or i % 2 else "ArrowLeft")
        page.wait_for_function("sceneSeen.painted > 0", timeout=10_000)
        seen = page.evaluate("sceneSeen")
        out.append((seen["told"] - seen["key"], seen["painted"] - seen["key"]))
        page.wait_for_timeout(float(rng.uniform(250, 450)))
    return np.array(out[1:])


def rows(name: str, page: Page, edits: int) -> list[tuple[str, str]]:
    took = delays(page, edits)
    frames = page.evaluate(FRAME_TIMES)
    return [
        (f"{name}: key to the words", f"{spread(took[:, 0])}, 95 % {_p95(took[:, 0]):.0f} ms"),
        (f"{name}: key to the screen", f"{spread(took[:, 1])}, 95 % {_p95(took[:, 1]):.0f} ms"),
        (f"{name}: time between the browser's frames", spread(frames)),
    ]


def _p95(values: np.ndarray) -> float:
    return float(np.percentile(values, 95))


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=8981)
    parser.add_argument("--edits", type=int, default=40)
    parser.add_argument("--size", default="1280x800", help="of the window")
    options = parser.parse_args(argv)
    width, height = map(int, options.size.split("x"))
    if not os.path.exists(CHROMIUM):
        print(f"\nscreen: no browser at {CHROMIUM}; install chromium, or set CHROMIUM to its path")
        return
    with served(options.port) as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": width, "height": height})
        page.goto(url)
        page.get_by_role("button", name="Pause [Space]").wait_for(timeout=60_000)
        page.wait_for_timeout(SETTLE_MS)
        found = rows("with the map", page, options.edits)
        page.evaluate(COVER)
        page.wait_for_timeout(1000)
        found += rows("map covered", page, options.edits)
        browser.close()
    table(f"screen: room playing in {width} x {height}, {options.edits} edits by keyboard", found)


if __name__ == "__main__":
    print(machine())
    main()
