"""Keys that are held down in a browser, for driving.

viser's hotkeys tell of a press and not of its end, and the letters and arrows that drive also move
the 3-D camera. A listener in the page, which comes before viser's own, keeps them from it while
there is something to drive, and writes which ones are down into an invisible text widget. Whoever
leaves the page has let go of them.
"""

from __future__ import annotations

import html
import json
from collections.abc import Callable
from itertools import count

import viser

from web_panels import viser_hooks

LETTERS = ("KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE")
ARROWS = ("ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight")
KEYS = frozenset((*LETTERS, *ARROWS, "PageUp", "PageDown"))
"""Codes of the keys that drive."""
_numbers = count(1)

# Typing, and moving a slider or from tab to tab with the arrows, is not driving. The time makes
# every value new: viser ignores an unchanged one.
_LISTENER = """(()=>{const K='%(key)s',KEYS=new Set(%(keys)s);if(window[K])return;window[K]=1;
const down=new Set();const mark=()=>document.querySelector('[data-keys='+K+']');
const tell=()=>{const m=mark();if(m)window.__viserMutable.sendMessage({type:'GuiUpdateMessage',
uuid:m.dataset.channel,updates:{value:JSON.stringify([[...down],performance.now()])}})};
const letGo=()=>{if(down.size){down.clear();tell()}};
const busy=e=>{const t=e.target;if(!(t instanceof Element))return false;
return t.closest('input,textarea,select,[contenteditable=true]')||
(!e.code.startsWith('Key')&&t.closest('[role=slider],[role=tab],[role=option]'))};
window.addEventListener('keydown',e=>{const m=mark();if(!m||m.dataset.on!=='1'||!KEYS.has(e.code)||
e.ctrlKey||e.metaKey||e.altKey||busy(e))return;e.stopPropagation();e.preventDefault();
if(!down.has(e.code)){down.add(e.code);tell()}},true);
window.addEventListener('keyup',e=>{if(down.delete(e.code))tell()},true);
window.addEventListener('blur',letGo);
document.addEventListener('visibilitychange',()=>{if(document.hidden)letGo()})})()"""


def parse_keys(text: object) -> frozenset[str] | None:
    """The keys in a message of the listener; None for anything else."""
    try:
        fields = json.loads(text) if isinstance(text, str) else None
    except ValueError:
        return None
    if not isinstance(fields, list) or len(fields) != 2 or not isinstance(fields[0], list):
        return None
    held = fields[0]
    known = all(isinstance(key, str) and key in KEYS for key in held)
    return frozenset(held) if known else None


class Keys:
    """Tells a function which keys are held down, by whoever looks at the page."""

    def __init__(
        self, server: viser.ViserServer, on_change: Callable[[frozenset[str]], None]
    ) -> None:
        self.on_change = on_change
        self.held: dict[int, frozenset[str]] = {}
        """By browser."""
        gui = server.gui
        self.key = f"keys{next(_numbers)}"
        self.channel = gui.add_text(self.key, "", visible=False)
        self.uuid = viser_hooks.open_channel(self.channel)
        self.channel.on_update(self._heard)
        server.on_client_disconnect(self._gone)
        script = _LISTENER % {"key": self.key, "keys": json.dumps(sorted(KEYS))}
        self.script = gui.add_html(
            f'<img alt="" src="data:," style="display:none" '
            f'onerror="{html.escape(script, quote=True)}">'
        )
        self.marker = gui.add_html(self._mark(False))
        self.on = False

    def _mark(self, on: bool) -> str:
        return f'<div data-keys="{self.key}" data-channel="{self.uuid}" data-on="{int(on)}"></div>'

    def listen(self, on: bool) -> None:
        """Whether there is something to drive; otherwise the keys are the camera's."""
        if on != self.on:
            self.on = on
            self.marker.content = self._mark(on)

    async def _heard(self, event: viser.GuiEvent) -> None:
        if event.client_id is None:
            return
        held = parse_keys(event.target.value)
        if held is not None:
            self._change(event.client_id, held)

    async def _gone(self, client: viser.ClientHandle) -> None:
        if client.client_id in self.held:
            self._change(client.client_id, frozenset())

    def _change(self, client: int, held: frozenset[str]) -> None:
        self.held[client] = held
        if not held:
            del self.held[client]
        self.on_change(frozenset().union(*self.held.values()))
