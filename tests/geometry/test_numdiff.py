"""Central differences, batched like the functions they stand in for."""

import numpy as np

from scene_core.geometry.numdiff import central_differences


def test_a_batch_and_an_argument_shared_by_the_batch(rng):
    x, k = rng.standard_normal((4, 3)), rng.standard_normal(2)

    def f(x, k):
        return np.stack([x[..., 0] * x[..., 1] * k[0], np.sin(x[..., 2]) + k[1] ** 2], axis=-1)

    by_x = np.zeros((4, 2, 3))
    by_x[:, 0, 0], by_x[:, 0, 1], by_x[:, 1, 2] = x[:, 1] * k[0], x[:, 0] * k[0], np.cos(x[:, 2])
    np.testing.assert_allclose(central_differences(f, (x, k), 0), by_x, atol=1e-9)
    by_k = np.zeros((4, 2, 2))
    by_k[:, 0, 0], by_k[:, 1, 1] = x[:, 0] * x[:, 1], 2 * k[1]
    np.testing.assert_allclose(central_differences(f, (x, k), 1), by_k, atol=1e-9)


def test_no_argument_has_no_columns(rng):
    J = central_differences(lambda x, u: x, (rng.standard_normal(3), np.zeros(0)), 1)
    assert J.shape == (3, 0)
