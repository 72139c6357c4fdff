"""Two limits in the form: what one command does to both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from scene_core import params
from scene_core.models.ordered import demand_order
from scene_core.params import ParamError, Spec, param
from scene_core.session.commands import SetParam, SetParams
from web_panels import limits
from web_panels.limits import Limit, partners


@dataclass(frozen=True)
class Example:
    """A reach in m and a number of particles."""

    near: float = param(1.0, unit="m", lo=0.1, hi=50.0, below="far")
    """The nearer end."""
    far: float = param(8.0, unit="m", lo=0.2, hi=100.0)
    """The farther end."""
    least: int = param(20, lo=2, hi=1000, below="most")
    """The smaller number."""
    most: int = param(100, lo=10, hi=5000)
    """The larger number."""
    alone: float = param(1.0)
    """No limit of anything."""
    name = "example"

    def __post_init__(self) -> None:
        demand_order(self)


SPECS: dict[str, Spec] = {s.name: s for s in params.schema(Example(), "e")}
BESIDE = partners(SPECS.values())


def test_partners_know_each_other() -> None:
    pairs = {path: other.path for path, other in BESIDE.items()}
    assert pairs == {
        **{"e.near": "e.far", "e.far": "e.near"},
        **{"e.least": "e.most", "e.most": "e.least"},
    }


def after(name: str, *values: float) -> Example:
    """The example after one gesture; `demand_order` refuses what is not in order."""
    spec, now = SPECS[name], Example()
    limit = Limit(spec, BESIDE[spec.path])
    for value in values:
        command = limit.edit(value, getattr(now, limit.other.name))
        edits = command.values if isinstance(command, SetParams) else ((spec.path, value),)
        now = replace(now, **{path.removeprefix("e."): v for path, v in edits})
    return now


@pytest.mark.parametrize(
    ("name", "value"),
    [("near", 8.0), ("near", 50.0), ("far", 1.0), ("far", 0.2), ("least", 500), ("most", 10)],
)
def test_a_limit_moved_past_the_other_takes_it_along(name: str, value: float) -> None:
    assert getattr(after(name, value), name) == value


def test_numbers_may_be_equal() -> None:
    assert after("least", 100) == replace(Example(), least=100)
    assert after("most", 10) == replace(Example(), most=10, least=10)


def test_a_limit_that_stays_in_order_is_edited_alone() -> None:
    command = Limit(SPECS["near"], SPECS["far"]).edit(7.9, 8.0)
    assert command == SetParam("e.near", 7.9)


def test_the_other_comes_back_in_the_same_gesture(monkeypatch: pytest.MonkeyPatch) -> None:
    assert after("most", 10, 15, 150) == replace(Example(), most=150)
    assert after("near", 20.0, 2.0) == replace(Example(), near=2.0)
    monkeypatch.setattr(limits, "GESTURE_S", -1.0)
    assert after("near", 20.0, 2.0) == replace(Example(), near=2.0, far=21.0)


def test_what_leaves_no_room_is_refused_with_a_sentence() -> None:
    command = Limit(SPECS["far"], SPECS["near"]).edit(0.05, 1.0)
    assert isinstance(command, SetParams)
    with pytest.raises(ParamError, match="far"):
        params.replace_all(Example(), {p.removeprefix("e."): v for p, v in command.values})
