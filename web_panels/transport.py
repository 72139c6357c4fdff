"""The Run tab: transport and its hotkeys."""

from __future__ import annotations

import math
from typing import Literal

import viser

from scene_core.session import commands
from scene_core.session.published import Published
from web_panels.boxes import boxes_html
from web_panels.focus import focus_html
from web_panels.panel import Page, Post
from web_panels.widgets import Bound, Group, on_command, on_press

Action = Literal["toggle", "step frame", "step phase", "back", "redo", "reset"]

BUTTONS: tuple[tuple[str, str | None, str, Action, str], ...] = (
    ("Play", "space", "PLAYER_PLAY", "toggle", "Play, or pause at the end of the frame."),
    ("Next frame", "N", "PLAYER_TRACK_NEXT", "step frame", "Finish this frame, or do one more."),
    ("Next phase", "P", "PLAYER_SKIP_FORWARD", "step phase", "Do one phase of the frame and stop."),
    ("Back", "B", "PLAYER_TRACK_PREV", "back", "To the end of the frame before."),
    ("Redo frame", "R", "REFRESH", "redo", "Compute this frame again, with the settings as now."),
    ("Reset run", None, "RESTORE", "reset", "Back to the start; the settings stay."),
)
"""Label, hotkey, icon, action and help. WASD, QE and the arrows belong to the 3-D camera."""

KEY_WORDS = {"space": "Space"}

SPEEDS: tuple[tuple[str, float], ...] = (
    ("0.1 ×", 0.1),
    ("0.25 ×", 0.25),
    ("0.5 ×", 0.5),
    ("1 ×, real time", 1.0),
    ("2 ×", 2.0),
    ("4 ×", 4.0),
    ("as fast as possible", math.inf),
)


def speed_word(factor: float) -> str:
    """The nearest entry of the speed list."""
    if math.isinf(factor):
        return SPEEDS[-1][0]
    finite = [s for s in SPEEDS if math.isfinite(s[1])]
    return min(finite, key=lambda s: abs(math.log(s[1] / max(factor, 1e-9))))[0]


class Transport:
    """Play, pause, steps, speed and seek."""

    rate_hz = 20.0
    prompt = True

    def __init__(self, page: Page) -> None:
        self.page = page
        self.group = Group()

    def build(self, server: viser.ViserServer, post: Post) -> None:
        gui = server.gui
        gui.add_html(focus_html() + boxes_html())
        self.buttons: dict[str, viser.GuiButtonHandle] = {}
        for label, key, icon, action, help_text in BUTTONS:
            text = f"{label} [{KEY_WORDS.get(key, key)}]" if key else label
            color = "blue" if action == "toggle" else "gray"
            symbol = getattr(viser.Icon, icon)
            button = gui.add_button(text, icon=symbol, color=color, hint=help_text)
            command = commands.Transport(action)
            on_press(button, lambda _, c=command: post(c))
            hotkey = gui.add_command(label, description=help_text, hotkey=key, icon=symbol)  # type: ignore[arg-type]
            on_command(hotkey, lambda _, c=command: post(c))
            self.buttons[action] = button
        speeds = dict(SPEEDS)
        speed = gui.add_dropdown(
            "Speed",
            [s for s, _ in SPEEDS],
            initial_value=speed_word(1.0),
            hint="Target speed; the head shows the one that is reached.",
        )
        self.speed = Bound(speed, self.group, lambda v: post(commands.SetSpeed(speeds[v])))
        seek = gui.add_slider(
            "Frame", 0, 1, 1, 0, hint="Go to the end of a frame of the kept history; pauses."
        )
        self.seek = Bound(seek, self.group, lambda v: post(commands.Seek(int(v))))

    def render(self, p: Published) -> None:
        toggle = self.buttons["toggle"]
        playing = p.mode == "playing"
        label = "Pause [Space]" if playing else "Play [Space]"
        if toggle.label != label:
            toggle.label = label
            toggle.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY
        toggle.disabled = p.mode == "finished"
        for action in ("step frame", "step phase"):
            self.buttons[action].disabled = p.mode == "finished"
        self.buttons["back"].disabled = p.last_frame < 0 or p.last_frame <= p.first_frame
        self.buttons["redo"].disabled = p.trace is None
        self.speed.show(speed_word(p.speed))
        self._show_seek(p)

    def _show_seek(self, p: Published) -> None:
        """The slider spans what is kept; it is empty until there are two frames."""
        slider = self.seek.handle
        first, last = max(p.first_frame, 0), max(p.last_frame, 0)
        slider.disabled = last <= first
        span = max(last, first + 1)
        if (slider.min, slider.max) != (first, span):
            slider.min, slider.max = first, span
        here = first if p.trace is None else p.trace.frame.index
        self.seek.show(min(max(here, first), span))
