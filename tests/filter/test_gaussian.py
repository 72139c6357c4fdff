"""Every operation on a block-sparse Gaussian against its dense textbook version."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scene_core.arrays import frozen
from scene_core.filter.gaussian import (
    FilterError,
    Rows,
    Workspace,
    augment,
    convert,
    dense,
    drop,
)
from scene_core.filter.world import Gaussian, Layout

SIZES = {"robot:r": 7, "robot:r:calib": 1, "feature:1": 6, "feature:2": 3, "feature:3": 3}


def random_gauss(rng: np.random.Generator) -> Gaussian:
    layout = Layout.of(SIZES)
    A = rng.standard_normal((layout.size, layout.size + 4))
    return Gaussian(frozen(rng.standard_normal(layout.size)), frozen(A @ A.T / 10), layout)


def random_rows(rng: np.random.Generator, layout: Layout) -> list[Rows]:
    """Two features of size 3 and one of size 6, all seen from the robot."""
    shared = layout["robot:r"].indices
    points = np.array([layout["feature:2"].indices, layout["feature:3"].indices])
    inverse = layout["feature:1"].indices[None]
    return [
        Rows(shared, rng.standard_normal((2, 2, 7)), points, rng.standard_normal((2, 2, 3))),
        Rows(shared, rng.standard_normal((1, 2, 7)), inverse, rng.standard_normal((1, 2, 6))),
    ]


def textbook_update(x, P, H, nu, R):
    """Joseph form: the longest way round, and the most robust."""
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    A = np.eye(len(x)) - K @ H
    return x + K @ nu, A @ P @ A.T + K @ R @ K.T


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_sparse_update_is_the_textbook_update(seed: int) -> None:
    rng = np.random.default_rng(seed)
    g = random_gauss(rng)
    parts = random_rows(rng, g.layout)
    H = dense(parts, g.x.size)
    nu = rng.standard_normal(6)
    Rs = np.array([np.diag(rng.uniform(0.1, 2.0, 2)) for _ in range(3)])
    R = np.zeros((6, 6))
    for i in range(3):
        R[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = Rs[i]
    work = Workspace(g)
    _, d2 = work.update(parts, nu, Rs)
    x, P = textbook_update(g.x, g.P, H, nu, R)
    np.testing.assert_allclose(work.x, x, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(work.P, P, rtol=1e-8, atol=1e-9)
    S_dense = H @ g.P @ H.T + R
    assert d2 == pytest.approx(nu @ np.linalg.solve(S_dense, nu))


def test_dense_places_every_block() -> None:
    rng = np.random.default_rng(1)
    g = random_gauss(rng)
    parts = random_rows(rng, g.layout)
    H = dense(parts, g.x.size)
    expected = np.zeros_like(H)
    at = 0
    for p in parts:
        assert p.own is not None and p.H_own is not None
        for i in range(len(p.H_shared)):
            expected[at : at + 2, p.shared] = p.H_shared[i]
            expected[at : at + 2, p.own[i]] = p.H_own[i]
            at += 2
    np.testing.assert_array_equal(H, expected)


def test_updates_one_by_one_equal_one_stacked_update() -> None:
    """For fixed Jacobians the order and grouping of independent measurements do not matter."""
    rng = np.random.default_rng(2)
    g = random_gauss(rng)
    parts = random_rows(rng, g.layout)
    H = dense(parts, g.x.size)
    z = rng.standard_normal(6)
    R = np.broadcast_to(0.5 * np.eye(2), (3, 2, 2))
    stacked = Workspace(g)
    stacked.update(parts, z - H @ g.x, R)
    single = Workspace(g)
    singles = [
        Rows(p.shared, p.H_shared[i : i + 1], p.own[i : i + 1], p.H_own[i : i + 1])
        for p in parts
        for i in range(len(p.H_shared))
        if p.own is not None and p.H_own is not None
    ]
    for i, rows in enumerate(singles):
        Hi = H[2 * i : 2 * i + 2]
        single.update([rows], z[2 * i : 2 * i + 2] - Hi @ single.x, R[:1])
    np.testing.assert_allclose(single.x, stacked.x, atol=1e-10)
    np.testing.assert_allclose(single.P, stacked.P, atol=1e-10)


def test_covariance_stays_symmetric_over_many_updates() -> None:
    rng = np.random.default_rng(3)
    work = Workspace(random_gauss(rng))
    for _ in range(2000):
        parts = random_rows(rng, work.layout)
        work.update(parts, 0.01 * rng.standard_normal(6), np.broadcast_to(np.eye(2), (3, 2, 2)))
        work.transform(np.arange(7), np.arange(7), np.eye(7), 1e-2 * np.eye(7))
    assert np.abs(work.P - work.P.T).max() < 1e-12
    assert np.linalg.eigvalsh(work.P).min() > 0


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_transform_is_the_dense_prediction(seed: int) -> None:
    """P <- F P F' + Q with F the identity outside the robot's rows."""
    rng = np.random.default_rng(seed)
    g = random_gauss(rng)
    robot, calib = g.layout["robot:r"].indices, g.layout["robot:r:calib"].indices
    source = np.concatenate([robot, calib])
    J = rng.standard_normal((7, 8))
    Q = np.diag(rng.uniform(0, 1, 7))
    F = np.eye(g.x.size)
    F[np.ix_(robot, source)] = J
    Qn = np.zeros_like(F)
    Qn[:7, :7] = Q
    work = Workspace(g)
    work.transform(robot, source, J, Q)
    np.testing.assert_allclose(work.P, F @ g.P @ F.T + Qn, rtol=1e-9, atol=1e-9)


def test_augment_is_the_dense_jacobian_product() -> None:
    rng = np.random.default_rng(4)
    g = random_gauss(rng)
    J_r, J_c = rng.standard_normal((3, 7)), rng.standard_normal((3, 1))
    noise = np.diag([0.1, 0.2, 0.3])
    y = rng.standard_normal(3)
    new = augment(g, "feature:4", y, {"robot:r": J_r, "robot:r:calib": J_c}, noise)
    n = g.x.size
    G = np.zeros((n + 3, n))
    G[:n] = np.eye(n)
    G[n:, :7], G[n:, 7:8] = J_r, J_c
    expected = G @ g.P @ G.T
    expected[n:, n:] += noise
    np.testing.assert_allclose(new.P, expected, atol=1e-12)
    np.testing.assert_array_equal(new.mean("feature:4"), y)


def test_drop_marginalises() -> None:
    rng = np.random.default_rng(5)
    g = random_gauss(rng)
    less = drop(g, ["feature:1", "feature:3"])
    names = ["robot:r", "robot:r:calib", "feature:2"]
    assert [b.name for b in less.layout.blocks] == names
    for a in names:
        np.testing.assert_array_equal(less.mean(a), g.mean(a))
        for b in names:
            np.testing.assert_array_equal(less.cov(a, b), g.cov(a, b))


def test_convert_is_the_dense_jacobian_product_and_leaves_the_rest() -> None:
    rng = np.random.default_rng(6)
    g = random_gauss(rng)
    J = rng.standard_normal((3, 6))
    y = rng.standard_normal(3)
    new = convert(g, "feature:1", y, J)
    np.testing.assert_array_equal(new.mean("feature:1"), y)
    np.testing.assert_allclose(new.cov("feature:1"), J @ g.cov("feature:1") @ J.T, atol=1e-12)
    for other in ("robot:r", "robot:r:calib", "feature:2", "feature:3"):
        np.testing.assert_allclose(
            new.cov("feature:1", other), J @ g.cov("feature:1", other), atol=1e-12
        )
        np.testing.assert_array_equal(new.cov(other), g.cov(other))
    np.testing.assert_array_equal(new.P, new.P.T)


def test_a_sealed_state_can_not_be_written() -> None:
    g = Workspace(random_gauss(np.random.default_rng(7))).seal()
    with pytest.raises(ValueError, match="read-only"):
        g.P[0, 0] = 1.0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0])
def test_an_unhealthy_state_is_refused_with_a_remedy(bad: float) -> None:
    work = Workspace(random_gauss(np.random.default_rng(8)))
    work.P[3, 3] = bad
    with pytest.raises(FilterError, match="undo the last edit"):
        work.seal()
