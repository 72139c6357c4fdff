"""Canonical correlations of blocks of a covariance."""

import numpy as np
import pytest

from scene_core.geometry.correlation import (
    block_correlations,
    correlation,
    largest_canonical_correlations,
    whitening,
)

RNG = np.random.default_rng(3)
BLOCKS = [slice(0, 4), slice(4, 7), slice(7, 10), slice(10, 16), slice(16, 17)]


def covariance(n: int = 17) -> np.ndarray:
    A = RNG.normal(size=(n, n + 4)) * RNG.uniform(0.01, 30.0, n)[:, None]
    return A @ A.T


def best_by_search(P: np.ndarray, a: slice, b: slice) -> float:
    """The definition: the best correlation of one combination of each block, by alternation."""
    q = np.ones(b.stop - b.start)
    for _ in range(3000):
        p = np.linalg.solve(P[a, a], P[a, b] @ q)
        q = np.linalg.solve(P[b, b], P[b, a] @ p)
        q /= np.linalg.norm(q)
    return float(p @ P[a, b] @ q / np.sqrt((p @ P[a, a] @ p) * (q @ P[b, b] @ q)))


def test_is_the_best_correlation_of_any_two_combinations():
    P = covariance()
    got = largest_canonical_correlations(P, BLOCKS[0], BLOCKS[1:])
    want = [best_by_search(P, BLOCKS[0], b) for b in BLOCKS[1:]]
    np.testing.assert_allclose(got, want, atol=1e-6)


def test_scalar_blocks_give_the_plain_correlation():
    P = covariance(5)
    got = largest_canonical_correlations(P, slice(1, 2), [slice(3, 4)])
    assert got[0] == pytest.approx(abs(correlation(P)[1, 3]))


def test_does_not_depend_on_the_coordinates_of_a_block():
    P = covariance()
    T = np.eye(17)
    T[4:7, 4:7] = RNG.normal(size=(3, 3))
    T[10:16, 10:16] = RNG.normal(size=(6, 6)) * 1e3
    moved = T @ P @ T.T
    before = largest_canonical_correlations(P, BLOCKS[1], BLOCKS)
    np.testing.assert_allclose(
        largest_canonical_correlations(moved, BLOCKS[1], BLOCKS), before, atol=1e-6
    )


def test_a_rank_deficient_block_counts_its_own_directions_only():
    """A quaternion block has rank 3 of 4; the missing direction must not add a correlation."""
    A = RNG.normal(size=(6, 8))
    P = A @ A.T
    tall = np.zeros((7, 6))
    tall[:4, :3] = np.linalg.qr(RNG.normal(size=(4, 3)))[0]
    tall[4:, 3:] = np.eye(3)
    deficient = tall @ P @ tall.T
    got = largest_canonical_correlations(deficient, slice(0, 4), [slice(4, 7)])
    want = largest_canonical_correlations(P, slice(0, 3), [slice(3, 6)])
    np.testing.assert_allclose(got, want, atol=1e-7)


def test_independent_and_identical_blocks():
    P = np.zeros((6, 6))
    P[:3, :3] = P[3:, 3:] = covariance(3)
    assert largest_canonical_correlations(P, slice(0, 3), [slice(3, 6)])[0] == 0.0
    P[:3, 3:] = P[3:, :3] = P[:3, :3]
    assert largest_canonical_correlations(P, slice(0, 3), [slice(3, 6)])[0] == pytest.approx(1.0)


def test_a_known_block_has_no_correlation_and_no_nan():
    P = covariance(6)
    P[:3] = P[:, :3] = 0.0
    assert largest_canonical_correlations(P, slice(0, 3), [slice(3, 6)])[0] == 0.0
    assert np.isfinite(correlation(P)).all()


def test_all_pairs_agree_with_one_against_the_rest():
    P = covariance()
    table = block_correlations(P, BLOCKS)
    for i, a in enumerate(BLOCKS):
        np.testing.assert_allclose(
            table[i], largest_canonical_correlations(P, a, BLOCKS), atol=1e-6
        )


def test_whitening_is_batched():
    P = np.stack([covariance(3) for _ in range(5)])
    W = whitening(P)
    np.testing.assert_allclose(
        W @ P @ np.swapaxes(W, 1, 2), np.tile(np.eye(3), (5, 1, 1)), atol=1e-8
    )
