"""Keyed noise: a random stream is a function of what it is for, never of when it is asked."""

from __future__ import annotations

import hashlib

import numpy as np

_MASK = (1 << 64) - 1


def rng(seed: int, stream: str | int, frame: int = 0) -> np.random.Generator:
    """The generator of one stream in one frame.

    Philox(key = [seed, stream], counter = [0, 0, 0, frame]): repeating a frame, stepping back or
    comparing two models sees identical noise, and no stream depends on how much another one used.
    A named stream is keyed by the first 64 bits of its BLAKE2b digest, the same on every machine.
    """
    key = np.array([seed & _MASK, _number(stream)], dtype=np.uint64)
    counter = np.array([0, 0, 0, frame & _MASK], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(key=key, counter=counter))


def _number(stream: str | int) -> int:
    if isinstance(stream, int):
        return stream & _MASK
    return int.from_bytes(hashlib.blake2b(stream.encode(), digest_size=8).digest(), "little")
