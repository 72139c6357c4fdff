"""Central differences, batched like the functions they stand in for."""

import numpy as np
import pytest

from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import wrap
from scene_core.models.base import completed
from scene_core.models.sensors.wide_angle import WideAngle


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


@pytest.mark.parametrize("kd1", [9e-6, 1e-6, 3e-9, 1e-14, 0.0, -1e-7])
def test_a_distortion_far_below_one_is_differenced_at_its_own_scale(kd1):
    camera = WideAngle(kd1=kd1)
    m = np.array([[0.0, 0.0, 1.0], [0.02, 0.01, 1.0], [0.3, -0.2, 1.0], [0.8, 0.5, 1.0]])
    X, k = np.concatenate([m, np.ones((4, 1))], axis=1), camera.calib0
    told = camera.project(X, k)
    numeric = completed(told._replace(dh_by_dk=None), camera.project, X, k)
    assert numeric.dh_by_dX is told.dh_by_dX and told.dh_by_dk is not None
    close(numeric.dh_by_dk, told.dh_by_dk)
    alone = completed(told._replace(dh_by_dX=None), camera.project, X, k)
    close(alone.dh_by_dX, told.dh_by_dX)
    z = told.h
    back = camera.backproject(z, np.ones((4, 1)), k)
    numeric = completed(back._replace(dX_by_dk=None), camera.backproject, z, np.ones((4, 1)), k)
    close(numeric.dX_by_dk, back.dX_by_dk)


def close(numeric, told):
    """To 1e-6 of the largest that a component of the argument causes, or of 1."""
    size = np.maximum(np.abs(told).max(axis=(0, 1)), 1e-3)
    assert (np.abs(numeric - told) / size).max() < 1e-6


@pytest.mark.parametrize("start", [0.0, 1e-17, 0.3])
def test_a_jump_in_one_row_leaves_the_others_as_they_are(start):
    """A bearing at the seam jumps by a turn whatever the step."""

    def f(x, turn):
        return wrap(x + np.sin(turn))

    x = np.array([[1.0], [np.pi - np.sin(start)], [-0.4]])
    shared = central_differences(f, (x, np.array([start])), 1)
    np.testing.assert_allclose(shared[[0, 2], 0, 0], np.cos(start), atol=1e-9)
    assert abs(shared[1, 0, 0]) > 1e5  # not a slope that could be taken for one
    own = central_differences(f, (x, np.array([start])), 0)
    np.testing.assert_allclose(own[[0, 2], 0, 0], 1.0, atol=1e-9)
