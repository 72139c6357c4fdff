"""Inputs that are generated from parameters, and how any input talks to the session.

The browser drops events (one throttle for a whole panel keeps only the latest message of any
widget), so after the last event of a group all its inputs are sent again: page and server agree.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from itertools import count
from typing import Any

import viser

from scene_core.params import Spec, rows_text, rows_typed
from web_panels import viser_hooks
from web_panels.style import shown

SETTLE_S = 0.2
"""After the last event of a group its inputs show what is in force; until then hands off."""

TYPING_S = 4.0
"""The same for texts: half a number is no reason to take away what is being typed."""

DRAG_S = 1.0
"""A longer pause ends the movement of a slider."""

MOST_STEPS = 1000
"""A slider over a wider range than this, or with ends so different, could not be aimed at."""

_movements = count(1)

Send = Callable[[Any], None]
"""Takes the new value of an input, in SI units."""


class Group:
    """Inputs that share one root of the page, hence the browser's throttle."""

    def __init__(self) -> None:
        self.inputs: list[Bound] = []
        self._timer: asyncio.TimerHandle | None = None

    def settle(self) -> None:
        """Repeat all inputs a little after the last event; called on viser's event loop."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(SETTLE_S, self._repeat)

    def _repeat(self) -> None:
        for bound in list(self.inputs):
            bound.settle()

    def remove(self, box: viser.GuiFolderHandle | None, *kept: Bound) -> None:
        """Take the inputs in a box off the page with it; those that are `kept` are elsewhere."""
        self.inputs[:] = kept
        if box is not None:
            viser_hooks.retire(box)


class Bound:
    """A widget whose value goes out through `send` and comes back by `show`."""

    def __init__(self, handle: Any, group: Group, send: Send) -> None:
        self.handle, self._touched = handle, -math.inf
        self._in_force, self._group = handle.value, group
        self._patience = TYPING_S if isinstance(handle, viser.GuiTextHandle) else SETTLE_S
        group.inputs.append(self)

        async def moved(event: viser.GuiEvent) -> None:
            if event.client is None:
                return
            self._touched = time.monotonic()
            group.settle()
            if self._patience > SETTLE_S:
                asyncio.get_running_loop().call_later(self._patience, self.settle)
            send(event.target.value)

        handle.on_update(moved)

    def show(self, value: Any) -> None:
        """Show what is in force; not while somebody is moving the widget, but then soon after."""
        self._in_force = value
        if self._is_quiet():
            self._write()

    def settle(self) -> None:
        """Show what is in force to every browser, whatever it believes."""
        settled = self._patience == SETTLE_S or self._is_quiet()
        if settled and self in self._group.inputs:
            self._write()
            viser_hooks.repeat(self.handle)

    def _is_quiet(self) -> bool:
        """Whether nobody has been at the widget for a while."""
        return time.monotonic() - self._touched >= self._patience

    def _write(self) -> None:
        if self.handle.value != self._in_force:
            self.handle.value = self._in_force


class Drag:
    """Names one movement of a hand: what comes from an input without a long pause in between. By
    frames alone it could not be told: at high speed many go by between two places of a slider."""

    def __init__(self, of: str) -> None:
        self.of, self._last, self._name = of, -math.inf, ""

    def name(self) -> str:
        """That of the movement which goes on, or of a new one; no other input ever had it, also
        none for the same parameter that was on the page before."""
        now = time.monotonic()
        if now - self._last > DRAG_S:
            self._name = f"{self.of} {next(_movements)}"
        self._last = now
        return self._name


def on_press(button: viser.GuiButtonHandle, action: Callable[[viser.ClientHandle], None]) -> None:
    """Call `action` with the browser that pressed a button."""

    async def pressed(event: viser.GuiEvent) -> None:
        if event.client is not None:
            action(event.client)

    button.on_click(pressed)


def on_command(command: viser.CommandHandle, action: Callable[[viser.ClientHandle], None]) -> None:
    """Call `action` with the browser that pressed a hotkey or picked a command."""

    async def triggered(event: viser.CommandEvent) -> None:
        if event.client is not None:
            action(event.client)

    command.on_trigger(triggered)


def hint(spec: Spec, unit: str) -> str:
    """Help, range and when an edit takes effect."""
    text = " ".join(spec.help.split())
    lo = None if spec.lo is None else shown(spec.lo, spec.unit)[0]
    hi = None if spec.hi is None else shown(spec.hi, spec.unit)[0]
    bounds = ""
    if lo is not None or hi is not None:
        low = "any" if lo is None else f"{lo:g}"
        high = "any" if hi is None else f"{hi:g}"
        bounds = f" Range {low} to {high}{unit and ' ' + unit}."
    return f"{text}{bounds} Takes effect: {spec.effect}."


def nice_step(lo: float, hi: float) -> float:
    """A round step that divides a range into 100 to 250 parts."""
    raw = (hi - lo) / 100.0
    ten = 10.0 ** math.floor(math.log10(raw))
    return next(m * ten for m in (5.0, 2.0, 1.0) if m * ten <= raw * (1 + 1e-9))


def rounded(value: float, digits: int = 4) -> float:
    """A value as an input shows it; what is in force stays exact until somebody edits it."""
    return float(f"{value:.{digits}g}")


def rounded_down(value: float) -> float:
    """The next round number below: a slider's end that is still inside the limits."""
    near = rounded(value)
    return (
        near if near <= value else rounded(value - 10.0 ** (math.floor(math.log10(abs(value))) - 3))
    )


