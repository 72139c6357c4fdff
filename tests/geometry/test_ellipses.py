"""Gates, ellipses and consistency statistics."""

import numpy as np
import pytest

from scene_core.geometry import quaternion
from scene_core.geometry.ellipses import (
    chi2_band,
    chi2_gate,
    d2,
    ellipse_points,
    ellipsoids,
    nees,
    roots,
    sigma,
)


def covariances(rng: np.random.Generator, count: int, d: int) -> np.ndarray:
    A = rng.standard_normal((count, d, d))
    return A @ np.swapaxes(A, -1, -2) + 0.1 * np.eye(d)


@pytest.mark.parametrize(("dim", "expected"), [(1, 1.960), (2, 2.448), (3, 2.795)])
def test_half_widths_of_95_percent(dim, expected):
    # gtsam's table of sigma against percent.
    assert sigma(dim, 0.95) == pytest.approx(expected, abs=5e-4)


def test_the_toolboxs_gate_of_nine_is_989_per_mille():
    assert chi2_gate(2, 0.98889) == pytest.approx(9.0, abs=1e-3)


def test_bands_of_the_reference():
    # 95 % of the mean of 5 and of 25 runs of 6 degrees of freedom, as the toolbox's figures state.
    assert chi2_band(6, 5) == pytest.approx((3.36, 9.40), abs=0.01)
    assert chi2_band(6, 25) == pytest.approx((4.72, 7.43), abs=0.01)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_d2_is_the_textbooks(d, rng):
    S, nu = covariances(rng, 7, d), rng.standard_normal((7, d))
    expected = [n @ np.linalg.inv(s) @ n for n, s in zip(nu, S, strict=True)]
    np.testing.assert_allclose(d2(nu, S), expected, rtol=1e-9)
    np.testing.assert_allclose(d2(nu[0], S[0]), expected[0], rtol=1e-9)


def test_nees_survives_very_different_units(rng):
    P = covariances(rng, 1, 6)[0]
    units = np.diag([1e6, 1.0, 1e-6, 1e3, 1e-3, 1.0])
    e = rng.standard_normal(6)
    expected = e @ np.linalg.inv(P) @ e
    assert nees(units @ e, units @ P @ units) == pytest.approx(expected, rel=1e-9)


def test_nees_of_something_known_exactly_is_not_a_number():
    assert np.isnan(nees(np.zeros(2), np.zeros((2, 2))))
    assert np.isnan(nees(np.zeros(2), np.diag([1.0, 0.0])))
    assert np.isnan(nees(np.zeros(2), np.array([[1.0, 2.0], [2.0, 1.0]])))
    nearly = 1.0 - 1e-8
    assert np.isnan(nees(np.zeros(2), np.array([[1.0, nearly], [nearly, 1.0]])))


@pytest.mark.parametrize("d", [1, 2, 3])
def test_roots_of_definite_and_flat_covariances(d, rng):
    P = covariances(rng, 5, d)
    P[1] = 0.0
    P[2] = np.outer(np.arange(d), np.arange(d))
    L = roots(P)
    np.testing.assert_allclose(L @ np.swapaxes(L, -1, -2), P, atol=1e-12)


def test_ellipsoids_rebuild_the_covariance(rng):
    P = np.concatenate([covariances(rng, 20, 3), np.zeros((1, 3, 3))])
    scales, wxyz = ellipsoids(P)
    R = quaternion.matrix(wxyz)
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    rebuilt = R * scales[:, None, :] ** 2 @ np.swapaxes(R, -1, -2)
    np.testing.assert_allclose(rebuilt, P, atol=1e-12)


def test_contours_lie_at_their_half_width(rng):
    P, mean = covariances(rng, 3, 2), rng.standard_normal((3, 2))
    points = ellipse_points(mean, P, 2.5, 16)
    assert points.shape == (3, 16, 2)
    for i in range(3):
        np.testing.assert_allclose(d2(points[i] - mean[i], np.tile(P[i], (16, 1, 1))), 2.5**2)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("variance", [0.0, -1e-18])
def test_nees_of_what_is_known_exactly_is_nan_without_a_warning(variance: float) -> None:
    assert np.isnan(nees(np.array([0.1, 0.0]), np.diag([1.0, variance])))
