"""Segments in a camera: their visible parts reproject inside the image, and no more is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scene_core.filter.policies import Vision
from scene_core.filter.ports import Frame, Occupied, Points, Query
from scene_core.geometry import quaternion
from scene_core.models.base import Sensor
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.sensors.depth_camera import DepthCamera
from scene_core.models.sensors.omnidirectional import Omnidirectional
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.models.sensors.wide_angle import WideAngle
from scene_core.sources.buildings import House
from scene_core.sources.drivers import ConstantControls
from scene_core.sources.scattered import RandomWorld
from scene_core.sources.segments import LineOutlook, clipped, lengths, measures_lines
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import Disturbances, TrueMount, TrueRobot
from scene_core.sources.worlds import ThickCloister, lines

PINHOLE = Pinhole(width=640, height=480, u0=320.0, v0=240.0, f_u=320.0, f_v=320.0)
DISTORTED = replace(PINHOLE, distortion=(-0.3, 0.1))
CAMERAS = [PINHOLE, DISTORTED, WideAngle(), Omnidirectional()]
SIDEWAYS = (0.0, 0.0, 0.6, np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0)
"""A camera that looks to the left on a robot with x forward, z up."""
CROWD = RandomWorld(count=0, count_segments=60, length=8.0, height=3.0)
CIRCLE = ConstantControls({"dx": 0.08, "az": np.radians(0.9)})


def outlook(sensor: Sensor, pose: np.ndarray, shortest: float = 20.0) -> LineOutlook:
    return LineOutlook(CROWD, "z", sensor, sensor.calib0, pose, shortest)


def house(**changes: object) -> Simulation:
    robot = TrueRobot(Odometry3D(), CIRCLE, {"y": -5.0}, noise_on="controls")
    mount = TrueMount(DISTORTED, "r", SIDEWAYS)
    return replace(Simulation(House(), {"r": robot}, {"c": mount}), **changes)


def frames_of(simulation: Simulation, count: int) -> list[Frame]:
    state, out = simulation.start(), []
    for k in range(count):
        frame, state = simulation.advance(state, k)
        out.append(frame)
    return out


def lines_of(frame: Frame) -> Points:
    raw = frame.raw["c"]
    assert isinstance(raw, Points) and raw.lines is not None and raw.lines.ids is not None
    return raw.lines


def turned_to(at: np.ndarray, turn: np.ndarray) -> np.ndarray:
    return np.concatenate([at, quaternion.from_rotation_vector(turn)[0]])


POSES = st.tuples(
    *[st.floats(-4.0, 4.0, allow_subnormal=False)] * 3, *[st.floats(-3.0, 3.0)] * 3
).map(lambda v: turned_to(np.array(v[:3]), np.array(v[3:])))


@pytest.mark.parametrize("sensor", CAMERAS, ids=lambda s: s.name)
@given(POSES)
@settings(max_examples=25, deadline=None)
def test_visible_parts_lie_on_their_segments_and_inside_the_image(
    sensor: Sensor, pose: np.ndarray
) -> None:
    seen = outlook(sensor, pose)
    rows, X_S, h = seen.parts
    low, high = np.tile(np.array(sensor.limits).T, 2)
    assert ((h >= low) & (h <= high)).all() and (lengths(h) >= 20.0).all()
    assert len(set(rows.tolist())) == len(rows)
    # Back in the world: between the true ends, in their order.
    X_W = sensor.space.to_world(pose, X_S.reshape(-1, 4)).X
    at = (X_W[:, :3] / X_W[:, 3:]).reshape(-1, 2, 3)
    ends = lines(CROWD).ends[rows]
    way = ends[:, 1] - ends[:, 0]
    t = np.einsum("kej,kj->ke", at - ends[:, :1], way) / (way**2).sum(1)[:, None]
    assert (t >= -1e-9).all() and (t <= 1.0 + 1e-9).all() and (t[:, 0] < t[:, 1]).all()
    np.testing.assert_allclose(ends[:, :1] + t[..., None] * way[:, None], at, atol=1e-9)


@pytest.mark.parametrize("sensor", [PINHOLE, WideAngle()], ids=lambda s: s.name)
def test_nothing_visible_is_left_out_at_the_ends(sensor: Sensor) -> None:
    """Just beyond the visible part lies the end of the segment, or what can not be measured."""
    rng = np.random.default_rng(2)
    checked = 0
    for _ in range(20):
        pose = turned_to(rng.uniform(-4, 4, 3), rng.uniform(-2, 2, 3))
        seen = outlook(sensor, pose)
        rows, X_S, _ = seen.parts
        X_W = sensor.space.to_world(pose, X_S.reshape(-1, 4)).X[:, :3].reshape(-1, 2, 3)
        ends = lines(CROWD).ends[rows]
        way = ends[:, 1] - ends[:, 0]
        t = np.einsum("kej,kj->ke", X_W - ends[:, :1], way) / (way**2).sum(1)[:, None]
        beyond = t + 1e-6 * np.array([-1.0, 1.0])
        cut = (beyond > 0.0) & (beyond < 1.0)
        visible = seen._visible(rows[:, None], np.clip(beyond, 0.0, 1.0))
        assert not (visible & cut).any()
        assert ((np.abs(t) < 1e-9) | (np.abs(t - 1) < 1e-9) | cut)[~cut].all()
        checked += int(cut.sum())
    assert checked > 50


def test_a_segment_through_the_camera_plane_shows_what_is_in_front() -> None:
    seen = LineOutlook(House(), "z", PINHOLE, PINHOLE.calib0, np.zeros(7), 0.0)
    pose = np.array([0.0, 0.0, 1.0, 0.5, -0.5, 0.5, -0.5])
    seen = replace(seen, pose=pose)
    assert len(seen.parts.rows) >= 5
    assert (seen.parts.X_S[..., 2] > 0.0).all()
    # The floor along the wall beside the camera begins behind it and is cut at the border.
    beside = int(np.flatnonzero(seen.parts.rows == 4)[0])
    u = seen.parts.h[beside].reshape(2, 2)
    assert np.isclose(np.abs(u - [320.0, 240.0]), [320.0, 240.0], atol=1e-3).any()


def test_only_cameras_look_for_segments() -> None:
    assert all(measures_lines(sensor) for sensor in CAMERAS)
    assert not measures_lines(RangeBearing()) and not measures_lines(DepthCamera())
    (raw,) = frames_of(house(world=ThickCloister()), 1)[0].raw.values()
    assert isinstance(raw, Points) and raw.lines is None


def test_ends_scatter_with_the_sensors_noise() -> None:
    still = {"r": TrueRobot(Odometry3D(), ConstantControls(), {"y": -5.0}, noise_on="controls")}
    simulation = house(robots=still, world=House(y=0.0))
    truth = simulation.line_outlook("c", simulation.start().xv)
    h = dict(zip(truth.ids[truth.parts.rows].tolist(), truth.parts.h, strict=True))
    low, high = np.array([10.0] * 4), np.array([630.0, 470.0] * 2)
    inner = {i for i, at in h.items() if (at > low).all() and (at < high).all()}
    assert len(inner) >= 5
    nu = []
    for frame in frames_of(simulation, 200):
        seen = lines_of(frame)
        assert seen.ids is not None
        nu += [z - h[i] for i, z in zip(seen.ids.tolist(), seen.z, strict=True) if i in inner]
    off = np.array(nu)
    assert np.abs(off.mean(0)).max() < 4 / np.sqrt(len(off))
    np.testing.assert_allclose(np.cov(off.T), DISTORTED.sd_px**2 * np.eye(4), atol=0.12)


def test_equal_seeds_give_equal_segments_whatever_else_is_measured() -> None:
    a, b, c = (frames_of(house(seed=s), 4) for s in (3, 3, 4))
    for one, same, other in zip(a, b, c, strict=True):
        np.testing.assert_array_equal(lines_of(one).z, lines_of(same).z)
        assert not np.array_equal(lines_of(one).z, lines_of(other).z)


def test_no_end_lies_outside_the_image_and_identities_are_those_of_the_house() -> None:
    found: set[int] = set()
    for frame in frames_of(house(), 120):
        seen = lines_of(frame)
        assert ((seen.z >= 0.0) & (seen.z <= [640.0, 480.0] * 2)).all()
        assert seen.ids is not None and len(set(seen.ids.tolist())) == len(seen.ids)
        found |= set(seen.ids.tolist())
    assert found and found <= set(range(1, 24))


@given(st.lists(st.tuples(*[st.floats(-200.0, 800.0)] * 4), min_size=1, max_size=8).map(np.array))
@settings(max_examples=200, deadline=None)
def test_clipping_keeps_the_straight_line(z: np.ndarray) -> None:
    limits = np.array([(0.0, 640.0), (0.0, 480.0)])
    cut, there = clipped(z, limits)
    assert ((cut[there] >= 0.0) & (cut[there] <= [640.0, 480.0] * 2)).all()
    first, way = z[there, :2], z[there, 2:] - z[there, :2]
    for end in (cut[there, :2], cut[there, 2:]):
        off = (end - first)[:, 0] * way[:, 1] - (end - first)[:, 1] * way[:, 0]
        assert (np.abs(off) <= 1e-6 * (1.0 + np.linalg.norm(way, axis=1))).all()
    inside = ((z >= 0.0) & (z <= [640.0, 480.0] * 2)).all(axis=1) & (lengths(z) > 0.0)
    assert there[inside].all()
    np.testing.assert_array_equal(cut[inside], z[inside])
    # What is dropped has no place in the image.
    t = np.linspace(0.0, 1.0, 101)[:, None, None]
    places = z[None, :, :2] + t * (z[:, 2:] - z[:, :2])
    strictly = ((places > 0.0) & (places < [640.0, 480.0])).all(-1).any(0)
    assert not (strictly & ~there & (lengths(z) > 0.0)).any()


def test_missing_and_wrong_segments_come_in_the_fractions_asked_for() -> None:
    clean = [lines_of(f) for f in frames_of(house(), 150)]
    missing = [lines_of(f) for f in frames_of(house(disturbances=Disturbances(misses=0.3)), 150)]
    seen, left = (sum(len(raw.z) for raw in all_of) for all_of in (clean, missing))
    assert left / seen == pytest.approx(0.7, abs=0.06)
    wrong = Disturbances(outliers=0.2, outlier_sigma=40.0)
    off = count = 0
    for a, b in zip(clean, map(lines_of, frames_of(house(disturbances=wrong), 150)), strict=True):
        assert a.ids is not None and b.ids is not None
        both = np.intersect1d(a.ids, b.ids)
        d = np.abs(a.z[np.isin(a.ids, both)] - b.z[np.isin(b.ids, both)]).max(axis=1)
        off, count = off + int((d > 5.0).sum()), count + len(both)
    assert off / count == pytest.approx(0.2, abs=0.05)


def asked(identities: list[int]) -> Query:
    n = len(identities)
    S = np.tile(np.eye(4), (n, 1, 1))
    return Query(
        "c", tuple(range(n)), np.zeros((n, 4)), S, 9.0, tuple(identities), S, "search", "segment"
    )


def test_segments_are_found_by_identity_and_know_where_they_really_are() -> None:
    simulation = house()
    frame = frames_of(simulation, 60)[-1]
    seen = lines_of(frame)
    assert seen.ids is not None and len(seen.ids) > 2
    matches = simulation.search(frame, asked([*seen.ids.tolist(), 99]), Vision())
    for match, z in zip(matches, seen.z, strict=False):
        assert match.z is not None and match.true_z is not None
        np.testing.assert_array_equal(match.z, z)
        assert match.true_z.shape == (4,)
        assert np.abs(match.z - match.true_z).max() < 6.0
    assert matches[-1].z is None and "99" in matches[-1].why
    empty = house(world=ThickCloister())
    (none,) = empty.search(frames_of(empty, 1)[0], asked([1]), Vision())
    assert none.z is None and none.why


def test_new_segments_are_long_enough_and_not_offered_twice() -> None:
    simulation = house(mounts={"c": TrueMount(DISTORTED, "r", SIDEWAYS, shortest=60.0)})
    frame = frames_of(simulation, 60)[-1]
    nothing = Occupied(np.zeros((0, 4)), (), "segment")
    first = simulation.detect(frame, "c", nothing, 2, Vision())
    known = tuple(d.appearance for d in first)
    more = simulation.detect(frame, "c", replace(nothing, appearances=known), 23, Vision())
    assert len(first) == 2 and more and not {d.appearance for d in more} & set(known)
    for d in (*first, *more):
        assert d.shape == "segment" and lengths(d.z) >= 60.0
    points = simulation.detect(frame, "c", Occupied(np.zeros((0, 2)), ()), 5, Vision())
    assert points == []


def test_truth_has_the_segments() -> None:
    truth = frames_of(house(), 1)[0].truth
    assert truth is not None
    np.testing.assert_array_equal(truth.segments, House().segments())
    assert truth.segment_ids.tolist() == list(range(1, 24))
