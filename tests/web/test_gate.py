"""The gate: what it refuses from the network, and that it lets the page work."""

from __future__ import annotations

import http.client
import math
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import viser
from websockets.exceptions import InvalidStatus

from tests.web.raw_client import CAMERA, raw_client
from web_panels import gate, viser_hooks

TOKEN = "correct-horse"


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    yield server
    server.stop()


@pytest.fixture(scope="module")
def private() -> Iterator[viser.ViserServer]:
    server = gate.guarded_server("127.0.0.1", free_port(), TOKEN)
    yield server
    server.stop()


def get(server: viser.ViserServer, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=10)
    connection.request("GET", path, headers={k.replace("_", "-"): v for k, v in headers.items()})
    response = connection.getresponse()
    response.read()
    return response


def wait(condition: Callable[[], bool], timeout: float = 5.0) -> bool:
    end = time.monotonic() + timeout
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()


# Connections.


def test_the_page_is_served_and_can_not_be_framed(server: viser.ViserServer) -> None:
    response = get(server)
    assert response.status == 200
    assert response.headers["X-Frame-Options"] == "DENY"


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "10.0.0.7", ""]
)
def test_a_foreign_host_is_refused(server: viser.ViserServer, host: str) -> None:
    assert get(server, Host=host).status == 403


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "LOCALHOST", "[::1]"])
def test_loopback_has_several_names(server: viser.ViserServer, name: str) -> None:
    assert get(server, Host=f"{name}:{server.get_port()}").status == 200


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://localhost", "[", ""]
)
def test_a_foreign_origin_is_refused(server: viser.ViserServer, origin: str) -> None:
    with pytest.raises(InvalidStatus) as refused, raw_client(server, Origin=origin):
        pass
    assert refused.value.response.status_code == 403


def test_the_own_origin_is_welcome(server: viser.ViserServer) -> None:
    with raw_client(server, Origin=f"http://127.0.0.1:{server.get_port()}") as client:
        assert client.receive(5.0)


def test_other_machines_need_a_token() -> None:
    with pytest.raises(ValueError, match="token"):
        gate.guarded_server("0.0.0.0", free_port(), None)


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/?token=é", "/?x=1"])
def test_without_the_token_nothing_is_served(private: viser.ViserServer, path: str) -> None:
    assert get(private, path.replace("é", "%C3%A9")).status == 403
    with pytest.raises(InvalidStatus), raw_client(private):
        pass
    with pytest.raises(InvalidStatus), raw_client(private, Cookie="scene=wrong"):
        pass


def test_the_token_becomes_a_cookie_and_leaves_the_address_bar(private: viser.ViserServer) -> None:
    first = get(private, f"/?token={TOKEN}")
    assert (first.status, first.headers["Location"]) == (303, "/")
    cookie = first.headers["Set-Cookie"]
    assert "HttpOnly" in cookie and "SameSite=Lax" in cookie
    pair = cookie.partition(";")[0]
    assert get(private, Cookie=pair).status == 200
    with raw_client(private, Cookie=pair) as client:
        assert client.receive(5.0)


def test_a_cookie_does_not_excuse_a_foreign_page(private: viser.ViserServer) -> None:
    with (
        pytest.raises(InvalidStatus),
        raw_client(private, Cookie=f"scene={TOKEN}", Origin="http://evil.example"),
    ):
        pass


def test_an_address_off_loopback_is_trusted_only_with_a_token() -> None:
    names = gate.allowed_names("0.0.0.0")
    assert gate.Gate(names, TOKEN).trusts("192.168.1.5:8080")
    assert not gate.Gate(names, TOKEN).trusts("rebound.example:8080")
    assert not gate.Gate(gate.allowed_names("127.0.0.1"), None).trusts("192.168.1.5:8080")


# Messages.


@dataclass
class Widgets:
    server: viser.ViserServer
    handles: dict[str, Any]
    heard: list[tuple[str, Any]]


