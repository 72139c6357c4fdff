"""Simulated worlds: the toolbox's cloister to the last bit, and outlines that enclose landmarks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from scene_core.sources.room import BOXES, SIZE, TexturedRoom, poster_corners
from scene_core.sources.worlds import Field, Line, SimulatedWorld, ThickCloister

WORLDS = [ThickCloister(), Line(), Field(), TexturedRoom()]


def test_cloister_is_the_toolbox_world(golden: Callable[[str], Path]) -> None:
    theirs = np.load(golden("slamtb_mono_idp.npz"), allow_pickle=True)["world_points"]
    ids, points = ThickCloister().points()
    np.testing.assert_array_equal(ids, theirs[:, 0])
    np.testing.assert_array_equal(points, theirs[:, 1:])


def test_cloister_is_the_same_from_all_four_sides() -> None:
    points = {tuple(p) for p in np.round(ThickCloister().points()[1], 9).tolist()}
    turned = {(-y + 0.0, x, z) for x, y, z in points}
    assert turned == points


@pytest.mark.parametrize("world", WORLDS, ids=lambda w: w.name)
def test_identities_are_unique_and_the_outline_holds_the_landmarks(world: SimulatedWorld) -> None:
    ids, points = world.points()
    assert len(set(ids.tolist())) == len(ids) == len(points)
    assert points.shape[1] == world.space.d
    ends = world.outline().reshape(-1, world.space.d)
    assert (points >= ends.min(0) - 1e-9).all() and (points <= ends.max(0) + 1e-9).all()


def test_another_layout_is_another_field_of_the_same_size() -> None:
    a, b = Field(layout=1).points()[1], Field(layout=2).points()[1]
    assert not np.allclose(a, b)
    assert np.abs(a - b).max() <= 2 * Field().scatter * Field().step + 1e-9
    np.testing.assert_array_equal(a, Field(layout=1).points()[1])


def test_surfaces_face_into_the_room_and_furniture_stands_in_it() -> None:
    middle = np.array([0.0, 0.0, SIZE[2] / 2])
    walls = [s for s in TexturedRoom().surfaces() if s.is_wall]
    assert len(walls) == 6
    for s in walls:
        assert (middle - s.centre) @ s.normal > 0
    for s in TexturedRoom().surfaces():
        aspect = s.texture.shape[1] / s.texture.shape[0]
        assert aspect == pytest.approx(s.width / s.height, rel=0.02)
    for _, low, high in BOXES:
        assert all(
            abs(v) <= half for v, half in zip((*low[:2], *high[:2]), (3.0, 2.5) * 2, strict=True)
        )
        assert 0 <= low[2] < high[2] < SIZE[2]


def test_the_poster_is_where_its_corners_say() -> None:
    wall = next(s for s in TexturedRoom().surfaces() if s.name == "poster wall")
    grey = wall.texture.mean(axis=2)
    scale = wall.texture.shape[1] / wall.width
    inward = poster_corners().mean(0)
    for corner in poster_corners():
        u, v = (np.array([wall.right, wall.down]) @ (corner - wall.corner)) * scale
        du, dv = np.sign(np.array([wall.right, wall.down]) @ (inward - corner)) * 4
        dark, light = grey[round(v + dv), round(u + du)], grey[round(v - dv), round(u - du)]
        assert dark < 0.5 * light
