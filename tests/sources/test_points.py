"""Points are matched by who they are, or by where they are expected; new ones in a fixed order."""

from __future__ import annotations

import numpy as np

from scene_core.filter.ports import Occupied, Points, Query
from scene_core.sources.points import (
    detect_identities,
    match_identities,
    match_nearest,
    match_points,
    nearest_identity,
)

Z = np.array([[1.0, 0.1], [2.0, -0.5], [3.0, 3.1], [4.0, 0.0]])
POINTS = Points(Z, np.array([7, 3, 9, 5]))


def query(h: np.ndarray, identities: list[int], how: str = "search", S: float = 0.01) -> Query:
    n = len(identities)
    labels = tuple(range(10, 10 + n))
    cov, warp = np.broadcast_to(S * np.eye(2), (n, 2, 2)), np.broadcast_to(np.eye(2), (n, 2, 2))
    return Query("s", labels, h, cov, 9.0, tuple(identities), warp, how)  # type: ignore[arg-type]


def same(got: np.ndarray | None, expected: np.ndarray) -> bool:
    return got is not None and np.array_equal(got, expected)


def wrapped(h: np.ndarray, z: np.ndarray) -> np.ndarray:
    nu = z - h
    nu[..., 1] = np.pi - np.mod(np.pi - nu[..., 1], 2 * np.pi)
    return nu


def test_identities_decide_alone() -> None:
    matches = match_identities(POINTS, query(np.zeros((3, 2)), [5, 4, 7]))
    assert [m.label for m in matches] == [10, 11, 12]
    assert same(matches[0].z, Z[3]) and same(matches[2].z, Z[0])
    assert matches[1].z is None and "4" in matches[1].why
    assert matches[0].score == matches[0].threshold == 1.0


def test_an_identity_seen_twice_is_taken_once_and_first() -> None:
    twice = Points(Z[:2], np.array([7, 7]), R=np.stack([np.eye(2), 2 * np.eye(2)]))
    (match,) = match_identities(twice, query(np.zeros((1, 2)), [7]))
    assert same(match.z, Z[0]) and same(match.R, np.eye(2))
    assert len(detect_identities(twice, Occupied(np.zeros((0, 2)), ()), 5)) == 1


def test_without_identities_only_the_gate_can_match() -> None:
    nameless = Points(Z)
    (none,) = match_identities(nameless, query(Z[:1], [7]))
    (found,) = match_points(nameless, query(Z[:1] + 0.05, [7]))
    assert none.z is None and none.why
    assert same(found.z, Z[0])


def test_the_query_says_how() -> None:
    h = Z[[1]]
    (by_name,) = match_points(POINTS, query(h, [5], "identity"))
    (by_place,) = match_points(POINTS, query(h, [5], "search"))
    assert same(by_name.z, Z[3]) and same(by_place.z, Z[1])


def test_the_nearest_in_the_gate_is_given_once_to_the_nearer() -> None:
    h = np.array([[1.1, 0.1], [1.02, 0.1], [8.0, 0.0]])
    near, nearer, nothing = match_nearest(POINTS, query(h, [0, 0, 0]))
    assert same(nearer.z, Z[0])
    assert near.z is None and "nearer to other" in near.why
    assert nothing.z is None and "inside its gate" in nothing.why


def test_the_gate_is_the_ellipse() -> None:
    for offset, inside in ((0.29, True), (0.31, False)):
        (match,) = match_nearest(POINTS, query(Z[:1] + np.array([offset, 0.0]), [7], S=0.01))
        assert (match.z is not None) == inside


def test_angles_are_compared_as_angles() -> None:
    h = np.array([[3.0, -3.1]])
    (plain,) = match_nearest(POINTS, query(h, [9]))
    (angle,) = match_nearest(POINTS, query(h, [9]), wrapped)
    assert plain.z is None
    assert same(angle.z, Z[2])


def test_an_empty_frame_matches_nothing() -> None:
    empty = Points(np.zeros((0, 2)), np.zeros(0, dtype=int))
    for match in (match_identities, match_nearest):
        (none,) = match(empty, query(Z[:1], [7]))
        assert none.z is None and none.why
    assert match_nearest(POINTS, query(np.zeros((0, 2)), [])) == []
    assert detect_identities(empty, Occupied(np.zeros((0, 2)), ()), 3) == []
    assert nearest_identity(empty, np.zeros(2)) is None


def test_new_landmarks_come_by_identity_and_never_twice() -> None:
    found = detect_identities(POINTS, Occupied(np.zeros((0, 2)), (5, 3)), 5)
    assert [d.appearance for d in found] == [7, 9]
    assert [d.appearance for d in detect_identities(POINTS, Occupied(Z, (3,)), 1)] == [5]
    assert detect_identities(POINTS, Occupied(Z, ()), 0) == []


def test_new_landmarks_keep_the_margin_to_the_limits() -> None:
    limits = ((0.0, 4.5), (-3.2, 3.2))
    nothing = Occupied(np.zeros((0, 2)), ())
    assert len(detect_identities(POINTS, nothing, 9, 0.05, limits)) == 4
    found = detect_identities(POINTS, nothing, 9, (0.0, 0.2), limits)
    assert sorted(d.appearance for d in found) == [3, 5, 7]
    found = detect_identities(POINTS, nothing, 9, (1.0, 0.0), limits)
    assert sorted(d.appearance for d in found) == [3, 7, 9]


def test_a_click_takes_the_nearest() -> None:
    detection = nearest_identity(POINTS, np.array([1.8, -0.4]))
    assert detection is not None and detection.appearance == 3
