"""The browser under the browser tests can show a viser page: it has WebGL 2 and a websocket."""

from __future__ import annotations

import socket

import viser
from playwright.sync_api import Page, expect


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def test_a_viser_page_renders(page: Page) -> None:
    port = free_port()
    server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    try:
        server.scene.add_box("/box", dimensions=(1, 1, 1), color=(200, 30, 30))
        server.gui.add_button("Connected")
        page.goto(f"http://127.0.0.1:{port}")
        expect(page.get_by_role("button", name="Connected")).to_be_visible()
        assert page.evaluate("document.createElement('canvas').getContext('webgl2') !== null")
    finally:
        page.goto("about:blank")
        server.stop()
