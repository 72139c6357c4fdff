"""A marker can be selected: every panel says where it is, although it has no block of its own."""

from __future__ import annotations

import numpy as np

from scene_core.filter.groups import rows_of
from scene_core.geometry.correlation import largest_canonical_correlations
from scene_core.session.presets_particles import cooperation
from scene_core.session.session import Session
from web_panels.clouds import Clouds
from web_panels.correlation_table import parts_of, table_of
from web_panels.covariance import others_html
from web_panels.inspector import inspector_html
from web_panels.map_geometry import STRONG, WEAK, correlation_colours


def test_inspector_covariance_and_map_of_a_marker() -> None:
    session = Session(cooperation())
    for _ in range(3):
        session.advance()
    trace, world = session.trace, session.world
    assert trace is not None
    (marker,) = (k for k, f in world.features.items() if f.carrier)
    text = inspector_html(trace, marker, own_choice=False)
    assert f"Feature {marker}" in text and "2-D point" in text
    cloud = Clouds().of(world, 0.95, 1e-3)
    (row,) = (i for i, k in enumerate(cloud.labels) if k == marker)
    at = world.xp("assistant")
    np.testing.assert_allclose(
        cloud.positions[row][[2, 0]], at[:2] + 0.2 * np.array([np.cos(at[2]), np.sin(at[2])])
    )
    labels = tuple(world.features)
    P, rows = rows_of(world, labels)
    mine = rows[labels.index(marker)]
    rho = largest_canonical_correlations(P, mine, rows)
    colours = correlation_colours(world, marker, labels)
    np.testing.assert_allclose(colours, WEAK + rho[:, None] * (STRONG - WEAK))
    assert f"Landmark {marker} with" in others_html(world, marker)
    assert marker not in [p.label for p in parts_of(world)]
    assert np.isfinite(table_of(world, marker).values).all()
