"""Every private part of viser that the page relies on, in one place, checked when it starts.

viser offers no way to refuse a connection, to check what a browser sends, to send an image that is
already encoded, or to repeat a widget's value to one that missed it. The page needs all four.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import viser
import viser._gui_api as gui_api
import viser._messages as messages
import viser._scene_api as scene_api
import viser.infra._infra as infra
import websockets.asyncio.server as websockets_server

VERSION = "1.1.1"

Request = Callable[[Any, Any], Any]
"""websockets' process_request: (connection, request) -> a response that ends it, or None."""

HEARD: tuple[type, ...] = (
    messages.ViewerCameraMessage,
    messages.SceneNodeClickMessage,
    messages.GuiUpdateMessage,
    messages.CommandTriggerMessage,
    messages.LocalStorageGetItemResponseMessage,
)
"""The messages of a browser that the page has a use for. No uploads, tunnels, drags or forms."""


RETIRED_S = 3.0
"""Longer than the slowest browser takes for a picture of the map."""


class HooksError(RuntimeError):
    """The installed viser is not the one the page was built on."""


@contextlib.contextmanager
def served_through(wrap: Callable[[Request], Request]) -> Iterator[None]:
    """Servers started inside this context answer requests through `wrap(viser's own answer)`."""
    real: Any = websockets_server.serve

    def serve(handler: Any, host: Any, port: Any, *, process_request: Request, **kw: Any) -> Any:
        return real(handler, host, port, process_request=wrap(process_request), **kw)

    websockets_server.serve = serve  # type: ignore[assignment]
    try:
        yield
    finally:
        websockets_server.serve = real  # type: ignore[assignment]


def _guard(owner: type, name: str, accept: Callable[[Any, int, Any], bool]) -> None:
    """Let only what `accept` says through to a handler of class `owner`; once."""
    real = getattr(owner, name)
    if getattr(real, "guarded", False):
        return

    async def guarded(self: Any, client_id: int, message: Any) -> None:
        if accept(self, client_id, message):
            await real(self, client_id, message)

    guarded.guarded = True  # type: ignore[attr-defined]
    setattr(owner, name, guarded)


def guard_messages(
    message: Callable[[Any], bool],
    update: Callable[[Any, int, Any], bool],
    click: Callable[[Any, int, Any], bool],
) -> None:
    """Check what comes in: every message, widget updates (GuiApi, client, message), clicks on
    scene nodes (SceneApi, client, message). Before the server object exists, since viser binds
    its handlers when it is made."""
    _guard(
        infra.WebsockMessageHandler,
        "_handle_incoming_message",
        lambda self, client, m: type(m) in HEARD and message(m),
    )
    _guard(gui_api.GuiApi, "_handle_gui_updates", update)
    _guard(scene_api.SceneApi, "_handle_node_click_updates", click)


def widget(gui: Any, uuid: str) -> Any | None:
    """The input widget with this id, if it is still there."""
    handle = gui._gui_input_handle_from_uuid.get(uuid)
    return None if handle is None or handle._impl.removed else handle


def scene_node(scene: Any, name: str) -> Any | None:
    """The scene node of this name."""
    return scene._handle_from_node_name.get(name)


def usable(gui: Any, handle: Any) -> bool:
    """Whether somebody at a browser can operate this widget: enabled, and visible with everything
    around it; or a hidden text opened as a channel."""
    state = handle._impl
    if getattr(state.props, "disabled", False):
        return False
    if getattr(state, "is_channel", False):
        return True
    if not state.props.visible:
        return False
    container = state.parent_container_id
    while container != "root":
        box = gui._container_handle_from_uuid.get(container)
        if box is None:
            return False
        box = getattr(box, "_parent", box)  # a tab has no state of its own, its group has
        if not getattr(box._impl.props, "visible", True):
            return False
        container = box._impl.parent_container_id
    return True


