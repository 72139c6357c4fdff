"""What stands between the network and the page.

Connections: Host and Origin are checked (DNS rebinding, foreign pages), and away from loopback a
token is required, which the first visit turns into a cookie. Messages: only the value of an
enabled, visible widget, in its range, and clicks on what is there. Everything else is dropped
without a word to the sender.
"""

from __future__ import annotations

import contextlib
import hmac
import io
import ipaddress
import math
import socket
from collections.abc import Iterable
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, urlsplit

import viser
from websockets.datastructures import Headers
from websockets.http11 import Response

from web_panels import viser_hooks
from web_panels.viser_hooks import messages

TEXT_LIMIT = 4096
LOOPBACK = ("127.0.0.1", "localhost", "::1")


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def host_name(netloc: str) -> str:
    """The name in a Host header or the netloc of an Origin, lower case, without port, brackets or
    the root dot; empty when it is none."""
    try:
        return (urlsplit("//" + netloc).hostname or "").rstrip(".")
    except ValueError:
        return ""


def allowed_names(host: str) -> frozenset[str]:
    """Names a browser may call a server bound to `host` by."""
    if is_loopback(host):
        return frozenset({*LOOPBACK, host.lower()})
    name = socket.gethostname().lower()
    return frozenset({*LOOPBACK, host.lower(), name, f"{name}.local", socket.getfqdn().lower()})


@dataclass(frozen=True)
class Gate:
    """Who may connect."""

    names: frozenset[str]
    token: str | None
    """Required from everybody; None: whoever reaches the port."""

    def trusts(self, netloc: str) -> bool:
        """Whether a Host is this server. Off loopback any IP address is: no name was resolved, so
        no name can have been rebound."""
        name = host_name(netloc)
        if name in self.names:
            return True
        if self.token is None:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    def refusal(self, request: Any) -> str | None:
        """Why a request is refused, apart from the token."""
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1 or not self.trusts(hosts[0]):
            return "This server does not go by that name. Open the address it printed."
        origins = request.headers.get_all("Origin")
        if origins and (len(origins) > 1 or origins[0].partition("://")[2] != hosts[0]):
            return "Refused: the request comes from another site's page."
        return None

    def has_cookie(self, request: Any) -> bool:
        jar = ";".join(request.headers.get_all("Cookie"))
        pairs = (part.strip().partition("=") for part in jar.split(";"))
        return any(k == "scene" and self._is_token(v) for k, _, v in pairs)

    def _is_token(self, text: str) -> bool:
        return self.token is not None and hmac.compare_digest(text.encode(), self.token.encode())

    def wrap(self, answer: viser_hooks.Request) -> viser_hooks.Request:
        """viser's own answers, behind this gate."""

        def gated(connection: Any, request: Any) -> Any:
            why = self.refusal(request)
            if why is not None:
                return _plain(HTTPStatus.FORBIDDEN, why)
            if self.token is not None and not self.has_cookie(request):
                upgrade = request.headers.get("Upgrade", "").lower() == "websocket"
                given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
                if upgrade or not self._is_token(given):
                    return _plain(
                        HTTPStatus.FORBIDDEN,
                        "This page needs its token: open the whole address the server printed.",
                    )
                cookie = f"scene={self.token}; Path=/; HttpOnly; SameSite=Lax"
                return _plain(HTTPStatus.SEE_OTHER, "", Location="/", **{"Set-Cookie": cookie})
            response = answer(connection, request)
            if response is not None:
                response.headers["X-Frame-Options"] = "DENY"
                response.headers["Referrer-Policy"] = "no-referrer"
            return response

        return gated


def _plain(status: HTTPStatus, text: str, **headers: str) -> Response:
    body = text.encode()
    fields = {
        "Content-Type": "text/plain; charset=utf-8",
        "Content-Length": str(len(body)),
        "Connection": "close",
        **headers,
    }
    return Response(status.value, status.phrase, Headers(fields), body)


