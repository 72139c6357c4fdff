"""The picture of the correlations: what is in which cell, and which row is framed."""

import numpy as np
import pytest

from scene_core.geometry.correlation import correlation, largest_canonical_correlations
from tests.web.fakes import published
from tests.web.traces import cloister
from web_panels import correlation_table
from web_panels.correlation_picture import (
    APART,
    LEFT,
    SIDE,
    TOP,
    _Name,
    picture,
    ramp,
    spread,
    wanted,
)
from web_panels.correlation_table import merged, parts_of, table_of
from web_panels.covariance import others_html


def test_the_parts_cover_the_state_once_and_in_order():
    world = cloister().world
    rows = np.concatenate([np.arange(p.rows.start, p.rows.stop) for p in parts_of(world)])
    np.testing.assert_array_equal(rows, np.arange(world.gauss.layout.size))
    assert [p.name for p in parts_of(world)][:2] == ["r", "q"]


def test_a_large_state_is_shown_by_blocks_and_a_small_one_by_numbers(monkeypatch):
    world = cloister().world
    table = table_of(world, None)
    assert not table.signed
    assert len(table.values) == len(table.names)
    monkeypatch.setattr(correlation_table, "ROWS", 10_000)
    small = table_of(world, None)
    assert small.signed
    np.testing.assert_array_equal(small.values, correlation(world.gauss.P))


def test_cells_have_the_colour_of_their_value():
    table = table_of(cloister().world, None)
    image = picture(table, None)
    n = len(table.values)
    for i, j in ((0, 0), (0, n - 1), (n // 2, 1)):
        at = ((np.array([i, j]) + 0.5) * SIDE / n).astype(int)
        want = ramp(False)[round(float(table.values[i, j]) * 255)]
        np.testing.assert_array_equal(image[TOP + at[0], LEFT + at[1]], want)


def test_the_selected_landmark_is_framed_in_white_and_only_it():
    world = cloister().world
    label = next(iter(world.features))
    table = table_of(world, label)
    row = next(first for _, first, _, own in table.names if own == label)
    y = TOP + round(row * SIDE / len(table.values))
    assert (picture(table, label)[y, LEFT + 5] == 255).all()
    assert not (picture(table, None)[y, LEFT + 5] == 255).all()


def test_a_selected_landmark_beyond_the_shown_blocks_is_shown_all_the_same(monkeypatch):
    world = cloister().world
    label = list(world.features)[-1]
    monkeypatch.setattr(correlation_table, "BLOCKS", 6)
    names = table_of(world, label).names
    assert len(names) == 6
    assert names[-1][3] == label
    assert label not in [n[3] for n in table_of(world, None).names]


def test_every_other_landmark_is_listed_with_its_largest_canonical_correlation():
    world = cloister().world
    label = next(iter(world.features))
    page = others_html(world, label)
    layout = world.gauss.layout
    for other, f in world.features.items():
        if other == label:
            continue
        rho = largest_canonical_correlations(
            world.gauss.P, layout[world.features[label].block].slice, [layout[f.block].slice]
        )[0]
        assert f"{rho:.2f}</span>" in page
    assert page.count("<svg") == len(world.features) - 1


@pytest.mark.parametrize("selected", [None, 999])
def test_without_a_selection_it_says_how_to_select(selected):
    assert "click it" in others_html(cloister().world, selected)


def test_colours_are_extreme_at_the_ends_and_dark_at_zero():
    signed, plain = ramp(True).astype(int), ramp(False).astype(int)
    assert signed[127].sum() < 220 and plain[0].sum() < 120
    assert signed[0][2] > signed[0][0] and signed[-1][0] > signed[-1][2]


@pytest.mark.parametrize(
    ("preset", "names"),
    [
        ("arm", ["foot r", "foot q", "q1 q2 q3", "calib"]),
        ("inertial", ["r", "q", "v", "ba", "bg"]),
        ("two_robots", ["r first", "q first", "r second", "q second", "pose"]),
    ],
)
def test_long_runs_of_components_have_short_names(preset, names):
    trace = published(preset, 1).trace
    assert trace is not None
    assert [p.name for p in merged(parts_of(trace.world)) if p.label is None] == names


def test_names_keep_apart_and_stay_beside_the_picture():
    rng = np.random.default_rng(0)
    for n in (1, 5, SIDE // APART):
        at = sorted(rng.integers(0, SIDE // 3, n).tolist())
        places = np.array(spread(at, APART, SIDE))
        assert (np.diff(places) >= APART).all()
        assert places.max() <= SIDE
    far = [10, 200, 400]
    assert spread(far, APART, SIDE) == far, "nobody is moved without need"
    assert spread([SIDE, SIDE], APART, SIDE) == [SIDE - APART, SIDE]


def test_all_names_but_landmarks_are_shown_and_the_selected_one():
    names = [_Name("r", 0, None, False), _Name("q", 1, None, False)]
    names += [_Name(str(i), 2 + i, i, i == 33) for i in range(60)]
    shown = wanted(names, 20)
    assert len(shown) <= 20 and {"r", "q", "33"} <= {n.text for n in shown}
    assert wanted(names[:12], 20) == names[:12]
