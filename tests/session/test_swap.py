"""A live swap keeps what has the same name and unit, and says what restarted."""

from __future__ import annotations

import numpy as np
import pytest

from scene_core import params
from scene_core.filter.world import Feature
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.wide_angle import WideAngle
from scene_core.params import ParamError
from scene_core.session import presets
from scene_core.session.commands import SetParam, SwapModel, Undo
from scene_core.session.config import Experiment
from scene_core.session.fit import fitted
from scene_core.session.roles import role_options
from scene_core.session.session import Session
from scene_core.sources.buildings import House

MOTION = "estimator.robots.robot.motion"
SENSOR = "estimator.mounts.camera.sensor"


@pytest.fixture
def session() -> Session:
    s = Session(presets.build("cloister"))
    for _ in range(12):
        s.advance()
    return s


def swapped_start(session: Session):  # type: ignore[no-untyped-def]
    """The world at the start of the next frame, after the pending swap."""
    session.step_phase()
    assert session.trace is not None
    return session.trace.start


def positive(P: np.ndarray) -> bool:
    return bool(np.linalg.eigvalsh(P).min() > -1e-12 * np.abs(P).max())


def test_odometry_to_impulse_keeps_pose_and_map(session: Session) -> None:
    before = session.world.gauss
    session.apply(SwapModel(MOTION, "impulse"))
    assert session.message == (
        "pose and map kept; velocity restarted at 0 ± 1 m/s; turn rate restarted at 0 ± 57.3 deg/s"
    )
    after = swapped_start(session).gauss
    assert after.layout["robot:robot"].size == 13
    old = np.arange(before.x.size)
    new = np.r_[0:7, 13 : after.x.size]
    np.testing.assert_array_equal(after.x[new], before.x[old])
    np.testing.assert_array_equal(after.P[np.ix_(new, new)], before.P)
    np.testing.assert_array_equal(after.P[7:13, 7:13], np.eye(6))
    assert not after.P[7:13][:, new].any()
    assert positive(after.P)


def test_an_instrument_rests_while_its_components_are_gone_also_after_a_reset() -> None:
    session = Session(presets.build("gyro"))
    session.advance()
    role = f"estimator.robots.{next(iter(session.world.robots))}.motion"
    names = set(session.world.instruments)
    session.apply(SwapModel(role, "6-DoF odometry"))
    rests = "instrument gyro rests: 'gyro' needs wx, wy, wz, which '6-DoF odometry' does not have"
    assert names == {"gyro", "speedometer"} and rests in session.message
    assert not swapped_start(session).instruments
    session.reset()
    assert rests in session.message
    assert not session.advance().world.instruments
    session.apply(SwapModel(role, "impulse"))
    assert set(swapped_start(session).instruments) == names


def test_there_and_back_restores_everything(session: Session) -> None:
    before = session.world.gauss
    session.apply(SwapModel(MOTION, "impulse"))
    session.apply(SwapModel(MOTION, "6-DoF odometry"))
    assert session.settings.experiment == session.base
    session.apply(Undo())
    session.apply(Undo())
    assert session.pending is None
    after = swapped_start(session).gauss
    np.testing.assert_array_equal(after.P, before.P)


def test_impulse_to_odometry_drops_the_velocity_and_nothing_else(session: Session) -> None:
    session.apply(SwapModel(MOTION, "impulse"))
    session.advance()
    before = session.world.gauss
    session.apply(SwapModel(MOTION, "6-DoF odometry"))
    assert session.message == "pose and map kept; velocity and turn rate dropped"
    after = swapped_start(session).gauss
    keep = np.r_[0:7, 13 : before.x.size]
    np.testing.assert_array_equal(after.P, before.P[np.ix_(keep, keep)])


def test_the_swapped_filter_goes_on_and_can_be_reset(session: Session) -> None:
    session.apply(SwapModel(MOTION, "impulse"))
    for _ in range(10):
        session.advance()
    assert positive(session.world.gauss.P)
    assert session.metrics.totals()["accepted"] > 180
    session.reset()
    start = session.world.gauss
    assert start.layout["robot:robot"].size == 13
    np.testing.assert_array_equal(start.P[7:13, 7:13], np.eye(6))
    np.testing.assert_array_equal(start.mean("robot:robot")[:3], [0.0, -5.0, 0.0])


@pytest.mark.parametrize(("name", "rms"), [("Civera", 1.5), ("wide-angle", 6.0)])
def test_another_camera_sees_the_same(session: Session, name: str, rms: float) -> None:
    before, world = session.world.gauss, session.world
    old = world.mounts["camera"].sensor
    session.apply(SwapModel(SENSOR, name))
    assert "sees the same" in session.message and "poses and map kept" in session.message
    after = swapped_start(session)
    new = after.mounts["camera"].sensor
    assert new.name == name and new.limits == old.limits
    np.testing.assert_array_equal(after.gauss.P, before.P)
    rng = np.random.default_rng(0)
    z = rng.uniform((0, 0), (640, 480), (200, 2))
    X = old.backproject(z, np.zeros((200, 1)), old.calib0).X
    assert np.sqrt(np.mean((new.project(X, new.calib0).h - z) ** 2)) < rms


