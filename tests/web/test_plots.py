"""Curves are thinned, known values only, and the band is where the numbers say."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from scene_core.session.published import RobotSeries, Series
from tests.web.traces import published
from web_panels.panel import Page
from web_panels.plots import POINTS, Plots, thinned


@pytest.mark.parametrize("n", [1, 2, 399, 400, 401, 5000, 36001])
def test_thinning_keeps_the_last_sample_and_the_limit(n):
    at = thinned(n)
    assert at[-1] == n - 1
    assert 1 <= len(at) <= POINTS
    assert len(set(np.diff(at))) <= 1


class FakePlot:
    """Remembers what it was asked to show."""

    def __init__(self) -> None:
        self.shown: tuple | None = None

    def show(self, title, unit, x, curves, band=None):
        self.shown = (title, unit, np.asarray(x), {c["label"]: np.asarray(y) for c, y in curves})

    def hide(self):
        self.shown = None


def panel() -> Any:
    plots = cast(Any, Plots(Page()))
    choice = lambda: SimpleNamespace(options=("–",), value="–", visible=False)  # noqa: E731
    plots.error_choice, plots.calibration_choice = choice(), choice()
    plots.note = SimpleNamespace(content="")
    for name in ("error", "nees", "calibration", "nis", "ms", "landmarks"):
        setattr(plots, name, FakePlot())
    return plots


def series(n: int, truth: bool = True) -> Series:
    t = np.arange(n) / 10.0
    nees = np.full(n, 5.0)
    nees[0] = np.nan
    robot = RobotSeries(
        labels=("x", "phi"),
        units=("m", "rad"),
        position=np.zeros((n, 3)),
        true_position=None,
        error=np.full((n, 2), 0.02) if truth else None,
        sd=np.full((n, 2), 0.01),
        nees=nees if truth else None,
        nees_dof=3,
        nees_band=(0.2, 9.3),
    )
    nis = np.full(n, 1.0)
    nis[n // 2] = np.nan
    return Series(
        frames=np.arange(n, dtype=float),
        times=t,
        robots={"my robot": robot},
        nis=nis,
        nis_band=np.tile([0.5, 1.5], (n, 1)),
        ms={"predict": np.full(n, 0.4)},
        landmarks=np.arange(n, dtype=float),
        calibrations={"speed scale": (np.full(n, 0.9), np.full(n, 0.1), None)},
    )


def test_small_lengths_are_in_millimetres_and_angles_in_degrees():
    plots = panel()
    plots.render(published(None, series=series(50)))
    _, unit, _, curves = plots.error.shown
    assert unit == "mm"
    np.testing.assert_allclose(curves["error"], 20.0)
    np.testing.assert_allclose(curves["+3 sigma"], 30.0)
    plots.error_choice.value, plots._key = "my robot phi", None
    plots.render(published(None, series=series(50)))
    _, unit, _, curves = plots.error.shown
    assert unit == "°"
    np.testing.assert_allclose(curves["error"], np.degrees(0.02))


def test_another_choice_is_drawn_although_the_session_stands_still():
    plots = panel()
    plots.render(published(None, series=series(50)))
    assert not plots.restless
    plots._key = None
    assert plots.restless


def test_frames_without_a_value_are_left_out():
    plots = panel()
    plots.render(published(None, series=series(50)))
    for plot in (plots.nees, plots.nis):
        _, _, x, curves = plot.shown
        assert len(x) == 49
        assert all(len(y) == 49 and np.isfinite(y).all() for y in curves.values())


def test_without_truth_there_are_bounds_but_neither_error_nor_nees():
    plots = panel()
    plots.render(published(None, series=series(50, truth=False)))
    assert "no truth" in plots.error.shown[0]
    assert "error" not in plots.error.shown[3]
    assert plots.nees.shown is None


def test_calibrations_have_three_sigma_bounds():
    plots = panel()
    plots.render(published(None, series=series(50)))
    assert plots.calibration_choice.visible
    np.testing.assert_allclose(plots.calibration.shown[3]["+3 sigma"], 1.2)


def test_one_frame_is_not_a_curve_yet():
    plots = panel()
    plots.render(published(None, series=series(1)))
    assert "second frame" in plots.note.content
    assert plots.error.shown is None
