"""Inputs from parameters: kind, unit, range, help; values in force; repetition."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import pytest
import viser

from scene_core import params
from scene_core.params import param
from tests.web.raw_client import raw_client
from tests.web.test_gate import free_port, wait
from web_panels import gate
from web_panels.widgets import (
    DRAG_S,
    SETTLE_S,
    Drag,
    Field,
    Group,
    nice_step,
    rounded,
    rounded_down,
    title,
    typed,
)


@dataclass(frozen=True)
class Example:
    """One field of every kind."""

    sd: float = param(0.5, unit="m", lo=0.0, hi=10.0, soft=(0.0, 2.0), label="Noise sd")
    """How noisy it is."""
    turn: float = param(math.radians(30), unit="rad/s", lo=0.0, soft=(0.0, math.radians(90)))
    """An angular rate."""
    far: float = param(50.0, unit="m", lo=0.0, hi=100.0, soft=(0.0, 10.0))
    """Outside its slider's range, inside its limits."""
    open: float = param(1.0)
    """No limits at all."""
    size: int = param(640, lo=8, hi=16384)
    """A wide range of whole numbers."""
    budget: int = param(10, lo=0, hi=1000, soft=(1, 40), effect="next feature")
    """Few whole numbers."""
    on: bool = param(True)
    """Yes or no."""
    kind: Literal["a", "b"] = param("a", choices=("a", "b"))
    """One of two."""
    at: tuple[float, float, float] = param((1.0, 2.0, 3.0), unit="m", lo=-5.0)
    """Three numbers."""
    many: tuple[float, ...] = param((0.1, 0.2, 0.3, 0.4))
    """Too many numbers for a row."""
    name: str = param("<b>x</b>")
    """A text."""


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    yield server
    server.stop()


@pytest.fixture
def fields(server: viser.ViserServer) -> tuple[dict[str, Field], list[tuple[str, Any]]]:
    sent: list[tuple[str, Any]] = []
    group = Group()
    made = {
        s.name: Field(server.gui, group, s, lambda v, n=s.name: sent.append((n, v)))
        for s in params.schema(Example())
    }
    return made, sent


KINDS = {
    "sd": viser.GuiSliderHandle,
    "turn": viser.GuiSliderHandle,
    "far": viser.GuiNumberHandle,
    "open": viser.GuiNumberHandle,
    "size": viser.GuiNumberHandle,
    "budget": viser.GuiSliderHandle,
    "on": viser.GuiCheckboxHandle,
    "kind": viser.GuiDropdownHandle,
    "at": viser.GuiVector3Handle,
    "many": viser.GuiTextHandle,
    "name": viser.GuiTextHandle,
}

Fields = tuple[dict[str, Field], list[tuple[str, Any]]]


def test_every_kind_of_parameter_gets_its_input(fields: Fields) -> None:
    made, _ = fields
    assert {n: type(f.bound.handle) for n, f in made.items()} == KINDS


def test_limits_hold_where_a_slider_is_too_short(fields: Fields) -> None:
    number = fields[0]["far"].bound.handle
    assert (number.min, number.max, number.value) == (0.0, 100.0, 50.0)


def test_angles_are_in_degrees(fields: Fields) -> None:
    slider = fields[0]["turn"].bound.handle
    assert slider.label == "Turn, °/s"
    assert (slider.min, slider.max, slider.value) == (0.0, 90.0, 30.0)


@dataclass(frozen=True)
class Ends:
    """Limits that are not round, and limits too far from each other."""

    turn: float = param(0.1, unit="rad", lo=0.0, hi=3.2)
    """Up to 183.346494 degrees."""
    step: float = param(1.6, unit="m", lo=0.01, hi=1000.0)
    """A slider would have one value below ten."""


def test_sliders_between_limits_end_at_round_numbers(server: viser.ViserServer) -> None:
    made = {
        s.name: Field(server.gui, Group(), s, lambda _: None).bound.handle
        for s in params.schema(Ends())
    }
    assert isinstance(made["turn"], viser.GuiSliderHandle)
    assert (made["turn"].min, made["turn"].max) == (0.0, 183.3)
    assert isinstance(made["step"], viser.GuiNumberHandle)
    assert (made["step"].min, made["step"].max) == (0.01, 1000.0)


def test_a_sliders_end_is_a_round_number_inside_the_limits() -> None:
    for value in (3.2 * 57.29577951308232, 11.45915, -0.123456, 2.0, 0.0):
        assert value - 1e-3 * abs(value) <= rounded_down(value) <= value
        assert len(f"{abs(rounded_down(value)):g}") <= 6


def test_many_numbers_are_shown_as_they_are_typed(fields: Fields) -> None:
    field = fields[0]["many"]
    assert field.bound.handle.value == "0.1, 0.2, 0.3, 0.4" and not field.bound.handle.disabled
    field.show((0.1, 0.2, 0.3, 0.5))
    assert field.bound.handle.value == "0.1, 0.2, 0.3, 0.5"


