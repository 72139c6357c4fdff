"""Poses form a group that acts on homogeneous points, in every dimension."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scene_core.geometry.embedding import embed, embed_covariances, embed_points
from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import ONE_D, THREE_D, TWO_D, Space, relative, wrap

SPACES = [ONE_D, TWO_D, THREE_D]
seeds = st.integers(0, 2**32 - 1)
spaces = st.sampled_from(SPACES)


def pose(space: Space, rng: np.random.Generator) -> np.ndarray:
    x = 3.0 * rng.standard_normal(space.n)
    return space.normalise(x)[0]


def difference(space: Space, a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(space.difference(a, b)).max())


@given(spaces, seeds)
def test_composition_is_associative(space, seed):
    rng = np.random.default_rng(seed)
    a, b, c = (pose(space, rng) for _ in range(3))
    left = space.compose(space.compose(a, b).x, c).x
    right = space.compose(a, space.compose(b, c).x).x
    assert difference(space, left, right) < 1e-12


@given(spaces, seeds)
def test_identity_and_inverse(space, seed):
    a = pose(space, np.random.default_rng(seed))
    one = space.identity()
    assert difference(space, space.compose(a, one).x, a) < 1e-12
    assert difference(space, space.compose(one, a).x, a) < 1e-12
    assert difference(space, space.compose(a, space.inverse(a).x).x, one) < 1e-12
    assert difference(space, space.compose(space.inverse(a).x, a).x, one) < 1e-12
    assert difference(space, relative(space, a, a).x, one) < 1e-12


@given(spaces, seeds)
def test_the_action_is_compatible_with_composition(space, seed):
    rng = np.random.default_rng(seed)
    a, b, X = pose(space, rng), pose(space, rng), rng.standard_normal((4, space.d + 1))
    there = space.to_world(a, space.to_world(b, X).X).X
    np.testing.assert_allclose(space.to_world(space.compose(a, b).x, X).X, there, atol=1e-11)
    np.testing.assert_allclose(space.to_world(a, space.to_local(a, X).X).X, X, atol=1e-11)
    np.testing.assert_allclose(
        space.to_local(a, X).X, space.to_world(space.inverse(a).x, X).X, atol=1e-11
    )


@given(spaces, seeds)
def test_points_at_infinity_only_turn(space, seed):
    rng = np.random.default_rng(seed)
    X = np.r_[rng.standard_normal(space.d), 0.0]
    a = pose(space, rng)
    moved = a.copy()
    moved[: space.d] += 5.0
    np.testing.assert_allclose(space.to_local(a, X).X, space.to_local(moved, X).X, atol=1e-12)


@settings(max_examples=30)
@given(spaces, seeds)
def test_jacobians_of_the_group(space, seed):
    rng = np.random.default_rng(seed)
    # Not normalised: the Jacobians are those of the polynomial in q.
    a, b = 0.5 * rng.standard_normal((2, space.n))
    c = space.compose(a, b)
    for which, J in ((0, c.by_a), (1, c.by_b)):
        numeric = central_differences(lambda a, b: space.compose(a, b).x, (a, b), which)
        np.testing.assert_allclose(J, numeric, atol=1e-7)
    numeric = central_differences(lambda a: space.inverse(a).x, (a,), 0)
    np.testing.assert_allclose(space.inverse(a).jacobian, numeric, atol=1e-7)
    numeric = central_differences(lambda a, b: relative(space, a, b).x, (a, b), 0)
    np.testing.assert_allclose(relative(space, a, b).by_a, numeric, atol=1e-7)


@settings(max_examples=30)
@given(spaces, seeds, st.booleans())
def test_jacobians_of_the_action(space, seed, toward_world):
    rng = np.random.default_rng(seed)
    move = space.to_world if toward_world else space.to_local
    a, X = rng.standard_normal(space.n), rng.standard_normal((3, space.d + 1))
    r = move(a, X)
    for which, J in ((0, r.by_xp), (1, r.by_X)):
        numeric = central_differences(lambda a, X: move(a, X).X, (a, X), which)
        np.testing.assert_allclose(np.broadcast_to(J, numeric.shape), numeric, atol=1e-7)


@pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
def test_a_batch_of_poses_is_the_same_as_one_by_one(space, rng):
    a, b = rng.standard_normal((2, 5, space.n))
    X = rng.standard_normal((5, space.d + 1))
    calls = [
        (space.compose, (a, b)),
        (space.inverse, (a,)),
        (space.to_local, (a, X)),
        (space.to_world, (a, X)),
        (space.normalise, (a,)),
        (lambda a, b: (space.difference(a, b),), (a, b)),
    ]
    for function, args in calls:
        many = function(*args)
        for i in range(5):
            one = function(*(arg[i] for arg in args))
            for whole, part in zip(many, one, strict=True):
                at_row = np.broadcast_to(whole, (5, *part.shape))[i]
                np.testing.assert_allclose(at_row, part, atol=1e-13)


@given(spaces, seeds)
def test_a_small_change_on_the_tangent_is_that_change_of_the_pose(space, seed):
    rng = np.random.default_rng(seed)
    a, small = pose(space, rng), 1e-6 * rng.standard_normal(space.tangent)
    changed = space.normalise(a + space.from_tangent(a) @ small)[0]
    np.testing.assert_allclose(space.difference(changed, a), small, atol=1e-11)
    np.testing.assert_allclose(
        space.tangent_map(a) @ space.from_tangent(a), np.eye(space.tangent), atol=1e-12
    )


def test_angles_wrap_to_the_half_open_interval():
    turns = np.array([0.0, np.pi, -np.pi, 3 * np.pi, 1.5 * np.pi, -0.1, 1e6])
    got = wrap(turns)
    assert ((got > -np.pi) & (got <= np.pi)).all()
    assert got[1] == got[2] == np.pi
    np.testing.assert_allclose(np.exp(1j * got), np.exp(1j * turns), atol=1e-9)


def test_planar_heading_turns_from_z_towards_x():
    ahead = TWO_D.to_world(np.array([0.0, 0.0, np.pi / 2]), np.array([1.0, 0.0, 1.0])).X
    np.testing.assert_allclose(ahead, [0.0, 1.0, 1.0], atol=1e-15)


@pytest.mark.parametrize("up", ["y", "z"])
@given(spaces, seeds)
def test_embedding_commutes_with_the_group_and_its_action(up, space, seed):
    rng = np.random.default_rng(seed)
    a, b = pose(space, rng), pose(space, rng)
    c = THREE_D.compose(embed(a, space, up)[0], embed(b, space, up)[0]).x
    assert difference(THREE_D, c, embed(space.compose(a, b).x, space, up)[0]) < 1e-11
    m = rng.standard_normal(space.d)
    flat = space.to_world(a, np.r_[m, 1.0]).X[:-1]
    high = THREE_D.to_world(embed(a, space, up)[0], np.r_[embed_points(m, space, up), 1.0]).X[:-1]
    np.testing.assert_allclose(embed_points(flat, space, up), high, atol=1e-11)
    numeric = central_differences(lambda a: embed(a, space, up)[0], (a,), 0)
    np.testing.assert_allclose(embed(a, space, up)[1], numeric, atol=1e-8)


@pytest.mark.parametrize(
    ("up", "forward", "sideways"), [("y", [0, 0, 1], [1, 0, 0]), ("z", [1, 0, 0], [0, 1, 0])]
)
def test_embedded_axes(up, forward, sideways):
    np.testing.assert_array_equal(embed_points(np.array([1.0, 0.0]), TWO_D, up), forward)
    np.testing.assert_array_equal(embed_points(np.array([0.0, 1.0]), TWO_D, up), sideways)
    np.testing.assert_array_equal(embed_points(np.array([1.0]), ONE_D, up), forward)
    P = embed_covariances(np.diag([4.0, 9.0])[None], TWO_D, up)[0]
    assert P @ forward @ forward == 4.0
    assert P @ sideways @ sideways == 9.0
    assert P.sum() == 13.0


def test_a_pose_on_a_line_lies_in_the_plane() -> None:
    """Through the plane or at once, it is the same pose in space."""
    for up in ("y", "z"):
        flat, J = embed(np.array([2.5]), ONE_D, up, TWO_D)
        np.testing.assert_array_equal(flat, [2.5, 0.0, 0.0])
        np.testing.assert_array_equal(J, [[1.0], [0.0], [0.0]])
        np.testing.assert_allclose(
            embed(flat, TWO_D, up)[0], embed(np.array([2.5]), ONE_D, up)[0], atol=1e-12
        )