def test_a_fit_finds_a_camera_that_is_the_same() -> None:
    wide = WideAngle(kd1=0.0)
    pinhole, rms = fitted(wide, Pinhole())
    assert rms < 1e-6
    np.testing.assert_allclose(pinhole.calib0[:4], wide.calib0[:4], atol=1e-4)
    back, rms = fitted(pinhole, WideAngle())
    assert rms < 1e-4
    np.testing.assert_allclose(back.calib0, wide.calib0, atol=1e-4)


def test_the_scenarios_own_camera_comes_back_as_it_was(session: Session) -> None:
    session.apply(SwapModel(SENSOR, "Civera"))
    session.advance()
    session.apply(SwapModel(SENSOR, "pinhole"))
    assert session.settings.experiment == session.base


def test_an_estimated_calibration_keeps_its_common_rows() -> None:
    base = presets.build("cloister")
    mount = base.estimator.mounts["camera"]
    estimated = params.put(
        base, "estimator.mounts.camera.calib_sd", {"u0": 2.0, "fu": 5.0, "d2": 0.01}
    )
    session = Session(estimated)
    for _ in range(5):
        session.advance()
    before = session.world.gauss
    session.apply(SwapModel(SENSOR, "wide-angle"))
    after = swapped_start(session).gauss
    block = "mount:camera:calib"
    assert after.layout[block].size == 5 and before.layout[block].size == 6
    np.testing.assert_array_equal(after.mean(block)[:4], before.mean(block)[:4])
    np.testing.assert_array_equal(after.cov(block)[:4, :4], before.cov(block)[:4, :4])
    np.testing.assert_array_equal(after.cov("robot:robot"), before.cov("robot:robot"))
    assert after.cov(block)[4, 4] == 0.0 and positive(after.P)
    assert mount.sensor.name == "pinhole"


def test_policies_change_without_touching_the_state(session: Session) -> None:
    before = session.world.gauss
    for role, name in (
        ("estimator.policies.update.kind", "stacked"),
        ("estimator.policies.selection.score", "trace"),
    ):
        session.apply(SwapModel(role, name))
        assert f": {name} from the next frame on; poses and map kept" in session.message
    start = swapped_start(session)
    assert start.gauss is before
    assert start.policies.update.kind == "stacked" and start.policies.selection.score == "trace"


def test_refusals_say_why(session: Session) -> None:
    with pytest.raises(ParamError, match="leaves rho open"):
        session.apply(SwapModel("estimator.policies.landmark", "Euclidean point"))
    with pytest.raises(ParamError, match=r"no model 'x'.*choose .*impulse"):
        session.apply(SwapModel(MOTION, "x"))
    with pytest.raises(ParamError, match="no role 'estimator'"):
        session.apply(SwapModel("estimator", "x"))


def test_a_parameter_edit_keeps_a_swapped_model(session: Session) -> None:
    session.apply(SwapModel(MOTION, "impulse"))
    session.advance()
    session.apply(SetParam(f"{MOTION}.sd_accel", 1.0))
    session.advance()
    assert session.world.robots["robot"].motion.sd_accel == 1.0  # type: ignore[attr-defined]


def test_the_true_sensor_can_be_swapped_too(session: Session) -> None:
    session.apply(SwapModel("source.mounts.camera.sensor", "Civera"))
    session.advance()
    source = session.experiment.source
    assert source.mounts["camera"].sensor.name == "Civera"  # type: ignore[attr-defined]
    assert session.world.mounts["camera"].sensor.name == "pinhole"


LINE = "estimator.policies.line"


def test_lines_are_mapped_from_the_next_frame_on_and_left_again() -> None:
    session = Session(with_house(presets.build("cloister")))
    session.advance()
    assert not lines_of(session)
    session.apply(SwapModel(LINE, "inverse depth line"))
    assert session.message == "new lines by 'inverse depth line'"
    for _ in range(3):
        session.advance()
    mapped = lines_of(session)
    assert mapped and {f.model.name for f in mapped} == {"inverse depth line"}
    session.apply(SetParam(f"{LINE}.far", 7.0))
    session.advance()
    assert {f.model.far for f in lines_of(session)} == {7.0}  # type: ignore[attr-defined]
    session.apply(SwapModel(LINE, "none"))
    assert session.message.startswith("no new lines; the ")
    count = len(lines_of(session))
    session.advance()
    assert len(lines_of(session)) == count


def test_points_and_lines_are_chosen_apart() -> None:
    roles = {r.role: r for r in role_options(presets.build("cloister"))}
    assert roles[LINE].current == "none" and "Plücker line" in roles[LINE].options
    assert "Plücker line" not in roles["estimator.policies.landmark"].options
    assert LINE not in {r.role for r in role_options(presets.build("nomad"))}


def with_house(experiment: Experiment) -> Experiment:
    """The same run round a house."""
    return params.put(experiment, "source.world", House())


def lines_of(session: Session) -> list[Feature]:
    return [f for f in session.world.features.values() if f.model.shape == "segment"]