def typed(value: Any, scale: float) -> Any:
    """Numbers of a vector input or typed as a text, in SI units; a text that is not one row of
    numbers stays what it is, to be refused."""
    if not isinstance(value, str):
        return tuple(float(v) / scale for v in value)
    rows = rows_typed(value, scale)
    return tuple(rows[0]) if not isinstance(rows, str) and len(rows) == 1 else value


def title(label: str) -> str:
    """A label with a capital, unless it begins with a symbol."""
    first = label.split()[0]
    return label[:1].upper() + label[1:] if first.isalpha() and len(first) > 2 else label


class Field:
    """The input of one parameter, in the units of the page."""

    def __init__(self, gui: viser.GuiApi, group: Group, spec: Spec, send: Send) -> None:
        self.spec = spec
        unit = shown(0.0, spec.unit)[1]
        self.scale = shown(1.0, spec.unit)[0]
        label = f"{title(spec.label)}, {unit}" if unit else title(spec.label)
        handle = self._input(gui, label, hint(spec, unit))
        self.bound = Bound(handle, group, lambda v: send(self._to_si(v)))

    def _to_page(self, value: Any) -> Any:
        if self.spec.rows:
            return rows_text(value, self.scale)
        if isinstance(value, tuple):
            return tuple(rounded(float(v) * self.scale) for v in value)
        return rounded(value * self.scale) if isinstance(value, float) else value

    def _to_si(self, value: Any) -> Any:
        if self.spec.rows:
            return rows_typed(value, self.scale)
        if isinstance(self.spec.value, tuple):
            return typed(value, self.scale)
        if isinstance(self.spec.value, float):
            return float(value) / self.scale
        return value

    def _input(self, gui: viser.GuiApi, label: str, help_text: str) -> Any:
        spec, value = self.spec, self._to_page(self.spec.value)
        if spec.choices is not None:
            return gui.add_dropdown(label, spec.choices, initial_value=value, hint=help_text)
        if isinstance(value, bool):
            return gui.add_checkbox(label, value, hint=help_text)
        if isinstance(value, str):
            return gui.add_text(label, value, hint=help_text)
        lo, hi = (None if b is None else b * self.scale for b in (spec.lo, spec.hi))
        if isinstance(value, tuple):
            return self._tuple(gui, label, value, lo, hi, help_text)
        return self._number(gui, label, value, lo, hi, help_text)

    def _soft(self, lo: Any, hi: Any) -> tuple[float, float] | None:
        """The slider's range in units of the page; None where a slider would be of no use."""
        spec = self.spec
        if spec.soft is None:
            if lo is None or hi is None or hi - lo > MOST_STEPS or 0.0 < MOST_STEPS * lo < hi:
                return None
            return 0.0 - rounded_down(-lo), rounded_down(hi)
        low, high = (rounded(b * self.scale, 3) for b in spec.soft)
        low = low if lo is None else max(low, -rounded_down(-lo))
        return low, high if hi is None else min(high, rounded_down(hi))

    def _number(
        self, gui: viser.GuiApi, label: str, value: Any, lo: Any, hi: Any, help_text: str
    ) -> Any:
        whole = isinstance(value, int)
        soft = self._soft(lo, hi)
        if soft is None or not soft[0] <= value <= soft[1]:
            kind = int if whole else float
            low, high = (None if b is None else kind(b) for b in (lo, hi))
            step = 1 if whole else None
            return gui.add_number(label, value, min=low, max=high, step=step, hint=help_text)
        if whole:
            return gui.add_slider(label, int(soft[0]), int(soft[1]), 1, value, hint=help_text)
        step = nice_step(*soft)
        return gui.add_slider(label, float(soft[0]), float(soft[1]), step, value, hint=help_text)

    def _tuple(
        self, gui: viser.GuiApi, label: str, value: Any, lo: Any, hi: Any, help_text: str
    ) -> Any:
        n = len(value)
        low, high = (None if b is None else (float(b),) * n for b in (lo, hi))
        if n == 2:
            return gui.add_vector2(label, value, min=low, max=high, hint=help_text)  # type: ignore
        if n == 3:
            return gui.add_vector3(label, value, min=low, max=high, hint=help_text)  # type: ignore
        return gui.add_text(label, rows_text((value,)), hint=f"{n} numbers. {help_text}")

    def show(self, value: Any) -> None:
        """Show the value in force (SI)."""
        if isinstance(value, tuple) and len(value) not in (2, 3) and not self.spec.rows:
            self.bound.show(rows_text((self._to_page(value),)))
        else:
            self.bound.show(self._to_page(value))
