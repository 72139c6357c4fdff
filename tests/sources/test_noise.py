"""A stream of noise is a function of seed, purpose and frame, and of nothing else."""

from __future__ import annotations

import numpy as np

from scene_core.sources import noise


def draw(seed: int, stream: str | int, frame: int) -> np.ndarray:
    return noise.rng(seed, stream, frame).standard_normal(2000)


def test_same_key_same_numbers_in_any_order() -> None:
    first = [draw(3, "image:left", k) for k in range(4)]
    again = [draw(3, "image:left", k) for k in reversed(range(4))]
    for a, b in zip(first, reversed(again), strict=True):
        np.testing.assert_array_equal(a, b)


def test_every_part_of_the_key_counts() -> None:
    streams = [draw(3, "a", 1), draw(4, "a", 1), draw(3, "b", 1), draw(3, "a", 2), draw(-3, "a", 1)]
    for i, a in enumerate(streams):
        for b in streams[:i]:
            assert abs(np.corrcoef(a, b)[0, 1]) < 0.1


def test_long_draws_do_not_run_into_the_next_frame() -> None:
    long = noise.rng(1, "a", 0).standard_normal(200_000)
    after = noise.rng(1, "a", 1).standard_normal(8)
    assert not np.isin(after, long).any()


def test_named_streams_are_the_same_on_every_machine() -> None:
    assert noise.rng(7, "measurements:camera", 5).integers(1 << 32) == 1534777276
