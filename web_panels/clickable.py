"""An image in the page that can be clicked.

viser's images report no clicks. One delegated listener in the browser finds the picture under the
pointer and writes where it was hit, and on which frame, into an invisible text widget. Everything
that comes back is checked: any program that can reach the server can write there.
"""

from __future__ import annotations

import html
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count

import cv2
import numpy as np
import viser

from web_panels import viser_hooks

JPEG_QUALITY = 85
_numbers = count(1)

# The listener sits on the document: viser replaces elements while a click is under way. Positions
# are parts of the picture's size (naturalWidth is 0 while the next picture loads). The time makes
# every value new: viser ignores an unchanged one.
_LISTENER = """(()=>{const K='%(key)s';if(window[K])return;window[K]=1;
document.addEventListener('pointerdown',e=>{const im=e.target;
if(!(im instanceof HTMLImageElement)||e.button)return;
const m=document.querySelector('[data-picture='+K+']');if(!m)return;
const it=document.evaluate('following::img[starts-with(@src,"blob:")][1]',m,null,9,null)
.singleNodeValue;if(!it||it.src!==im.src)return;const r=im.getBoundingClientRect();
window.__viserMutable.sendMessage({type:'GuiUpdateMessage',uuid:m.dataset.channel,
updates:{value:JSON.stringify([(e.clientX-r.left)/r.width,(e.clientY-r.top)/r.height,
Number(m.dataset.frame),e.shiftKey,performance.now()])}});e.preventDefault()},true)})()"""


@dataclass(frozen=True)
class Click:
    """Where a picture was clicked."""

    x: float
    """Part of the width, 0 to 1 from the left."""
    y: float
    """Part of the height, 0 to 1 from the top."""
    frame: int
    """The frame that was shown."""
    shift: bool


def parse_click(text: object) -> Click | None:
    """The click in a message of the listener; None for anything else."""
    try:
        fields = json.loads(text) if isinstance(text, str) else None
    except ValueError:
        return None
    if not isinstance(fields, list) or len(fields) != 5:
        return None
    x, y, frame, shift, _ = fields
    numbers = (x, y, frame)
    if not all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in numbers):
        return None
    if not all(math.isfinite(v) for v in numbers) or frame != int(frame) or abs(frame) > 1e9:
        return None
    if not (0.0 <= x <= 1.0 and 0.0 <= y <= 1.0) or not isinstance(shift, bool):
        return None
    return Click(float(x), float(y), int(frame), shift)


class ClickableImage:
    """A picture, the frame it belongs to, and a function that hears of clicks on it."""

    def __init__(
        self,
        server: viser.ViserServer,
        picture: np.ndarray,
        on_click: Callable[[Click], None],
    ) -> None:
        gui = server.gui
        self.server = server
        self.key = f"picture{next(_numbers)}"
        self.channel = gui.add_text(self.key, "", visible=False)
        self.uuid = viser_hooks.open_channel(self.channel)

        async def heard(event: viser.GuiEvent) -> None:
            if event.client_id is None:
                return
            click = parse_click(event.target.value)
            if click is not None:
                on_click(click)

        self.channel.on_update(heard)
        script = html.escape(_LISTENER % {"key": self.key}, quote=True)
        self.script = gui.add_html(
            f'<img alt="" src="data:," style="display:none" onerror="{script}">'
        )
        self.marker = gui.add_html(self._mark(-1))
        # The listener takes the first picture after the marker.
        self.image = gui.add_image(picture, format="jpeg", jpeg_quality=JPEG_QUALITY)

    def _mark(self, frame: int) -> str:
        return (
            f'<div data-picture="{self.key}" data-channel="{self.uuid}" data-frame="{frame}"></div>'
        )

    def show(self, picture: np.ndarray, frame: int) -> None:
        """Show an RGB picture; clicks on it will carry `frame`."""
        bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
        done, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        assert done
        mark = self._mark(frame)
        with self.server.atomic():
            viser_hooks.show_jpeg(self.image, data.tobytes())
            self.marker.content = mark
