"""A client that speaks viser's protocol and nothing else: what a hostile program would use."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

CAMERA = {
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (3.0, 3.0, 3.0),
    "fov": 0.8,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 600,
    "image_width": 800,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}

Message = dict[str, Any]


class RawClient:
    """Sends single messages and keeps those that come."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection
        self.seen: list[Message] = []

    def send(self, type_: str, **fields: Any) -> None:
        self.connection.send(msgspec.msgpack.encode({"type": type_, **fields}))

    def set(self, uuid: str, value: Any) -> None:
        """What a browser sends when somebody moves a widget."""
        self.send("GuiUpdateMessage", uuid=uuid, updates={"value": value})

    def receive(self, timeout: float = 0.1) -> list[Message]:
        """The messages of the next window; none when nothing comes in time."""
        try:
            raw = self.connection.recv(timeout=timeout)
        except TimeoutError:
            return []
        assert isinstance(raw, bytes)
        size = int.from_bytes(raw[8:16], "little")
        inner = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + size])
        messages = list(msgspec.msgpack.decode(inner)["messages"])
        self.seen.extend(messages)
        return messages

    def until(self, fits: Callable[[Message], bool], timeout: float = 10.0) -> Message:
        """The first message, among those seen or to come, that fits."""
        found = next((m for m in self.seen if fits(m)), None)
        end = time.monotonic() + timeout
        while found is None:
            assert time.monotonic() < end, "the message did not come"
            found = next((m for m in self.receive() if fits(m)), None)
        return found

    def settle(self, quiet: float = 0.25) -> None:
        """Wait until nothing comes any more."""
        while self.receive(quiet):
            pass

    def input(self, label: str) -> Message:
        """The widget with this label, as it was announced."""
        return self.until(lambda m: m.get("props", {}).get("label") == label and "uuid" in m)


@contextlib.contextmanager
def raw_client(server: viser.ViserServer, **headers: str) -> Iterator[RawClient]:
    """A connected client that has reported a camera; `headers` use _ for -."""
    with connect(
        f"ws://127.0.0.1:{server.get_port()}",
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        additional_headers={k.replace("_", "-"): v for k, v in headers.items()},
        max_size=None,
        compression=None,
    ) as connection:
        assert isinstance(connection, ClientConnection)
        connection.close_timeout = 0.5  # a client that stopped reading does not part properly
        client = RawClient(connection)
        client.send("ViewerCameraMessage", **CAMERA)
        yield client