@pytest.fixture(scope="module")
def widgets(server: viser.ViserServer) -> Widgets:
    gui = server.gui
    heard: list[tuple[str, Any]] = []
    hidden_folder = gui.add_folder("hidden folder", visible=False)
    with hidden_folder:
        nested = gui.add_slider("nested", 0.0, 1.0, 0.1, 0.5)
    handles = {
        "slider": gui.add_slider("slider", 0.0, 10.0, 0.1, 5.0),
        "whole": gui.add_slider("whole", 0, 10, 1, 5),
        "number": gui.add_number("number", 1.0, min=0.0),
        "vector": gui.add_vector3("vector", (0.0, 0.0, 0.0), min=(-1.0, -1.0, -1.0)),
        "check": gui.add_checkbox("check", False),
        "text": gui.add_text("text", "a"),
        "choice": gui.add_dropdown("choice", ("one", "two")),
        "button": gui.add_button("button"),
        "upload": gui.add_upload_button("upload"),
        "disabled": gui.add_slider("disabled", 0.0, 1.0, 0.1, 0.5, disabled=True),
        "hidden": gui.add_text("hidden", "a", visible=False),
        "nested": nested,
        "channel": gui.add_text("channel", "", visible=False),
    }
    viser_hooks.open_channel(handles["channel"])

    def listen(name: str, handle: Any) -> None:
        async def moved(event: viser.GuiEvent) -> None:
            heard.append((name, event.target.value))

        (handle.on_click if name == "button" else handle.on_update)(moved)

    for name, handle in handles.items():
        if name != "upload":
            listen(name, handle)
    return Widgets(server, handles, heard)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("slider", 7.5),
        ("slider", 7),
        ("whole", 3),
        ("number", 1e6),
        ("vector", [0.5, 0.0, 3.0]),
        ("check", True),
        ("text", "hello"),
        ("choice", "two"),
        ("button", True),
        ("channel", "[0.5, 0.5]"),
    ],
)
def test_good_values_arrive(widgets: Widgets, name: str, value: Any) -> None:
    widgets.heard.clear()
    with raw_client(widgets.server) as client:
        client.receive(5.0)
        assert wait(lambda: len(widgets.server.get_clients()) > 0)
        client.set(widgets.handles[name]._impl.uuid, value)
        assert wait(lambda: [n for n, _ in widgets.heard] == [name]), widgets.heard


HOSTILE = [
    ("slider", 1e9),
    ("slider", -0.1),
    ("slider", math.nan),
    ("slider", math.inf),
    ("slider", "5"),
    ("slider", True),
    ("slider", None),
    ("slider", [5.0]),
    ("whole", 3.5),
    ("whole", 11),
    ("number", -1.0),
    ("number", -math.inf),
    ("vector", [0.0, 0.0]),
    ("vector", [0.0, 0.0, -2.0]),
    ("vector", [0.0, 0.0, math.nan]),
    ("vector", "abc"),
    ("check", 1),
    ("check", "yes"),
    ("text", "x" * 4097),
    ("text", 7),
    ("choice", "three"),
    ("choice", ["one"]),
    ("button", 1),
    ("upload", "x"),
    ("disabled", 0.7),
    ("hidden", "b"),
    ("nested", 0.7),
]


def test_hostile_values_are_dropped(widgets: Widgets) -> None:
    before = {n: h.value for n, h in widgets.handles.items() if n != "upload"}
    widgets.heard.clear()
    with raw_client(widgets.server) as client:
        assert wait(lambda: len(widgets.server.get_clients()) > 0)
        for name, value in HOSTILE:
            client.set(widgets.handles[name]._impl.uuid, value)
        client.set("no-such-widget", 1)
        client.set(widgets.handles["channel"]._impl.uuid, "the end")
        assert wait(lambda: ("channel", "the end") in widgets.heard)
    assert widgets.heard == [("channel", "the end")]
    after = {n: h.value for n, h in widgets.handles.items() if n not in ("upload", "channel")}
    assert after == {n: v for n, v in before.items() if n != "channel"}


@pytest.mark.parametrize(
    "updates",
    [
        {"removed": True},
        {"gui_api": "x"},
        {"update_cb": []},
        {"value": 1.0, "removed": True},
        {"props": {}},
        {},
        "value",
    ],
)
def test_internal_attributes_can_not_be_set(widgets: Widgets, updates: Any) -> None:
    slider = widgets.handles["slider"]
    with raw_client(widgets.server) as client:
        assert wait(lambda: len(widgets.server.get_clients()) > 0)
        client.send("GuiUpdateMessage", uuid=slider._impl.uuid, updates=updates)
        client.set(widgets.handles["channel"]._impl.uuid, f"after {updates}")
        assert wait(lambda: widgets.handles["channel"].value == f"after {updates}")
    assert slider._impl.removed is False
    assert len(slider._impl.update_cb) == 1
    slider.value = 4.0
    assert slider.value == 4.0


