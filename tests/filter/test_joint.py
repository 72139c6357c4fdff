"""The joint gate against its definition: the innovation of one match given all the others."""

from __future__ import annotations

import numpy as np

from scene_core.filter.joint import disagreements, odd_ones


def frame(
    rng: np.random.Generator, k: int = 6, shared: float = 30.0
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations of k matches that share a pose error: S = H P H' + R with R = I."""
    H = rng.standard_normal((2 * k, 6))
    S = shared * H @ H.T + np.eye(2 * k)
    return (np.linalg.cholesky(S) @ rng.standard_normal(2 * k)).reshape(k, 2), S


def test_the_distance_is_that_of_the_conditional_gaussian() -> None:
    rng = np.random.default_rng(0)
    nu, S = frame(rng)
    d2 = disagreements(nu, S)
    for i in range(len(nu)):
        own = np.array([2 * i, 2 * i + 1])
        rest = np.setdiff1d(np.arange(2 * len(nu)), own)
        gain = S[np.ix_(own, rest)] @ np.linalg.inv(S[np.ix_(rest, rest)])
        e = nu[i] - gain @ nu.ravel()[rest]
        C = S[np.ix_(own, own)] - gain @ S[np.ix_(rest, own)]
        assert np.isclose(d2[i], e @ np.linalg.solve(C, e))


def test_it_is_chi_square_distributed_when_all_matches_are_right() -> None:
    rng = np.random.default_rng(1)
    d2 = np.concatenate([disagreements(*frame(rng)) for _ in range(400)])
    assert abs(d2.mean() - 2.0) < 0.15
    assert abs((d2 > 9.21).mean() - 0.01) < 0.006


def test_a_match_that_slid_is_found_though_it_passes_its_own_gate() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        nu, S = frame(rng, k=8, shared=100.0)
        nu[3] += 8.0 * np.sign(nu[3])
        own = nu[3] @ np.linalg.solve(S[6:8, 6:8], nu[3])
        assert [i for i, _ in odd_ones(nu, S, gate=16.0)] == [3]
        assert own < 16.0


def test_two_matches_can_not_outvote_each_other() -> None:
    nu = np.array([[0.0, 0.0], [50.0, 50.0]])
    assert odd_ones(nu, np.eye(4), gate=9.21) == []
