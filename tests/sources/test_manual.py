"""Driving by hand: every motion model goes where the sliders say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene_core.geometry import quaternion
from scene_core.geometry.spaces import ONE_D, THREE_D, TWO_D
from scene_core.models.base import MotionModel
from scene_core.models.motion.inertial import Inertial
from scene_core.models.registry import models
from scene_core.sources.manual import AXES, Manual

DT = 0.05
MODELS = [cls() for cls in models("motion").values()]
ASKED = Manual(forward=0.4, turn=0.3, response=0.1)


def driven(motion: MotionModel, driver: Manual, frames: int) -> np.ndarray:
    xv = np.array([1.0 if s.endswith("qw") else 0.0 for s in motion.state_labels])
    for k in range(1, frames + 1):
        drive = driver.drive(motion, xv, None, k, DT, 0)
        at = xv if drive.push is None else xv + drive.push
        xv = motion.normalise(motion.f(at, drive.u, DT, motion.calib0).fv).value
    return xv


@pytest.mark.parametrize("motion", MODELS, ids=lambda m: m.name)
def test_a_robot_nobody_drives_stays(motion: MotionModel) -> None:
    start = np.array([1.0 if s.endswith("qw") else 0.0 for s in motion.state_labels])
    np.testing.assert_allclose(driven(motion, Manual(), 40), start, atol=1e-9)


DRIVEN = [m for m in MODELS if m.name != "arm"]


@pytest.mark.parametrize("motion", DRIVEN, ids=lambda m: m.name)
def test_it_drives_ahead_and_turns_left(motion: MotionModel) -> None:
    """After t seconds a robot that turns by w t has come v t (sin(w t) / w t) ahead of it."""
    scene = motion.name == "nomad on terrain"
    driver = replace(ASKED, axes=tuple(AXES)[1 if scene else 0])
    ahead = motion.space.position(motion.xp(driven(motion, replace(driver, turn=0.0), 40)).xp)
    assert ahead[2 if scene else 0] == pytest.approx(0.8, abs=0.1)
    np.testing.assert_allclose(np.delete(ahead, 2 if scene else 0), 0.0, atol=1e-6)
    if motion.space is ONE_D:
        return
    xp = motion.xp(driven(motion, driver, 40)).xp
    heading = xp[2] if motion.space is TWO_D else quaternion.to_rotation_vector(xp[3:])[0]
    if motion.name == "planar ackermann":
        # Its front wheels turn; how fast it turns is the road's affair.
        assert heading > 0.05
        return
    up = {TWO_D: None, THREE_D: 1 if scene else 2}[motion.space]
    turned = heading if up is None else heading[up]
    assert turned == pytest.approx(0.6, abs=0.08)
    place = motion.space.position(xp)
    assert place[0 if scene else 1] > 0.1


@pytest.mark.parametrize("axes", AXES)
def test_up_left_and_nose_are_those_of_the_robot(axes: str) -> None:
    motion = next(m for m in MODELS if m.name == "6-DoF odometry")
    rows = {"x forward, y left, z up": (0, 1, 2), "z forward, x left, y up": (2, 0, 1)}
    F, L, U = np.eye(3)[list(rows.get(axes, (2, 0, 1)))]
    if axes not in rows:
        L, U = -L, -U
    hand = Manual(axes=axes)
    for field, way in (("forward", F), ("left", L), ("up", U)):
        at = driven(motion, replace(hand, **{field: 1.0}), 1)
        np.testing.assert_allclose(at[:3], way * DT, atol=1e-12)
    for field, before, after in (("turn", F, L), ("pitch", F, U), ("roll", U, -L)):
        q = driven(motion, replace(hand, **{field: 1.0}), 1)[3:]
        moved = quaternion.rotate(q, before).v
        np.testing.assert_allclose(moved, np.cos(DT) * before + np.sin(DT) * after, atol=1e-12)
    np.testing.assert_allclose(np.cross(F, L), U)


def test_a_turret_looks_where_it_is_told_to() -> None:
    motion = next(m for m in MODELS if m.name == "planar nomad")
    labels = motion.state_labels
    xv = driven(motion, Manual(look=0.5, turn=0.2), 20)
    assert xv[labels.index("S")] == pytest.approx(0.2)
    assert xv[labels.index("T")] == pytest.approx(0.7)


def test_a_body_with_accelerometers_hovers_and_keeps_its_speed() -> None:
    """Its controls make up for gravity, however it is tilted."""
    motion = Inertial()
    driver = replace(ASKED, turn=0.0, pitch=0.4)
    xv = driven(motion, driver, 60)
    v = xv[[motion.state_labels.index(s) for s in ("vx", "vy", "vz")]]
    body = quaternion.rotate_back(xv[3:7], v).v
    np.testing.assert_allclose(body, [0.4, 0.0, 0.0], atol=0.03)


def test_both_robots_of_a_pair_do_the_same() -> None:
    motion = next(m for m in MODELS if m.name == "double")
    drive = ASKED.drive(motion, np.zeros(motion.state_size), None, 1, DT, 0)
    n = len(drive.u) // 2
    np.testing.assert_array_equal(drive.u[:n], drive.u[n:])
    assert drive.u[0] == 0.4


def test_the_joints_of_an_arm_take_the_turn_rates_in_their_order() -> None:
    motion = next(m for m in MODELS if m.name == "arm")
    xv = np.array([1.0 if s.endswith("qw") else 0.0 for s in motion.state_labels])
    u = Manual(turn=0.1, pitch=0.2, roll=0.3, look=0.4).drive(motion, xv, None, 1, DT, 0).u
    np.testing.assert_array_equal(u[:4], [0.1, 0.2, 0.3, 0.4][: len(u)])
    assert (u[4:] == 0.0).all()
