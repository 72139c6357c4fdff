"""Estimating a calibration or a pose from the next frame on, and leaving it again."""

from __future__ import annotations

import numpy as np
import pytest

from scene_core import params
from scene_core.params import ParamError
from scene_core.session.commands import SetParam, Undo
from scene_core.session.estimated import estimables
from scene_core.session.presets import build
from scene_core.session.session import Session
from scene_core.session.toml_io import dumps, loads

SCALE = "estimator.robots.nomad.calib_sd.speed scale"
CALIB = "robot:nomad:calib"
POSE = "estimator.mounts.camera.pose_sd"


def started(session: Session) -> np.ndarray:
    """P at the start of the next frame."""
    session.advance()
    assert session.trace is not None
    return session.trace.start.gauss.P


@pytest.fixture
def nomad() -> Session:
    session = Session(build("nomad"))
    for _ in range(20):
        session.advance()
    return session


@pytest.fixture
def cloister() -> Session:
    session = Session(build("cloister"))
    for _ in range(6):
        session.advance()
    return session


def test_everything_declared_can_be_estimated() -> None:
    for name in ("nomad", "cloister", "line"):
        settings = build(name).estimator
        blocks = {e.block: e.labels for e in estimables(settings)}
        for i, robot in settings.robots.items():
            assert blocks.get(f"robot:{i}:calib", ()) == robot.motion.calib_labels
        for i, mount in settings.mounts.items():
            assert blocks.get(f"mount:{i}:calib", ()) == mount.sensor.calib_labels
            assert len(blocks[f"mount:{i}:pose"]) == mount.sensor.space.tangent


def test_dropped_it_is_as_the_settings_say_and_undo_brings_the_estimate_back(
    nomad: Session,
) -> None:
    assert nomad.world.robot_calib("nomad")[0] < 0.99
    before = nomad.world.gauss
    nomad.apply(SetParam(SCALE, None))
    assert (
        nomad.message
        == "speed scale of nomad is no longer estimated: it is as the settings say again"
    )
    nomad.apply(Undo())
    assert nomad.message == "last edit undone"
    nomad.advance()
    assert nomad.trace is not None and nomad.trace.start.gauss is before
    nomad.apply(SetParam(SCALE, None))
    started(nomad)
    assert CALIB not in nomad.world.gauss.layout
    assert nomad.world.robot_calib("nomad")[0] == 1.0
    assert nomad.experiment.estimator.robots["nomad"].calib_sd == {}


def test_ticked_it_comes_in_uncorrelated_and_converges(nomad: Session) -> None:
    nomad.apply(SetParam(SCALE, None))
    nomad.advance()
    rest = nomad.world.gauss
    nomad.apply(SetParam(SCALE, 0.3))
    P = started(nomad)
    np.testing.assert_array_equal(P[:-1, :-1], rest.P)
    np.testing.assert_array_equal(P[-1], np.r_[np.zeros(len(P) - 1), 0.3**2])
    for _ in range(60):
        nomad.advance()
    mean = nomad.world.robot_calib("nomad")[0]
    sd = np.sqrt(nomad.world.gauss.cov(CALIB)[0, 0])
    assert sd < 0.05 and abs(mean - 0.9) < 4 * sd


def test_another_sd_starts_it_anew_about_its_present_mean(nomad: Session) -> None:
    before = nomad.world.gauss
    nomad.apply(SetParam(SCALE, 0.5))
    assert "starts anew, at its present value ± 0.5" in nomad.message
    started(nomad)
    assert nomad.trace is not None
    after = nomad.trace.start.gauss
    at = after.layout[CALIB].start
    others = np.delete(np.arange(len(after.x)), at)
    assert after.x[at] == before.x[at] and after.P[at, at] == 0.25
    assert not after.P[at, others].any()
    np.testing.assert_array_equal(after.P[np.ix_(others, others)], before.P[np.ix_(others, others)])


def test_components_of_a_pose_come_and_go_one_by_one(cloister: Session) -> None:
    nominal = cloister.world.mount_pose("camera")
    cloister.apply(SetParam(f"{POSE}.rx", 0.02))
    cloister.apply(SetParam(f"{POSE}.x", 0.1))
    started(cloister)
    assert cloister.trace is not None
    gauss, block = cloister.trace.start.gauss, "mount:camera:pose"
    space = cloister.world.mounts["camera"].sensor.space
    J = space.tangent_map(gauss.mean(block))
    want = np.diag(np.square([0.1, 0.0, 0.0, 0.02, 0.0, 0.0]))
    np.testing.assert_allclose(J @ gauss.cov(block) @ J.T, want, atol=1e-15)
    cloister.advance()
    kept = cloister.world.gauss
    cloister.apply(SetParam(f"{POSE}.x", None))
    started(cloister)
    gauss = cloister.trace.start.gauss
    assert gauss.mean(block)[0] == nominal[0]
    np.testing.assert_array_equal(gauss.mean(block)[3:], kept.mean(block)[3:])
    assert np.linalg.eigvalsh(gauss.P)[0] > -1e-12
    cloister.apply(SetParam(f"{POSE}.rx", None))
    cloister.advance()
    np.testing.assert_array_equal(cloister.world.mount_pose("camera"), nominal)


def test_what_makes_no_sense_is_refused(nomad: Session) -> None:
    with pytest.raises(ParamError, match=r"calib_sd has no component 'colour'.*speed scale"):
        nomad.apply(SetParam("estimator.robots.nomad.calib_sd.colour", 0.1))
    with pytest.raises(ParamError, match=r"outside \[0, inf\]"):
        nomad.apply(SetParam(SCALE, -1.0))
    with pytest.raises(ParamError, match="give a number"):
        nomad.apply(SetParam(SCALE, "much"))
    assert nomad.pending is None


def test_the_file_keeps_it_and_the_changes_name_it(nomad: Session) -> None:
    nomad.apply(SetParam(SCALE, None))
    nomad.apply(SetParam("estimator.mounts.scanner.pose_sd.x", 0.05))
    edited = nomad.settings.experiment
    assert loads(dumps(edited, nomad.base)) == edited
    changed = {
        now.path: (old and old.value, now.value) for now, old in params.changed(edited, nomad.base)
    }
    assert changed == {SCALE: (0.2, None), "estimator.mounts.scanner.pose_sd.x": (None, 0.05)}
