"""A fixed stream of random numbers; laws are tried at the same examples each time."""

import numpy as np
import pytest
from hypothesis import settings

# No deadline: a busy machine is not a broken law.
settings.register_profile("steady", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("steady")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)