def finite(values: Any, length: int) -> bool:
    """Whether `values` is a sequence of so many finite numbers."""
    return isinstance(values, (list, tuple)) and len(values) == length and all(map(_real, values))


def _real(x: Any) -> bool:
    return isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x)


def sound(m: Any) -> bool:
    """Whether the fields of a message are what its type says."""
    if isinstance(m, messages.ViewerCameraMessage):
        triples = (m.position, m.look_at, m.up_direction)
        sizes = (m.fov, m.near, m.far, m.image_height, m.image_width)
        return finite(m.wxyz, 4) and all(finite(t, 3) for t in triples) and finite(sizes, 5)
    if isinstance(m, messages.SceneNodeClickMessage):
        index = m.instance_index
        return (
            isinstance(m.name, str)
            and (index is None or (isinstance(index, int) and not isinstance(index, bool)))
            and finite(m.ray_origin, 3)
            and finite(m.ray_direction, 3)
            and finite(m.screen_pos, 2)
            and (m.modifier is None or isinstance(m.modifier, str))
        )
    if isinstance(m, messages.GuiUpdateMessage):
        return isinstance(m.uuid, str) and isinstance(m.updates, dict)
    if isinstance(m, messages.LocalStorageGetItemResponseMessage):
        return m.value is None or (isinstance(m.value, str) and len(m.value) <= TEXT_LIMIT)
    return isinstance(m.uuid, str)


def fits(value: Any, now: Any, props: Any) -> bool:
    """Whether `value` may become the value of a widget that holds `now`."""
    options = getattr(props, "options", None)
    if options is not None and value not in options:
        return False
    if isinstance(now, bool):
        return isinstance(value, bool)
    if isinstance(now, str):
        return isinstance(value, str) and len(value.encode(errors="replace")) <= TEXT_LIMIT
    lo, hi = getattr(props, "min", None), getattr(props, "max", None)
    if isinstance(now, tuple):
        n = len(now)
        return finite(value, n) and all(
            _within(x, low, high)
            for x, low, high in zip(value, _each(lo, n), _each(hi, n), strict=True)
        )
    if isinstance(now, int):
        return _real(value) and value == int(value) and _within(value, lo, hi)
    return isinstance(now, float) and _real(value) and _within(value, lo, hi)


def _each(bound: Any, n: int) -> Iterable[Any]:
    return bound if isinstance(bound, (list, tuple)) else (bound,) * n


def _within(x: float, lo: float | None, hi: float | None) -> bool:
    return (lo is None or x >= lo) and (hi is None or x <= hi)


def update_allowed(gui: Any, client_id: int, message: Any) -> bool:
    """Whether a widget update may reach its widget."""
    handle = viser_hooks.widget(gui, message.uuid)
    if handle is None or set(message.updates) != {"value"}:
        return False
    if isinstance(handle, viser.GuiUploadButtonHandle) or not viser_hooks.usable(gui, handle):
        return False
    return fits(message.updates["value"], handle._impl.value, handle._impl.props)


def click_allowed(scene: Any, client_id: int, message: Any) -> bool:
    """Whether a click on a scene node hit something that is there."""
    node = viser_hooks.scene_node(scene, message.name)
    if node is None or not node.visible:
        return False
    positions = getattr(node, "batched_positions", None)
    if positions is None:
        return message.instance_index is None
    return message.instance_index is not None and 0 <= message.instance_index < len(positions)


def guarded_server(host: str, port: int, token: str | None) -> viser.ViserServer:
    """A viser server behind the gate; `token` None only on loopback."""
    if token is None and not is_loopback(host):
        raise ValueError(f"host {host} can be reached from other machines: it needs a token")
    viser_hooks.guard_messages(sound, update_allowed, click_allowed)
    gate = Gate(allowed_names(host), token)
    # viser prints a box with an address of its own, without the token.
    with viser_hooks.served_through(gate.wrap), contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=port, verbose=False)
    viser_hooks.refuse_tunnel(server)
    viser_hooks.self_test(server)
    return server
