"""The figures of a run against values worked out by hand or by another road."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from scene_core.filter.records import Association, PhaseRecord, Trace
from scene_core.geometry.spaces import THREE_D, TWO_D
from scene_core.session import presets
from scene_core.session.alignment import aligned_poses, umeyama
from scene_core.session.counting import COUNTS, count
from scene_core.session.edits import with_seed
from scene_core.session.report import report
from scene_core.session.session import Session
from scene_core.session.tracks import pose_estimate

KEYS = [
    *("preset", "seed", "frames", "fps_mean", "ms_per_phase", "landmarks", "initialised"),
    *("converted", "deleted", "accepted", "rejected", "align", "pos_rmse_m", "ori_rmse_deg"),
    *("pos_end_m", "nees_mean", "nees_dof", "nees_band", "nis_mean", "nis_dof", "nis_band"),
    "state",
]


@pytest.fixture(scope="module")
def cloister() -> Session:
    session = Session(with_seed(presets.build("cloister"), 3))
    for _ in range(25):
        session.advance()
    return session


def test_the_report_has_the_agreed_names(cloister: Session) -> None:
    figures = report(cloister, 2.0)
    assert list(figures) == KEYS
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    assert figures["preset"] == "cloister" and figures["seed"] == 3
    assert figures["frames"] == 25 and figures["fps_mean"] == 12.5
    assert list(figures["state"]) == list(THREE_D.labels)


def test_errors_are_those_of_the_poses(cloister: Session) -> None:
    track = cloister.metrics.robots["robot"]
    xp, true = track.xp.view(25)[5:], track.true_xp.view(25)[5:]
    position = np.linalg.norm(xp[:, :3] - true[:, :3], axis=1)
    turn = [
        (
            Rotation.from_quat(t[[4, 5, 6, 3]]).inv() * Rotation.from_quat(e[[4, 5, 6, 3]])
        ).magnitude()
        for e, t in zip(xp, true, strict=True)
    ]
    figures = report(cloister, 1.0, first=5)
    assert figures["pos_rmse_m"] == pytest.approx(np.sqrt(np.mean(position**2)))
    assert figures["ori_rmse_deg"] == pytest.approx(np.degrees(np.sqrt(np.mean(np.square(turn)))))
    assert figures["pos_end_m"] == pytest.approx(position[-1])


def test_nees_is_on_the_tangent(cloister: Session) -> None:
    """Against a covariance of (position, rotation vector) by central differences."""
    world, trace = cloister.world, cloister.trace
    assert trace is not None and trace.frame.truth is not None
    true = trace.frame.truth.xp["robot"]
    xv, P = world.gauss.mean("robot:robot"), world.gauss.cov("robot:robot")

    def error(x: np.ndarray) -> np.ndarray:
        x = THREE_D.normalise(x)[0]
        turn = Rotation.from_quat(true[[4, 5, 6, 3]]).inv() * Rotation.from_quat(x[[4, 5, 6, 3]])
        return np.concatenate([x[:3] - true[:3], turn.as_rotvec()])

    J = np.stack([(error(xv + d) - error(xv - d)) / 2e-6 for d in 1e-6 * np.eye(7)], axis=1)
    e = error(xv)
    nees = e @ np.linalg.solve(J @ P @ J.T, e)
    assert cloister.metrics.robots["robot"].nees.view(25)[-1] == pytest.approx(nees, rel=1e-3)
    at = pose_estimate(world, "robot")
    assert np.allclose(at.P, at.P.T) and at.P.shape == (6, 6)
    figures = report(cloister, 1.0)
    assert figures["nees_dof"] == 6
    assert figures["nees_band"] == pytest.approx([chi2.ppf(0.025, 6), chi2.ppf(0.975, 6)])


def test_nis_is_the_mean_d2_of_what_was_gated(cloister: Session) -> None:
    d2 = [
        a.d2
        for frame in range(25)
        for a in cloister._live.past.history.whole(frame)[1].associations()  # type: ignore[index]
        if a.verdict in ("accepted", "rejected")
    ]
    figures = report(cloister, 1.0)
    assert figures["nis_mean"] == pytest.approx(np.mean(d2))  # type: ignore[arg-type]
    assert figures["nis_dof"] == 2
    assert figures["accepted"] + figures["rejected"] == len(d2)


def test_what_has_no_truth_is_null() -> None:
    session = Session(presets.build("line"))
    source = session.experiment.source

    class Blind:
        """The same measurements without the true poses."""

        def __getattr__(self, name: str) -> object:
            return getattr(source, name)

        def advance(self, state: object, index: int) -> tuple[object, object]:
            frame, state = source.advance(state, index)
            return dataclasses.replace(frame, truth=dataclasses.replace(frame.truth, xp={})), state

    session = Session(dataclasses.replace(session.experiment, source=Blind()))  # type: ignore[arg-type]
    for _ in range(5):
        session.advance()
    figures = report(session, 1.0)
    for name in ("pos_rmse_m", "ori_rmse_deg", "pos_end_m", "nees_mean", "nees_dof", "nees_band"):
        assert figures[name] is None
    assert figures["nis_mean"] is not None
    series = session.metrics.series().robots["robot"]
    assert series.error is None and series.nees is None and series.true_position is None
    assert session.metrics.light().text.startswith("NIS")


def test_an_aligned_run_has_errors_and_no_nees() -> None:
    session = Session(dataclasses.replace(presets.build("nomad"), align="se2"))
    for _ in range(60):
        session.advance()
    figures = report(session, 1.0)
    assert figures["align"] == "se2" and figures["nees_mean"] is None
    straight = Session(presets.build("nomad"))
    for _ in range(60):
        straight.advance()
    assert figures["pos_rmse_m"] <= report(straight, 1.0)["pos_rmse_m"]


def test_counts_of_a_frame(cloister: Session) -> None:
    def outcome(label: int, verdict: str, d2: float | None, wrong: bool) -> Association:
        h, S = np.zeros(2), np.eye(2)
        return Association(
            "camera",
            label,
            verdict,
            h,
            S,
            d2=d2,
            dof=2 * (d2 is not None),
            wrong=wrong,  # type: ignore[arg-type]
        )

    trace = cloister.trace
    assert trace is not None
    outcomes = (
        outcome(1, "accepted", 1.5, False),
        outcome(2, "accepted", 2.5, True),
        outcome(3, "rejected", 20.0, True),
        outcome(4, "no match", None, False),
        outcome(5, "not selected", None, False),
    )
    record = PhaseRecord("update", "camera", trace.world, 1.0, associations=outcomes)
    counts = count(Trace(trace.frame, trace.start, (record,), True))
    assert counts["accepted"] == 2 and counts["rejected"] == 1 and counts["no_match"] == 1
    assert counts["wrong"] == 2 and counts["gated"] == 3
    assert counts["d2"] == 24.0 and counts["dof"] == 6
    assert set(counts) <= set(COUNTS)


vectors = st.lists(st.floats(-5, 5), min_size=3, max_size=3).map(np.array)


@given(vectors, vectors, st.floats(0.2, 5.0), st.integers(0, 1000))
def test_alignment_finds_the_similarity(t, turn, s, seed) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(seed)
    poses = np.concatenate(
        [rng.normal(size=(20, 3)), Rotation.random(20, rng).as_quat()[:, [3, 0, 1, 2]]], axis=1
    )
    R = Rotation.from_rotvec(turn)
    moved = np.concatenate(
        [
            s * R.apply(poses[:, :3]) + t,
            (R * Rotation.from_quat(poses[:, [4, 5, 6, 3]])).as_quat()[:, [3, 0, 1, 2]],
        ],
        axis=1,
    )
    fit = umeyama(THREE_D, poses, moved, "sim3")
    assert fit is not None and fit.s == pytest.approx(s)
    again = aligned_poses(THREE_D, fit, poses)
    assert np.abs(THREE_D.difference(again, moved)).max() < 1e-6
    rigid = umeyama(THREE_D, poses, moved, "se3")
    assert rigid is not None and rigid.s == 1.0
    np.testing.assert_allclose(rigid.R, R.as_matrix(), atol=1e-6)


def test_planar_alignment_turns_the_heading() -> None:
    rng = np.random.default_rng(0)
    poses = rng.normal(size=(30, 3))
    c, s = np.cos(2.5), np.sin(2.5)
    moved = poses.copy()
    moved[:, 0] = c * poses[:, 0] - s * poses[:, 1] + 3.0
    moved[:, 1] = s * poses[:, 0] + c * poses[:, 1] - 1.0
    moved[:, 2] += 2.5
    fit = umeyama(TWO_D, poses, moved, "se2")
    assert fit is not None
    assert np.abs(TWO_D.difference(aligned_poses(TWO_D, fit, poses), moved)).max() < 1e-9


def test_alignment_leaves_unknown_rows_out() -> None:
    rng = np.random.default_rng(0)
    poses = rng.normal(size=(10, 3))
    moved = poses + np.array([1.0, 2.0, 0.0])
    moved[3] = np.nan
    fit = umeyama(TWO_D, poses, moved, "se2")
    assert fit is not None
    np.testing.assert_allclose(fit.t, [1.0, 2.0], atol=1e-12)
    assert umeyama(TWO_D, poses[:1], moved[:1], "se2") is None


def test_the_series_carry_calibration_and_truth() -> None:
    session = Session(presets.build("nomad"))
    for _ in range(10):
        session.advance()
    mean, sd, true = session.metrics.series().calibrations["robot:nomad:calib speed scale"]
    assert len(mean) == len(sd) == 10 and sd[-1] < 0.2
    assert true is not None and (true == 0.9).all()
    figures = report(session, 1.0)
    assert figures["state"]["speed scale"] == [mean[-1], pytest.approx(sd[-1])]
