"""The picture of the correlations: what is in which cell, and which row is framed."""

import numpy as np
import pytest

from scene_core.geometry.correlation import correlation, largest_canonical_correlations
from tests.web.traces import cloister
from web_panels import covariance
from web_panels.covariance import (
    LEFT,
    SIDE,
    TOP,
    others_html,
    parts_of,
    picture,
    ramp,
    table_of,
)


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
    monkeypatch.setattr(covariance, "ROWS", 10_000)
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
    monkeypatch.setattr(covariance, "BLOCKS", 6)
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
