"""The map gives way to the page in a slow browser, and only there: a renderer with a clock of its
own, since how fast this machine draws is not ours to say."""

from __future__ import annotations

import numpy as np
import pytest
from playwright.sync_api import Page

from web_panels.map_pace import LONGEST_REST_MS, SLOW_MS, pace_html

RENDERER = """(took) => {
  const scene = {}, canvas = document.createElement('canvas');
  document.body.appendChild(canvas);
  window.drawn = [];
  const gl = {
    SIGNALED: 1, SYNC_STATUS: 2, SYNC_GPU_COMMANDS_COMPLETE: 3,
    isContextLost: () => false, flush: () => {}, deleteSync: () => {},
    fenceSync: () => ({done: performance.now() + took}),
    getSyncParameter: f => performance.now() >= f.done ? 1 : 0,
  };
  window.renderer = {
    domElement: canvas, getContext: () => gl, getRenderTarget: () => null,
    render: () => { drawn.push(performance.now()); scene.onAfterRender?.(renderer); },
  };
  window.__viserMutable = {scene, canvas, requestRender: () => renderer.render(scene)};
}"""

PLAY = """(seconds) => new Promise(done => {
  const m = __viserMutable, from = performance.now();
  let asked = 0;
  const tick = now => {
    renderer.render(m.scene);
    asked += 1;
    now - from < 1000 * seconds ? requestAnimationFrame(tick) : done([asked, performance.now()]);
  };
  requestAnimationFrame(tick);
})"""

PRESS = "() => on().dispatchEvent(new PointerEvent('pointerdown', {bubbles: true}))"


@pytest.fixture
def paced(page: Page) -> Page:
    """A page with the script and nothing else."""
    page.goto("about:blank")
    return page


def install(page: Page, took: float) -> None:
    """A renderer whose pictures take so many ms, and the script in front of it."""
    page.evaluate(RENDERER, took)
    page.evaluate(
        "html => document.body.appendChild(document.createElement('div')).innerHTML = html",
        pace_html(),
    )
    page.wait_for_function("!!(window.scenePace && __viserMutable.scene.onAfterRender)")
    page.evaluate("renderer.render(__viserMutable.scene); drawn.length = 0")


def play(page: Page, seconds: float = 1.5) -> tuple[np.ndarray, int, float]:
    """When pictures were drawn; how many were asked for, and when the last, ms."""
    asked, last = page.evaluate(PLAY, seconds)
    page.wait_for_timeout(500)
    return np.array(page.evaluate("drawn")), asked, last


def test_a_fast_browser_draws_every_picture(paced: Page) -> None:
    install(paced, took=0.1 * SLOW_MS)
    drawn, asked, _ = play(paced)
    assert len(drawn) == asked


def test_a_slow_browser_rests_as_long_as_it_draws(paced: Page) -> None:
    took = 3.0 * SLOW_MS
    install(paced, took)
    drawn, asked, last = play(paced)
    assert 3 <= len(drawn) < asked
    # The first pictures tell how long one takes.
    assert np.median(np.diff(drawn)) >= 2.0 * took - 2.0
    assert drawn[-1] >= last, "what was asked for last is on the screen in the end"


def test_the_hand_on_the_map_lets_no_picture_rest(paced: Page) -> None:
    took = 3.0 * SLOW_MS
    install(paced, took)
    paced.evaluate(PRESS.replace("on()", "__viserMutable.canvas"))
    held, _, _ = play(paced)
    paced.evaluate("dispatchEvent(new PointerEvent('pointerup'))")
    paced.evaluate("drawn.length = 0")
    free, _, _ = play(paced)
    assert took - 2.0 <= np.median(np.diff(held)) < np.median(np.diff(free))


def test_a_slow_map_waits_for_the_answer_to_a_control_but_not_for_ever(paced: Page) -> None:
    took = 2.0 * SLOW_MS
    install(paced, took)
    paced.evaluate("document.body.appendChild(document.createElement('input')).id = 'slider'")
    play(paced, 0.3)
    paced.evaluate(
        "window.dragging = setInterval(() => document.getElementById('slider')"
        ".dispatchEvent(new Event('input', {bubbles: true})), 30); drawn.length = 0"
    )
    drawn, _, _ = play(paced)
    paced.evaluate("clearInterval(dragging)")
    assert 1 <= len(drawn) <= 3
    assert np.all(np.diff(drawn) >= 2.0 * LONGEST_REST_MS - 2.0)


def test_another_size_is_drawn_at_once(paced: Page) -> None:
    """A canvas is blank when its size has changed."""
    install(paced, took=10.0 * SLOW_MS)
    play(paced, 0.5)
    n = paced.evaluate(
        "() => { const r = renderer, s = __viserMutable.scene; r.render(s); r.render(s);"
        " const n = drawn.length; r.domElement.width += 1; r.render(s); return drawn.length - n; }"
    )
    assert n == 1