def test_the_share_tunnel_is_refused(
    server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = []
    monkeypatch.setattr(viser._viser, "ViserTunnel", lambda *a, **k: opened.append(a))
    channel = server.gui.add_text("share", "")
    with raw_client(server) as client:
        assert wait(lambda: len(server.get_clients()) > 0)
        client.send("ShareUrlRequest")
        client.set(channel._impl.uuid, "after")
        assert wait(lambda: channel.value == "after")
    time.sleep(0.1)
    assert server.request_share_url() is None
    assert opened == []


def test_uploads_are_refused(widgets: Widgets) -> None:
    gui = widgets.server.gui
    with raw_client(widgets.server) as client:
        assert wait(lambda: len(widgets.server.get_clients()) > 0)
        client.send(
            "FileTransferStartUpload",
            source_component_uuid=widgets.handles["upload"]._impl.uuid,
            transfer_uuid="t",
            filename="../../evil.sh",
            mime_type="text/plain",
            part_count=1,
            size_bytes=10,
        )
        client.set(widgets.handles["channel"]._impl.uuid, "after upload")
        assert wait(lambda: widgets.handles["channel"].value == "after upload")
    assert gui._current_file_upload_states == {}


@pytest.mark.parametrize(
    ("name", "index", "arrives"),
    [
        ("/batch", 1, True),
        ("/batch", 2, False),
        ("/batch", -1, False),
        ("/batch", 99999, False),
        ("/batch", None, False),
        ("/batch", "1", False),
        ("/nothing", 0, False),
        ("/unseen", 0, False),
    ],
)
def test_clicks_hit_what_is_there(
    server: viser.ViserServer, name: str, index: Any, arrives: bool
) -> None:
    ball = np.eye(3, dtype=np.float32)
    heard: list[int | None] = []

    async def clicked(event: viser.SceneNodePointerEvent) -> None:
        heard.append(event.instance_index)

    for node, visible in (("/batch", True), ("/unseen", False)):
        server.scene.add_batched_meshes_simple(
            node, ball, np.array([[0, 1, 2]]), np.eye(4)[:2], ball[:2], visible=visible
        ).on_click(clicked)
    ray = {"ray_origin": (0.0, 0.0, 0.0), "ray_direction": (0.0, 0.0, 1.0)}
    with raw_client(server) as client:
        assert wait(lambda: len(server.get_clients()) > 0)
        for node, at in ((name, index), ("/batch", 0)):
            client.send(
                "SceneNodeClickMessage",
                name=node,
                instance_index=at,
                screen_pos=(0.5, 0.5),
                modifier=None,
                owner="",
                **ray,
            )
        assert wait(lambda: 0 in heard)
    assert heard == ([index, 0] if arrives else [0])


@pytest.mark.parametrize(
    "broken",
    [
        {"fov": math.nan},
        {"position": (1.0, 2.0)},
        {"look_at": (math.nan, 0.0, 0.0)},
        {"wxyz": (math.inf, 0.0, 0.0, 0.0)},
    ],
)
def test_a_broken_camera_is_ignored(server: viser.ViserServer, broken: dict[str, Any]) -> None:
    with raw_client(server) as client:
        assert wait(lambda: len(server.get_clients()) == 1)
        client.send("ViewerCameraMessage", **{**CAMERA, **broken})
        client.send("ViewerCameraMessage", **{**CAMERA, "position": (9.0, 9.0, 9.0)})
        (handle,) = server.get_clients().values()
        assert wait(lambda: float(handle.camera.position[0]) == 9.0)
        assert np.isfinite([*handle.camera.position, handle.camera.fov]).all()
    assert wait(lambda: len(server.get_clients()) == 0)


def test_garbage_closes_only_its_own_connection(server: viser.ViserServer) -> None:
    with raw_client(server) as good, raw_client(server) as bad:
        assert wait(lambda: len(server.get_clients()) == 2)
        bad.connection.send(b"\xff\x00garbage")
        assert wait(lambda: len(server.get_clients()) == 1)
        channel = server.gui.add_text("still here", "")
        good.set(channel._impl.uuid, "yes")
        assert wait(lambda: channel.value == "yes")


def test_the_self_test_notices_a_server_without_a_gate(server: viser.ViserServer) -> None:
    viser_hooks.self_test(server)
    real = viser_hooks.VERSION
    try:
        viser_hooks.VERSION = "0.0.0"
        with pytest.raises(viser_hooks.HooksError, match=r"0\.0\.0"):
            viser_hooks.self_test(server)
    finally:
        viser_hooks.VERSION = real
