"""Increments in the plane and in space, and rates: one motion told in three ways."""

import numpy as np

from scene_core.geometry.embedding import embed
from scene_core.geometry.spaces import THREE_D, TWO_D
from scene_core.models.motion.body_rates import BodyRates
from scene_core.models.motion.increments_2d import PlanarIncrements
from scene_core.models.motion.odometry_3d import Odometry3D

K = np.zeros(0)


def test_planar_increments_are_the_odometry_of_a_robot_that_stays_in_the_plane():
    flat, space = np.array([1.0, -2.0, 0.0]), THREE_D.identity()
    space[:2] = 1.0, -2.0
    for k in range(40):
        u = np.array([0.2, 0.03 * np.sin(k), 0.3])
        flat = PlanarIncrements().f(flat, u, 0.1, K).fv
        lifted = np.array([u[0], u[1], 0.0, 0.0, 0.0, u[2]])
        space = Odometry3D().f(space, lifted, 0.1, K).fv
    expected = embed(TWO_D.normalise(flat)[0], TWO_D, "z")[0]
    np.testing.assert_allclose(THREE_D.difference(expected, space), 0.0, atol=1e-12)


def test_a_robot_that_stands_still_does_not_spread_more_when_it_turns():
    """By hand: after a quarter turn, noise ahead lies across the world's first axis."""
    model = PlanarIncrements(sd_ahead=0.3, sd_across=0.1, sd_turn=0.0)
    at = model.f(np.array([0.0, 0.0, np.pi / 2]), np.zeros(3), 1.0, K)
    assert at.dfv_by_du is not None
    P = at.dfv_by_du @ model.U(np.zeros(3), 1.0) @ at.dfv_by_du.T
    np.testing.assert_allclose(P, np.diag([0.01, 0.09, 0.0]), atol=1e-15)


def test_rates_held_for_a_while_are_increments():
    xv = THREE_D.normalise(np.array([1.0, 2.0, 3.0, 0.7, -0.1, 0.4, 0.5]))[0]
    rates, dt = np.array([0.4, -0.2, 0.1, 0.3, 0.8, -0.5]), 0.25
    held = BodyRates().f(xv, rates, dt, K)
    moved = Odometry3D().f(xv, rates * dt, dt, K)
    np.testing.assert_allclose(held.fv, moved.fv, atol=1e-15)
    assert held.dfv_by_du is not None and moved.dfv_by_du is not None
    np.testing.assert_allclose(held.dfv_by_du, moved.dfv_by_du * dt, atol=1e-15)


def test_a_full_turn_at_a_constant_rate_comes_back():
    xv, rates = THREE_D.identity(), np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.pi])
    for _ in range(20):
        xv = BodyRates().f(xv, rates, 0.1, K).fv
    np.testing.assert_allclose(THREE_D.difference(xv, THREE_D.identity()), 0.0, atol=1e-12)
