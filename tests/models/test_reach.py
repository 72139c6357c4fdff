"""An arm of any joints brings its hand to every place in its reach, and close to any other."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from scene_core.arrays import Vec
from scene_core.geometry.numdiff import central_differences
from scene_core.models import reach
from scene_core.models.motion.arm import Arm

DT = 0.2
ARMS = {
    "one joint": Arm(("z",), (0.5,), (1.0,), (0.3,)),
    "two joints in a plane": Arm(("z", "z"), (0.4, 0.25), (1.2, 0.9), (0.2, -0.4)),
    "two joints": Arm(("z", "y"), (0.1, 0.5), (1.0, 1.0), (0.0, 0.4)),
    "three joints": Arm(),
    "three joints, the last rolls": Arm(("z", "y", "x"), (0.1, 0.4, 0.2), (1.0,) * 3, (0.1,) * 3),
    "four joints": Arm(("z", "y", "y", "y"), (0.1, 0.4, 0.3, 0.1), (1.0,) * 4, (0.0, -1, 1, 0.5)),
    "four, all about others": Arm(("z", "y", "x", "z"), (0.2,) * 4, (0.8,) * 4, (0.3,) * 4),
}
FOOT = np.array([1.0, -2.0, 0.5, 0.8, 0.0, 0.6, 0.0])
GOALS = ("behind", "folded", "near", "at the limit", "at the foot's nearest", "anywhere")
each_arm = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)


def at(arm: Arm, q: Vec) -> Vec:
    """The state with these angles, on a foot that stands askew."""
    return np.concatenate([FOOT, q])


def place(arm: Arm, q: np.ndarray) -> Vec:
    """Where the hand is then, in the world."""
    return arm.xp(at(arm, q)).xp[:3]


def goals(arm: Arm, kind: str) -> list[tuple[Vec, Vec]]:
    """Angles to start from, and a place that angles reach."""
    rng, n = np.random.default_rng(3), arm.joints
    first, rest = np.eye(n, dtype=float)[0], np.array(arm.rest_angles)
    straight, folded = np.zeros(n), np.array([*np.zeros(n - 1), np.pi])
    match kind:
        case "behind":
            return [(q, place(arm, q + np.pi * first)) for q in (rest, straight)]
        case "folded":
            return [(straight, place(arm, folded)), (folded, place(arm, straight))]
        case "near":
            return [(rest, place(arm, rest + d * first)) for d in (1e-3, -0.1)]
        case "at the limit":
            return [(rest, place(arm, a * first)) for a in (0.0, 1.5, -3.0)]
        case "at the foot's nearest":
            return [(q, place(arm, np.pi * (np.arange(n) % 2))) for q in (rest, straight)]
        case _:
            pairs = rng.uniform(-np.pi, np.pi, (6, 2, n))
            return [(start, place(arm, end)) for start, end in pairs]


@each_arm
@pytest.mark.parametrize("kind", GOALS)
def test_navigate_comes_to_every_goal_within_reach(arm: Arm, kind: str) -> None:
    for start, goal in goals(arm, kind):
        xv = at(arm, start)
        for _ in range(75):
            u = arm.navigate(xv, goal, DT)
            if u is None:
                break
            assert np.abs(u * arm.calib0).max() <= arm.max_rate + 1e-12
            xv = arm.normalise(arm.f(xv, u, DT, arm.calib0).fv).value
        assert np.linalg.norm(arm.xp(xv).xp[:3] - goal) <= arm.arrive


@each_arm
@pytest.mark.parametrize("away", [[3.0, 1.0, 2.0], [-0.6, 0.9, -0.3], [0.0, 0.0, -9.0]])
def test_a_goal_out_of_reach_is_approached_to_the_nearest_place(
    arm: Arm, away: list[float]
) -> None:
    """Nearest of all places on a grid of angles; there it stays, without saying it has arrived."""
    goal, xv = FOOT[:3] + away, at(arm, np.array(arm.rest_angles))
    for _ in range(50):
        u = arm.navigate(xv, goal, DT)
        assert u is not None
        xv = arm.f(xv, u, DT, arm.calib0).fv
    u = arm.navigate(xv, goal, DT)
    assert u is not None and np.abs(u).max() < 0.02
    steps = {1: 2000, 2: 150, 3: 36, 4: 20}[arm.joints]
    grid = np.linspace(-np.pi, np.pi, steps, endpoint=False)
    angles = np.array(list(itertools.product(grid, repeat=arm.joints)))
    from_foot = arm.space.to_local(FOOT, np.append(goal, 1.0)).X[:3]
    p, _ = reach.hand(arm.axes, arm.lengths, angles)
    least = np.linalg.norm(p - from_foot, axis=1).min()
    assert np.linalg.norm(arm.xp(xv).xp[:3] - goal) <= least + arm.arrive


@each_arm
def test_the_hand_is_where_the_position_state_says(arm: Arm) -> None:
    q = np.random.default_rng(1).uniform(-3.0, 3.0, (5, arm.joints))
    p, J = reach.hand(arm.axes, arm.lengths, q)
    rest = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    for pi, qi in zip(p, q, strict=True):
        np.testing.assert_allclose(pi, arm.xp(np.concatenate([rest, qi])).xp[:3], atol=1e-12)
    numeric = central_differences(lambda q: reach.hand(arm.axes, arm.lengths, q)[0], (q,), 0)
    np.testing.assert_allclose(J, numeric, atol=1e-8)


def test_a_goal_behind_was_out_of_reach_for_least_squares_alone() -> None:
    """What the many starts are for: the straight arm has no slope towards what is behind it."""
    arm, q = Arm(), np.zeros(3)
    behind, _ = reach.hand(arm.axes, arm.lengths, np.array([np.pi, 0.0, 0.9]))
    assert np.inf == reach.straight(arm.axes, arm.lengths, q, behind * [1, 0, 1], arm.arrive)
    assert reach.nearest(arm.axes, arm.lengths, behind, 0.01)[1] < 1e-3


def test_the_same_state_and_goal_give_the_same_rates() -> None:
    arm, goal = Arm(), np.array([-0.2, 0.1, 0.1])
    xv = at(arm, np.zeros(3))
    first = arm.navigate(xv, goal, DT)
    reach._nearest.cache_clear()
    second = arm.navigate(xv, goal, DT)
    assert first is not None and second is not None and np.array_equal(first, second)