@pytest.mark.parametrize("text", ["1, 2, three, 4", "1, 2, 3", "1, 2; 3, 4", "", "nan, 1, 2, 3"])
def test_a_text_that_is_not_those_numbers_is_refused(text: str) -> None:
    with pytest.raises(params.ParamError, match="many"):
        params.replace(Example(), "many", typed(text, 1.0))


def test_the_hint_says_what_where_and_when(fields: Fields) -> None:
    hint = fields[0]["sd"].bound.handle.hint
    assert hint == "How noisy it is. Range 0 to 10 m. Takes effect: next frame."
    assert "next feature" in fields[0]["budget"].bound.handle.hint


@pytest.mark.parametrize(
    ("name", "page", "si"),
    [
        ("sd", 1.25, 1.25),
        ("turn", 45.0, math.radians(45)),
        ("budget", 12, 12),
        ("on", False, False),
        ("kind", "b", "b"),
        ("at", (0.0, 2.0, 3.0), (0.0, 2.0, 3.0)),
        ("many", "1, 2,3 , -4e-1", (1.0, 2.0, 3.0, -0.4)),
        ("name", "y", "y"),
    ],
)
def test_an_edit_goes_out_in_si_and_keeps_its_type(
    server: viser.ViserServer, fields: Fields, name: str, page: Any, si: Any
) -> None:
    made, sent = fields
    with raw_client(server) as client:
        assert wait(lambda: len(server.get_clients()) > 0)
        client.set(made[name].bound.handle._impl.uuid, page)
        assert wait(lambda: bool(sent))
    (only,) = sent
    assert only == (name, pytest.approx(si) if isinstance(si, float) else si)
    assert type(only[1]) is type(params.get(Example(), name))
    params.replace(Example(), name, only[1])


def test_our_own_assignments_post_nothing(fields: Fields) -> None:
    made, sent = fields
    made["sd"].show(1.5)
    made["turn"].show(math.radians(10))
    time.sleep(0.1)
    assert made["sd"].bound.handle.value == 1.5
    assert made["turn"].bound.handle.value == 10.0
    assert sent == []


def test_a_refused_edit_is_taken_back_on_the_page(
    server: viser.ViserServer, fields: Fields
) -> None:
    """The session keeps 0.5; the input shows it again once the hand is off, in every browser."""
    slider = fields[0]["sd"].bound.handle
    with raw_client(server) as client:
        assert wait(lambda: len(server.get_clients()) > 0)
        client.settle()
        client.seen.clear()
        client.set(slider._impl.uuid, 1.9)
        assert wait(lambda: slider.value == 1.9)
        fields[0]["sd"].show(0.5)
        assert slider.value == 1.9, "not while somebody is moving it"
        update = client.until(
            lambda m: (
                m["type"] == "GuiUpdateMessage"
                and m["uuid"] == slider._impl.uuid
                and m["updates"].get("value") == 0.5
            )
        )
        assert update and slider.value == 0.5


def test_all_inputs_of_a_group_are_repeated_after_its_last_event(
    server: viser.ViserServer, fields: Fields
) -> None:
    """The browser's throttle may have dropped an event of another input of the panel."""
    made, _ = fields
    uuids = {f.bound.handle._impl.uuid for f in made.values()}
    with raw_client(server) as client:
        assert wait(lambda: len(server.get_clients()) > 0)
        client.settle()
        client.seen.clear()
        client.set(made["sd"].bound.handle._impl.uuid, 1.0)
        time.sleep(SETTLE_S)
        client.settle()
    repeated = {m["uuid"] for m in client.seen if m["type"] == "GuiUpdateMessage"}
    assert uuids <= repeated


@pytest.mark.parametrize("span", [1e-6, 0.003, 1.0, 7.0, 360.0, 1e5])
def test_steps_are_round_and_fine_enough(span: float) -> None:
    step = nice_step(0.0, span)
    mantissa = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
    assert min(abs(mantissa - m) for m in (1.0, 2.0, 5.0)) < 1e-9
    assert 100 * (1 - 1e-9) <= span / step <= 250 * (1 + 1e-9)


def test_titles_leave_symbols_alone() -> None:
    assert [title(t) for t in ("noise sd", "u0", "f u", "NCC, min")] == [
        "Noise sd",
        "u0",
        "f u",
        "NCC, min",
    ]
    assert rounded(2.8647889) == 2.865


def test_a_movement_goes_on_until_a_pause_and_is_never_called_like_an_earlier_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [100.0]
    monkeypatch.setattr("web_panels.widgets.time.monotonic", lambda: now[0])
    names = []
    for drag in (Drag("sd"), Drag("sd")):  # the panel was made anew between
        for wait_s in (0.0, 0.9 * DRAG_S, 0.9 * DRAG_S, 1.1 * DRAG_S):
            now[0] += wait_s
            names.append(drag.name())
    assert names[0] == names[1] == names[2] and names[4] == names[5] == names[6]
    assert len(set(names)) == 4 and all(name.startswith("sd ") for name in names)
