"""The simulation: repeatable to the bit, as noisy as it says, and honest about the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scene_core.filter.policies import Vision
from scene_core.filter.ports import Occupied, Points, Query, Source, SourceError
from scene_core.models.internal.gyro import Gyro
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.sources.drivers import ConstantControls, Waypoints
from scene_core.sources.handheld import HandHeld
from scene_core.sources.render import Rendering
from scene_core.sources.simulated import Simulation, TrueInstrument, TrueMount, TrueRobot
from scene_core.sources.truth import Disturbances
from scene_core.sources.worlds import Field, ThickCloister

CAMERA = Pinhole(width=640, height=480, u0=320.0, v0=240.0, f_u=320.0, f_v=320.0, max_angle=0.0)
POSE = (0.0, 0.0, 0.6, 0.5, -0.5, 0.5, -0.5)
CIRCLE = ConstantControls({"dx": 0.08, "az": np.radians(0.9)})


def cloister(**changes: object) -> Simulation:
    robot = TrueRobot(Odometry3D(), CIRCLE, {"y": -5.0}, noise_on="controls")
    simulation = Simulation(ThickCloister(), {"r": robot}, {"c": TrueMount(CAMERA, "r", POSE)})
    return replace(simulation, **changes)


def nomad(**changes: object) -> Simulation:
    robot = TrueRobot(
        PlanarNomad(), Waypoints(((3.0, 0.0), (0.0, 3.0))), calib={"speed scale": 0.9}
    )
    mount = TrueMount(RangeBearing(), "n", (0.0, 0.0, 0.0))
    return replace(Simulation(Field(), {"n": robot}, {"s": mount}, up="y"), **changes)


def points_of(simulation: Simulation, frames: int) -> list[Points]:
    state, out = simulation.start(), []
    for k in range(frames):
        frame, state = simulation.advance(state, k)
        (raw,) = frame.raw.values()
        assert isinstance(raw, Points)
        out.append(raw)
    return out


def query(frame_points: Points, identities: list[int]) -> Query:
    n = len(identities)
    h, S = np.zeros((n, 2)), np.tile(np.eye(2), (n, 1, 1))
    return Query("c", tuple(range(n)), h, S, 9.0, tuple(identities), S, "identity")


@pytest.mark.parametrize("make", [cloister, nomad])
def test_same_seed_is_bit_identical_however_it_is_advanced(make: Callable[..., Simulation]) -> None:
    simulation: Source = make(seed=4)
    state, forward, before = simulation.start(), [], []
    for k in range(6):
        before.append(state)
        frame, state = simulation.advance(state, k)
        forward.append(frame)
    for k in (5, 2, 0, 2):
        again, _ = make(seed=4).advance(before[k], k)
        for a, b in zip(again.raw.values(), forward[k].raw.values(), strict=True):
            assert isinstance(a, Points) and isinstance(b, Points)
            np.testing.assert_array_equal(a.z, b.z)
        for a, b in zip(again.controls.values(), forward[k].controls.values(), strict=True):
            np.testing.assert_array_equal(a[0].u, b[0].u)
    other, _ = make(seed=5).advance(before[3], 3)
    (a,), (b,) = other.raw.values(), forward[3].raw.values()
    assert isinstance(a, Points) and isinstance(b, Points)
    assert len(a.z) != len(b.z) or not np.array_equal(a.z, b.z)


def test_frame_zero_is_measured_at_the_start() -> None:
    frame, _ = cloister().advance(cloister().start(), 0)
    assert frame.dt == 0.0 and frame.time == 0.0 and not frame.controls
    assert frame.truth is not None
    np.testing.assert_array_equal(frame.truth.xp["r"], [0, -5, 0, 1, 0, 0, 0])


def test_the_circle_is_the_toolbox_truth(golden: Callable[[str], Path]) -> None:
    theirs = np.load(golden("slamtb_mono_idp.npz"), allow_pickle=True)["rob0_truth"]
    simulation = cloister()
    state = simulation.start()
    for k in range(401):
        _, state = simulation.advance(state, k)
        if k:
            np.testing.assert_allclose(state.xv["r"], theirs[k - 1], atol=1e-12)


def test_controls_carry_the_noise_when_the_motion_does_not() -> None:
    simulation = cloister(seed=1)
    state, u = simulation.start(), []
    for k in range(400):
        frame, state = simulation.advance(state, k)
        if k:
            (control,) = frame.controls["r"]
            u.append(control.u)
    off = np.array(u) - np.array([0.08, 0, 0, 0, 0, np.radians(0.9)])
    U = Odometry3D().U(np.zeros(6), 0.1)
    np.testing.assert_allclose(off.std(0), np.sqrt(np.diag(U)), rtol=0.15)
    assert np.abs(off.mean(0) / np.sqrt(np.diag(U))).max() < 4 / np.sqrt(len(u))


def test_measurements_scatter_with_the_sensors_noise() -> None:
    still = {"r": TrueRobot(Odometry3D(), ConstantControls(), {"y": -5.0}, noise_on="controls")}
    simulation = cloister(robots=still)
    raw = points_of(simulation, 300)
    inner = [k for k in range(1, 73) if all(k in r.ids for r in raw)]  # type: ignore[operator]
    assert len(inner) > 5
    z = np.array([[r.z[list(r.ids).index(k)] for k in inner] for r in raw])  # type: ignore[arg-type]
    h = simulation.outlook("c", simulation.start().xv).h
    nu = (z - h[np.array(inner) - 1]).reshape(-1, 2)
    assert np.abs(nu.mean(0)).max() < 4 / np.sqrt(len(nu))
    np.testing.assert_allclose(np.cov(nu.T), CAMERA.sd_px**2 * np.eye(2), atol=0.1)


def test_missing_and_wrong_measurements_come_in_the_fractions_asked_for() -> None:
    clean = points_of(cloister(), 150)
    missing = points_of(cloister(disturbances=Disturbances(misses=0.3)), 150)
    seen, left = (sum(len(r.z) for r in raw) for raw in (clean, missing))
    assert left / seen == pytest.approx(0.7, abs=0.03)
    wrong = points_of(cloister(disturbances=Disturbances(outliers=0.2, outlier_sigma=40.0)), 150)
    off = 0
    for a, b in zip(clean, wrong, strict=True):
        assert a.ids is not None and b.ids is not None
        both = np.intersect1d(a.ids, b.ids)
        d = np.linalg.norm(a.z[np.isin(a.ids, both)] - b.z[np.isin(b.ids, both)], axis=1)
        off += int((d > 10.0).sum())
    assert off / seen == pytest.approx(0.19, abs=0.04)


def test_no_measurement_lies_outside_the_sensors_limits() -> None:
    for make in (cloister, nomad):
        (mount,) = make().mounts.values()
        low, high = np.array(mount.sensor.limits).T
        z = np.concatenate([r.z for r in points_of(make(), 100)])
        assert ((z >= low) & (z <= high)).all()


def test_a_match_knows_where_its_landmark_really_is() -> None:
    simulation = cloister(disturbances=Disturbances(outliers=0.5))
    frame, state = simulation.advance(simulation.start(), 0)
    raw = frame.raw["c"]
    assert isinstance(raw, Points) and raw.ids is not None
    matches = simulation.search(frame, query(raw, [*raw.ids.tolist(), 999]), Vision())
    h = simulation.outlook("c", state.xv).h
    for match, identity in zip(matches, raw.ids, strict=False):
        assert match.true_z is not None
        np.testing.assert_allclose(match.true_z, h[identity - 1])
    assert matches[-1].z is None and matches[-1].why


def test_a_search_in_the_gate_does_not_read_identities() -> None:
    """An outlier carries the right identity: by identity it is matched, by the gate it is not."""
    simulation = cloister(disturbances=Disturbances(outliers=1.0))
    frame, state = simulation.advance(simulation.start(), 0)
    raw = frame.raw["c"]
    assert isinstance(raw, Points) and raw.ids is not None
    asked = query(raw, raw.ids.tolist())
    asked = replace(asked, h=simulation.outlook("c", state.xv).h[raw.ids - 1])
    by_identity = simulation.search(frame, replace(asked, how="identity"), Vision())
    by_gate = simulation.search(frame, replace(asked, how="search"), Vision())
    assert all(m.z is not None for m in by_identity)
    assert sum(m.z is not None for m in by_gate) < 0.2 * len(by_gate)


def test_new_landmarks_keep_the_margin_and_are_not_offered_twice() -> None:
    mounts = {"c": TrueMount(CAMERA, "r", POSE, margin=100.0)}
    simulation = cloister(mounts=mounts)
    frame, _ = simulation.advance(simulation.start(), 0)
    first = simulation.detect(frame, "c", Occupied(np.zeros((0, 2)), ()), 3, Vision())
    known = tuple(d.appearance for d in first)
    more = simulation.detect(frame, "c", Occupied(np.zeros((0, 2)), known), 72, Vision())
    assert len(first) == 3 and not {d.appearance for d in more} & set(known)
    for d in [*first, *more]:
        assert (d.z >= 100.0).all() and (d.z <= [540.0, 380.0]).all()


def test_a_click_finds_the_point_under_it_and_nothing_far_from_all() -> None:
    simulation = cloister()
    frame, _ = simulation.advance(simulation.start(), 0)
    raw = frame.raw["c"]
    assert isinstance(raw, Points) and raw.ids is not None
    found = simulation.appearance_at(frame, "c", raw.z[2] + 1.0, Vision())
    assert found is not None and found.appearance == raw.ids[2]
    assert simulation.appearance_at(frame, "c", np.array([320.0, 5.0]), Vision()) is None


def test_a_sensor_fires_in_every_nth_frame() -> None:
    simulation = cloister(mounts={"c": TrueMount(CAMERA, "r", POSE, every=3)})
    state, fired = simulation.start(), []
    for k in range(7):
        frame, state = simulation.advance(state, k)
        fired.append("c" in frame.raw)
    assert fired == [True, False, False, True, False, False, True]


def test_two_robots_with_sensors_at_their_own_rates_do_not_disturb_each_other() -> None:
    """Each mount fires in its own frames; what a robot does and its sensor sees does not depend on
    the other one."""
    robots = {
        name: TrueRobot(Odometry3D(), CIRCLE, {"y": y}, {"x": 0.1, "rz": 0.02})
        for name, y in (("a", -5.0), ("b", -4.0))
    }
    mounts = {
        "every third": TrueMount(CAMERA, "a", POSE, every=3),
        "later": TrueMount(CAMERA, "b", POSE, every=2, offset=3),
        "always": TrueMount(CAMERA, "b", POSE),
    }
    both = Simulation(ThickCloister(), robots, mounts, seed=2)
    alone = replace(both, robots={"b": robots["b"]}, mounts={"always": mounts["always"]})
    state, single, fired = both.start(), alone.start(), []
    assert state.xv["a"][0] != state.xv["b"][0]
    for k in range(8):
        frame, state = both.advance(state, k)
        only, single = alone.advance(single, k)
        fired.append(tuple(frame.raw))
        assert set(frame.controls) == ({"a", "b"} if k else set())
        np.testing.assert_array_equal(state.xv["b"], single.xv["b"])
        one, other = frame.raw["always"], only.raw["always"]
        assert isinstance(one, Points) and isinstance(other, Points)
        np.testing.assert_array_equal(one.z, other.z)
    assert [k for k, names in enumerate(fired) if "every third" in names] == [0, 3, 6]
    assert [k for k, names in enumerate(fired) if "later" in names] == [3, 5, 7]


def test_start_errors_differ_between_robots_and_seeds() -> None:
    robots = {i: TrueRobot(Odometry3D(), CIRCLE, start_sd={"x": 0.5, "rz": 0.3}) for i in "ab"}
    simulation = Simulation(ThickCloister(), robots, {})
    x = np.array([[replace(simulation, seed=s).start().xv[i] for i in "ab"] for s in range(200)])
    np.testing.assert_allclose(x[..., 0].std(0), 0.5, rtol=0.15)
    assert abs(np.corrcoef(x[:, 0, 0], x[:, 1, 0])[0, 1]) < 0.25
    np.testing.assert_allclose(2.0 * x[..., 6].std(0), 0.3, rtol=0.15)


def test_truth_names_every_component() -> None:
    frame, _ = nomad().advance(nomad().start(), 0)
    assert frame.truth is not None
    assert frame.truth.labels["robot:n:calib"] == {"speed scale": 0.9}
    assert set(frame.truth.labels["robot:n"]) == {"z", "x", "S", "T"}
    assert frame.truth.points.shape == (42, 2)


def test_the_true_start_is_drawn_around_the_belief() -> None:
    sd = {"x": 0.1, "rz": 0.05, "vy": 0.2}
    robot = TrueRobot(Impulse(), HandHeld(), start_sd=sd)
    xv = np.array(
        [
            Simulation(ThickCloister(), {"r": robot}, {}, dt=0.05, seed=k).start().xv["r"]
            for k in range(300)
        ]
    )
    np.testing.assert_allclose(xv[:, 0].std(), 0.1, rtol=0.15)
    np.testing.assert_allclose(xv[:, 8].std(), 0.2, rtol=0.15)
    np.testing.assert_allclose(np.linalg.norm(xv[:, 3:7], axis=1), 1.0)
    assert np.ptp(xv[:, 1]) == 0.0


def test_instruments_feel_the_true_motion() -> None:
    robots = {"r": TrueRobot(Impulse(), HandHeld())}
    gyro = {"gyro": TrueInstrument("r", Gyro())}
    simulation = Simulation(ThickCloister(), robots, {}, gyro, dt=0.05)
    state, off = simulation.start(), []
    for k in range(200):
        frame, state = simulation.advance(state, k)
        off.append(frame.internal["gyro"] - state.xv["r"][10:])
    np.testing.assert_allclose(np.std(off), np.sqrt(Gyro().R(np.zeros(3))[0, 0]), rtol=0.15)
    lost = cloister(instruments={"gyro": TrueInstrument("r", Gyro())})
    with pytest.raises(SourceError, match="needs the state component 'wx'"):
        lost.advance(lost.start(), 0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rendering": Rendering()}, "no surfaces to render"),
        ({"mounts": {"c": TrueMount(CAMERA, "nobody", POSE)}}, "no true robot 'nobody'"),
        ({"mounts": {"c": TrueMount(CAMERA, "r", (0.0, 0.0))}}, "give 7 numbers"),
        (
            {"robots": {"r": TrueRobot(Odometry3D(), Waypoints(((1.0, 2.0, 0.0), (1.0, 2.0))))}},
            r"waypoint 2 is \[1.0, 2.0\]: a robot in 3-D needs 3 numbers, \(x, y, z\) in m",
        ),
        (
            {"robots": {"r": TrueRobot(Odometry3D(), CIRCLE, calib={"k": 1.0})}},
            "no calibration 'k'",
        ),
        (
            {"robots": {"r": TrueRobot(Odometry3D(), CIRCLE, calib_sd={"k": 1.0})}},
            "no calibration 'k'",
        ),
        (
            {"robots": {"r": TrueRobot(Odometry3D(), CIRCLE, {"foot:x": 1.0})}},
            r"source.robots.r.start has no component 'foot:x': it may hold x, y, z, qw",
        ),
        (
            {"robots": {"r": TrueRobot(Odometry3D(), CIRCLE, start_sd={"phi": 0.1})}},
            r"source.robots.r.start_sd has no component 'phi': .*qz, rx, ry, rz",
        ),
        (
            {"robots": {"r": TrueRobot(Odometry3D(), CIRCLE, start_sd={"rz": -0.1})}},
            r"source.robots.r.start_sd.rz = -0.1: a standard deviation is >= 0",
        ),
        (
            {"mounts": {"camera": TrueMount(CAMERA, "r", POSE, "roof")}},
            r"source.mounts.camera.hook = 'roof': '6-DoF odometry' has the hooks base",
        ),
    ],
)
def test_what_does_not_fit_is_refused_in_words(changes: dict, words: str) -> None:
    simulation = cloister(**changes)
    with pytest.raises(SourceError, match=words):
        simulation.advance(simulation.start(), 0)


def test_a_true_calibration_is_drawn_anew_for_every_seed_and_only_where_it_is_said() -> None:
    sds = {"u0": 5.0, "fv": 8.0}
    mount = TrueMount(CAMERA, "r", POSE, calib={"v0": 1.0, "fv": 300.0}, calib_sd=sds)
    drawn = np.array([mount.true_calib("camera", seed) for seed in range(200)])
    exactly = replace(mount, calib_sd={}).true_calib("camera", 0)
    expected = [sds.get(label, 0.0) for label in CAMERA.calib_labels]
    assert drawn.mean(axis=0) == pytest.approx(exactly, abs=2.0)
    assert drawn.std(axis=0) == pytest.approx(expected, rel=0.2, abs=1e-9)
    assert np.array_equal(drawn[7], mount.true_calib("camera", 7))
    assert not np.array_equal(drawn[7], mount.true_calib("other camera", 7))
    alone = replace(mount, calib_sd={"fv": 8.0}).true_calib("camera", 7)
    column = CAMERA.calib_labels.index("fv")
    assert alone[column] == drawn[7, column]


def test_the_truth_told_and_the_measurements_use_the_drawn_calibration() -> None:
    mount = TrueMount(CAMERA, "r", POSE, calib_sd={"u0": 20.0})
    simulation = cloister(mounts={"camera": mount}, seed=3)
    frame, _ = simulation.advance(simulation.start(), 0)
    assert frame.truth is not None
    u0 = frame.truth.labels["mount:camera:calib"]["u0"]
    assert u0 == mount.true_calib("camera", 3)[CAMERA.calib_labels.index("u0")] != CAMERA.u0