def open_channel(handle: viser.GuiTextHandle) -> str:
    """Let page scripts write to this invisible text widget; returns its id for `sendMessage`."""
    state: Any = handle._impl
    state.is_channel = True
    return state.uuid


def repeat(handle: Any) -> None:
    """Send a widget's value to every browser again, also to the one that believes otherwise."""
    state = handle._impl
    update = messages.GuiUpdateMessage(state.uuid, {"value": state.value})
    state.gui_api._websock_interface.queue_message(update)


def send_places(scene: Any, root: str) -> None:
    """Send where every node below `root` is, also of those that are where new nodes are: a browser
    leaves what is made anew under an old name in its old place until it is told otherwise."""
    for name, handle in list(scene._handle_from_node_name.items()):
        if name.startswith(f"{root}/"):
            wxyz, position = (tuple(v.tolist()) for v in (handle.wxyz, handle.position))
            scene._queue_scene_message(messages.SetOrientationMessage(name, wxyz))
            scene._queue_scene_message(messages.SetPositionMessage(name, position))


def show_jpeg(handle: viser.GuiImageHandle | viser.CameraFrustumHandle, data: bytes) -> None:
    """Show an encoded JPEG: one encoding serves the image pane and the frustum in the map."""
    if isinstance(handle, viser.GuiImageHandle):
        handle._format = "jpeg"
        handle._data = data
    else:
        handle._format = "jpeg"
        handle._image_data = data


def retire(*handles: Any) -> None:
    """Hide widgets, and remove them when no browser has news of them left to apply.

    A browser applies what came since its last picture at once, removals first; it complains of
    news for what is gone then.
    """
    for handle in handles:
        handle.visible = False
        loop = handle._impl.gui_api._event_loop
        loop.call_soon_threadsafe(loop.call_later, RETIRED_S, _remove, handle)


def _remove(handle: Any) -> None:
    if not handle._impl.removed:
        handle.remove()


def clear(tab: viser.GuiTabHandle) -> None:
    """Take everything inside a tab off the page, and keep the tab."""
    children = list(tab._children.values())
    tab._children.clear()
    retire(*children)


def rename(tab: viser.GuiTabHandle, label: str, icon: Any) -> None:
    """Give a tab another label and icon."""
    tab._label = label
    tab.icon = icon


def refuse_tunnel(server: viser.ViserServer) -> None:
    """No public share URL, neither by message nor by attribute."""

    def request_share_url(*_: Any, **__: Any) -> None:
        return None

    server.request_share_url = request_share_url  # type: ignore[method-assign]


def self_test(server: viser.ViserServer) -> None:
    """Raise HooksError when a private part is missing or a guard is not in place."""
    if viser.__version__ != VERSION:
        raise HooksError(f"viser {viser.__version__} is installed, the page needs {VERSION}")
    guards: list[tuple[Any, str]] = [
        (infra.WebsockMessageHandler, "_handle_incoming_message"),
        (gui_api.GuiApi, "_handle_gui_updates"),
        (scene_api.SceneApi, "_handle_node_click_updates"),
    ]
    for owner, name in guards:
        if not getattr(getattr(owner, name), "guarded", False):
            raise HooksError(f"viser's {owner.__name__}.{name} is not guarded")
    handlers = server._websock_server._incoming_handlers
    bound = handlers[messages.GuiUpdateMessage][0]
    if not getattr(getattr(bound, "__func__", bound), "guarded", False):
        raise HooksError("this viser server was made before its gate was in place")
    for owner, names in (
        (server.gui, ("_gui_input_handle_from_uuid", "_container_handle_from_uuid")),
        (server.scene, ("_handle_from_node_name",)),
    ):
        for name in names:
            if not isinstance(getattr(owner, name, None), dict):
                raise HooksError(f"viser's {type(owner).__name__} has no {name}")
    if not callable(getattr(server.scene, "_queue_scene_message", None)):
        raise HooksError("viser's SceneApi has no _queue_scene_message")
    if server.request_share_url() is not None:
        raise HooksError("viser's share tunnel is not refused")
