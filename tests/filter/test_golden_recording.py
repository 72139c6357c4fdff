"""The toolbox's recorded experiment, quantity by quantity: controls, pixels, gates, scores."""

from __future__ import annotations

import numpy as np
import pytest

from scene_core.geometry.ellipses import chi2_band, chi2_gate, d2
from scene_core.geometry.spaces import THREE_D
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.sensors.pinhole import Pinhole

CAMERA = Pinhole(width=640, height=480, u0=320.0, v0=240.0, f_u=320.0, f_v=320.0)
NOTHING = np.zeros(0)


@pytest.fixture(scope="module")
def data(request: pytest.FixtureRequest) -> dict:
    path = request.getfixturevalue("golden")("slamtb_mono_idp.npz")
    with np.load(path, allow_pickle=False) as archive:
        return {k: archive[k] for k in archive.files}


def test_every_prediction_from_where_the_toolbox_was(data: dict) -> None:
    """Each frame from its own last state; it scales P by 1 / |q| before, where we project."""
    model, U = Odometry3D(), data["rob0_U"]
    np.testing.assert_allclose(model.U(NOTHING, 0.1), U, rtol=1e-12)
    for f in range(1, 400):
        xv, scale = data["rob0_x_end"][f - 1].copy(), np.ones(7)
        scale[3:] = 1.0 / np.linalg.norm(xv[3:])
        xv[3:] *= scale[3:]
        P = data["rob0_P_end"][f - 1] * np.outer(scale, scale)
        fv, F, G, _ = model.f(xv, data["rob0_u"][f], 0.1, NOTHING)
        assert F is not None and G is not None
        np.testing.assert_allclose(fv, data["rob0_x_pred"][f], rtol=0, atol=1e-13)
        wanted = data["rob0_P_pred"][f]
        np.testing.assert_allclose(
            F @ P @ F.T + G @ U @ G.T, wanted, rtol=0, atol=1e-11 * np.abs(wanted).max()
        )


def test_its_pixels_are_our_pixels_of_its_truth(data: dict) -> None:
    """What it saw is what we say is to be seen, but for its noise of one pixel."""
    np.testing.assert_array_equal(CAMERA.calib0, data["sen0_k"])
    np.testing.assert_array_equal(CAMERA.R(np.zeros(2)), data["sen0_pix_cov"])
    ids, X = data["world_points"][:, 0], np.c_[data["world_points"][:, 1:], np.ones(72)]
    off = []
    for f in range(400):
        xws = THREE_D.compose(data["rob0_truth"][f], data["sen0_frame0"]).x
        X_S = THREE_D.to_local(xws, X).X
        h = CAMERA.project(X_S, CAMERA.calib0).h
        rows = data["meas_points"][data["meas_points"][:, 0] == f]
        seen = np.searchsorted(ids, rows[:, 2])
        off.append(rows[:, 3:] - h[seen])
        well_inside = ((h > 5.0) & (h < (635.0, 475.0))).all(1) & (X_S[:, 2] > 0.0)
        assert set(np.flatnonzero(well_inside)) <= set(seen)
    z = np.concatenate(off)
    assert np.abs(z).max() < 6.0
    # Pixels that noise drove out of the image are missing: a little less than all of it.
    low, high = chi2_band(1, z.size, 0.999)
    assert low - 0.02 < np.mean(z**2) < high
    assert abs(np.corrcoef(z.T)[0, 1]) < 4.0 / np.sqrt(len(z))


def test_its_gate(data: dict) -> None:
    """Three sigma in two dimensions: 9, and its distances are ours."""
    log = data["innov_log"]
    np.testing.assert_allclose(d2(log[:, 5:7], log[:, 7:11].reshape(-1, 2, 2)), log[:, 4])
    gate = chi2_gate(2, 1.0 - np.exp(-4.5))
    assert gate == pytest.approx(9.0)
    status = {(int(r[0]), int(r[2])): bool(r[6]) for r in data["obs_status"]}
    assert all(status[int(r[0]), int(r[2])] == (r[4] < gate) for r in log)
    _, _, _, matches, inliers, _ = data["lmk_table"].sum(0)
    accepted = np.isin(log[log[:, 4] < gate][:, 2], data["lmk_table"][:, 0]).sum()
    # Landmarks count from one, at their first view.
    assert inliers == accepted + 72 and matches >= inliers
