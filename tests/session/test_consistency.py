"""A few seeds of the statistics that `make consistency` takes of every scenario."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from scene_core.geometry.ellipses import chi2_band
from scene_core.session import presets, study
from scene_core.session.edits import set_param
from scene_core.session.study import Outcome, RobotOutcome, Study


@pytest.mark.parametrize(
    ("name", "seeds", "frames"),
    [
        ("line", 5, 80),
        ("nomad", 1, 220),  # to the first corner it knows its heading exactly, and has no NEES
        ("car", 2, 60),
        ("terrain_roll_pitch", 2, 50),
        ("arm", 2, 60),
        ("inertial", 2, 60),
        ("two_cameras", 2, 50),
    ],
)
def test_scenarios_are_as_wrong_as_they_believe(name: str, seeds: int, frames: int) -> None:
    """NEES and NIS in intervals that hold for all but one in a thousand."""
    result = study.study(presets.build(name), range(seeds), frames)
    assert result.robots
    for robot in result.robots:
        lo, hi = chi2_band(result.outcomes[0].robots[robot].dof, seeds, 0.999)
        assert lo <= result.nees(robot) <= hi
    for outcome in result.outcomes:
        assert 0.8 < outcome.nis < 1.2


def test_a_model_made_wrong_on_purpose_is_seen() -> None:
    """A sensor believed five times better than it is: NEES far out of its band."""
    wrong = set_param(presets.build("line"), "estimator.mounts.range.sensor.sd", 0.018)
    result = study.study(wrong, range(3), 100)
    assert result.nees("robot") > 3 * result.nees_band("robot")[1] and not result.is_consistent


def test_what_is_estimated_converges_to_the_truth() -> None:
    """Both scales of the car, from 2.4 of their standard deviations away."""
    result = study.study(presets.build("car"), range(1), 150)
    for label, true in (("speed scale", 0.88), ("steering scale", 1.12)):
        mean, sd, told = result.outcomes[0].calibrations[f"robot:car:calib {label}"]
        assert told == true and sd < 0.03 and abs(mean - true) < 3.5 * sd


def _outcomes(estimates: list[float]) -> tuple[Outcome, ...]:
    robot = RobotOutcome(1.0, 1.0, 1, 0.1, 0.1)
    return tuple(
        Outcome(i, {"cart": robot}, {"scale": (x, 0.1, 1.0)}) for i, x in enumerate(estimates)
    )


def test_the_mean_over_seeds_is_held_against_its_interval() -> None:
    good = Study("x", _outcomes([0.9, 1.1] * 10))
    (one,) = good.calibrations()
    assert one.name == "scale" and one.nees == pytest.approx(1.0) and good.is_consistent
    assert good.nees_band("cart") == pytest.approx((9.59 / 20, 34.17 / 20), abs=0.001)
    bad = Study("x", _outcomes([1.2] * 20))
    assert not next(iter(bad.calibrations())).is_consistent and not bad.is_consistent
    assert "scale has a squared normalised error of 4.00" in next(iter(study.complaints(bad)))


def test_a_robot_without_a_truth_is_left_out() -> None:
    unknown = RobotOutcome(math.nan, math.nan, 6, math.nan, math.nan)
    both = {"seen": RobotOutcome(3.0, 3.0, 3, 0.1, 0.1), "unseen": unknown}
    assert Study("x", (Outcome(0, both),)).robots == ("seen",)
    nobody = Study("x", (Outcome(0, {"unseen": both["unseen"]}),))
    assert nobody.robots == () and not nobody.is_consistent


def test_the_table_has_a_row_for_each_robot_and_a_cell_for_each_column() -> None:
    head, line = study.HEAD.splitlines()
    assert head.count("|") == line.count("|")
    result = study.study(presets.build("two_robots"), range(1), 4)
    table = study.rows(result).splitlines()
    assert [row.split("|")[2].strip() for row in table] == ["first", "second"]
    assert {row.count("|") for row in table} == {head.count("|")}


def test_what_is_out_of_its_band_is_a_failure_unless_there_is_a_reason(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table asks the scenario, which says how long a run is and why it is out of its band."""
    wrong = set_param(presets.build("line"), "estimator.mounts.range.sensor.sd", 0.01)
    plain = replace(presets.named("line"), make=lambda: wrong, frames=40)
    options = study.Options(("line",), seeds=2)
    for reason, code, words in (("", 1, "| NO |"), ("it is meant to be.", 0, "| no: see below |")):
        monkeypatch.setitem(presets.PRESETS, "line", replace(plain, reason=reason))
        assert study.main(options) == code
        said = capsys.readouterr().out
        assert words in said and ("- `line`: it is meant to be." in said) == bool(reason)
