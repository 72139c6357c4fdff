"""Simulated worlds: the toolbox's cloister to the last bit, outlines that enclose landmarks, ground
that has the slope it says, and identities that stay."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from scene_core.sources.buildings import CorridorLoop, CorridorPlan, House
from scene_core.sources.room import BOXES, SIZE, TexturedRoom, poster_corners
from scene_core.sources.scattered import RandomPlane, RandomWorld
from scene_core.sources.terrain import Terrain
from scene_core.sources.worlds import (
    Field,
    Line,
    SimulatedWorld,
    ThickCloister,
    in_axes,
    landmarks,
    lines,
)

WORLDS = [
    ThickCloister(),
    Line(),
    Field(),
    TexturedRoom(),
    House(),
    CorridorLoop(),
    CorridorPlan(),
    RandomWorld(count_segments=20),
    RandomWorld(region="disc", count_segments=20),
    RandomPlane(),
    RandomPlane(region="disc"),
    Terrain(sticks=0.0),
]


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
    ids, points = landmarks(world)
    line_ids, segments = lines(world)
    every = [*ids.tolist(), *line_ids.tolist()]
    assert every == list(range(1, len(points) + len(segments) + 1))
    places = np.concatenate([points, segments.reshape(-1, world.space.d)])
    assert len(places) and places.shape[1] == world.space.d
    ends = world.outline().reshape(-1, world.space.d)
    # A drawn grid of the ground misses its peaks by a little.
    slack = 0.1 if world.name == "terrain" else 1e-9
    assert (places >= ends.min(0) - slack).all() and (places <= ends.max(0) + slack).all()
    assert (np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1) > 0.0).all()


@pytest.mark.parametrize("world", WORLDS, ids=lambda w: w.name)
def test_a_world_is_the_same_whenever_it_is_asked(world: SimulatedWorld) -> None:
    again = zip(
        (*world.points(), world.segments()), (*world.points(), world.segments()), strict=True
    )
    for a, b in again:
        np.testing.assert_array_equal(a, b)


def test_the_house_has_the_segments_of_the_toolbox() -> None:
    """slamtb: walls 4, floor 4, roof 7, door 4, window 4; default 5 x 5 x 4 m."""
    segments = House().segments()
    assert segments.shape == (23, 2, 3)
    np.testing.assert_allclose(np.ptp(segments.reshape(-1, 3), axis=0), (5.0, 5.0, 4.0))
    upright = np.abs(segments[:, 1, :2] - segments[:, 0, :2]).max(axis=1) < 1e-12
    on_floor = (segments[..., 2] == 0.0).all(axis=1)
    at_ridge = (segments[..., 2] == 4.0).any(axis=1)
    assert (upright.sum(), on_floor.sum(), at_ridge.sum()) == (4 + 2 + 2, 4 + 1, 5)
    assert len({tuple(map(tuple, np.sort(s, axis=0))) for s in segments.tolist()}) == 23


def test_marks_are_on_the_walls_of_the_house_all_round() -> None:
    ids, at = House(marks=60).points()
    assert ids.tolist() == list(range(1, 61)) and len(House().points()[0]) == 0
    assert np.isclose(np.abs(at[:, :2]).max(axis=1), 2.5).all()
    assert (at[:, 2] > 0.0).all() and (at[:, 2] < 2.6).all()
    walls = [np.count_nonzero(np.isclose(at[:, i], s)) for i in (0, 1) for s in (-2.5, 2.5)]
    assert walls == [15] * 4 and np.ptp(at[:15, 2]) > 2.0


def test_a_house_is_moved_and_stretched() -> None:
    moved = House(x=1.0, y=-2.0, z=0.5, length=10.0, width=2.5, height=8.0).segments()
    expected = (House(x=0.0, y=0.0).segments() * [2.0, 0.5, 2.0]) + [1.0, -2.0, 0.5]
    np.testing.assert_allclose(moved, expected)


@pytest.mark.parametrize("world", [CorridorLoop(), CorridorPlan()], ids=lambda w: w.name)
def test_the_corridor_is_free_and_its_points_are_on_both_walls(
    world: CorridorLoop | CorridorPlan,
) -> None:
    half = 0.5 * np.array([world.length, world.width])
    at = world.points()[1][:, :2]
    outer = (np.abs(at) > half + 1e-9).any(axis=1)
    assert outer.sum() > 20 and (~outer).sum() > 20
    wall = np.abs((np.abs(at) - half) / world.corridor * 2.0)
    np.testing.assert_allclose(np.abs(wall - 1.0).min(axis=1), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(world.corners()), np.tile(half, (4, 1)))


def test_doors_stand_in_the_outer_walls() -> None:
    world = CorridorLoop(doors=3)
    frames = world.segments()[8:].reshape(-1, 3, 2, 3)
    assert len(frames) == 12
    outer = 0.5 * (np.array([world.length, world.width]) + world.corridor)
    assert np.isclose(np.abs(frames[..., :2]), outer).any(axis=-1).all()
    posts, lintel = frames[:, :2], frames[:, 2]
    np.testing.assert_allclose(posts[:, :, 1], lintel)
    assert (posts[:, :, 0, 2] == 0.0).all() and (lintel[..., 2] == 2.0).all()


def test_a_disc_is_filled_evenly() -> None:
    _, at = RandomPlane(count=4000, region="disc", extent=3.0).points()
    r2 = (at**2).sum(axis=1) / 9.0
    assert r2.max() <= 1.0
    np.testing.assert_allclose(np.quantile(r2, [0.25, 0.5, 0.75]), [0.25, 0.5, 0.75], atol=0.03)


def test_random_segments_are_as_long_as_allowed() -> None:
    world = RandomWorld(count=0, count_segments=200, length=0.7)
    ends = world.segments()
    far = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert far.max() <= 0.7 + 1e-12 and np.median(far) == pytest.approx(0.7)


@pytest.mark.parametrize("make", [RandomWorld, RandomPlane, Terrain, CorridorLoop])
def test_another_layout_is_another_world_of_the_same_kind(
    make: Callable[..., SimulatedWorld],
) -> None:
    a, b = make(layout=1).points()[1], make(layout=2).points()[1]
    assert a.shape == b.shape and not np.allclose(a, b)


def test_the_ground_has_the_slope_and_the_relief_it_says() -> None:
    terrain = Terrain(relief=0.3, extent=60.0)
    rng = np.random.default_rng(0)
    at = rng.uniform(-60.0, 60.0, (2000, 2))
    ground, step = terrain.ground(at), 1e-5
    for axis in range(2):
        e = step * np.eye(2)[axis]
        rise = (terrain.ground(at + e).height - terrain.ground(at - e).height) / (2 * step)
        np.testing.assert_allclose(ground.slope[:, axis], rise, atol=1e-8)
    assert ground.height.std() == pytest.approx(0.3, rel=0.15)
    np.testing.assert_array_equal(ground.height, terrain.ground(at).height)


def test_stones_lie_on_the_ground_and_sticks_stand_in_it() -> None:
    terrain = Terrain(sticks=0.5)
    _, at = terrain.points()
    above = at[:, 2] - terrain.ground(at[:, :2]).height
    assert np.abs(above[::2]).max() < 1e-12
    assert above[1::2].min() >= 0.0 and 0.3 < above[1::2].max() <= 0.5


def test_a_world_stands_upright_whichever_axis_points_up() -> None:
    """The same turn as a plane makes: its z is x or z, its x is y or x."""
    at = np.array([[1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(in_axes(House(), at, "z"), at)
    np.testing.assert_array_equal(in_axes(House(), at, "y"), [[2.0, 3.0, 1.0]])
    for up, height in (("z", 2), ("y", 1)):
        flat = in_axes(Field(), at[:, :2], up)
        np.testing.assert_array_equal(flat, in_axes(House(), at * [1.0, 1.0, 0.0], up))
        assert flat[0, height] == 0.0
    np.testing.assert_array_equal(in_axes(TexturedRoom(), at, "y"), at)


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
