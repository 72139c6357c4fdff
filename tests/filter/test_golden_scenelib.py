"""SceneLib's features in its own numbers: their change of axes, innovation and score; its rays."""

import json
from functools import partial

import numpy as np
import pytest

from scene_core.arrays import frozen
from scene_core.filter.expect import predictions
from scene_core.filter.gaussian import Gaussian
from scene_core.filter.policies import Policies
from scene_core.filter.world import Feature, Layout, Mount, Robot, World
from scene_core.geometry.spaces import THREE_D
from scene_core.models.base import FeatureModel
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.features.ray_particles import RayWithParticles
from scene_core.models.motion.impulse import Impulse
from scene_core.models.sensors.wide_angle import WideAngle

close = partial(np.testing.assert_allclose, rtol=1e-9, atol=1e-9)
# Scene's camera looks along z with x left and y up: ours, mounted with half a turn about z.
HALF_TURN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
UNIBRAIN = WideAngle(
    width=320, height=240, u0=162, v0=125, f_u=195, f_v=195, kd1=9e-6, sd_px=1.0, border=20.0
)


@pytest.fixture(scope="module")
def scenelib(golden):
    return json.loads(golden("scenelib2_reference.json").read_text())


def world_of(case: dict, model: FeatureModel, xv, y, P) -> World:
    layout = Layout.of({"robot:hand": 13, "feature:1": len(y)})
    pose0 = THREE_D.compose(np.array(case["xp_orig"], dtype=float), HALF_TURN).x
    return World(
        frame=0,
        time=0.0,
        gauss=Gaussian(frozen(np.r_[xv, y]), frozen(P), layout),
        robots={"hand": Robot("hand", Impulse())},
        mounts={"eye": Mount("eye", UNIBRAIN, "hand", "base", frozen(HALF_TURN))},
        instruments={},
        features={1: Feature(1, model, "eye", pose0, np.zeros(2), None, 0)},
        policies=Policies(landmark=model),
        up="y",
        next_label=2,
    )


def test_what_is_expected_of_a_feature_and_what_it_is_worth(scenelib):
    """S is theirs; the score is the trace of S there, of S - R here: what the state may gain."""
    for case in scenelib["full_feature_model"]["cases"]:
        Pxy, Pyy = np.array(case["Pxy"]), np.array(case["Pyy"])
        P = np.block([[np.array(case["Pxx"]), Pxy], [Pxy.T, Pyy]])
        xv = np.r_[case["xp"], np.zeros(6)]
        world = world_of(case, EuclideanPoint(), xv, np.array(case["yi"], dtype=float), P)
        (seen,) = predictions(world, "eye")
        close(seen.h[0], case["hi"])
        close(seen.S[0], case["Si"], atol=1e-6)
        close(seen.score[0] + np.trace(case["Ri"]), case["selection_score"])
        close(UNIBRAIN.nu(seen.h[0], np.array(case["zi"])).nu, case["nui"])
        assert seen.fault[0] == case["visibility_flags"] == 0


def test_a_feature_seen_from_the_robot(scenelib):
    for case in scenelib["full_feature_model"]["cases"]:
        xp = np.array(case["xp"], dtype=float)
        seen = EuclideanPoint().redefine(np.array(case["yi"], dtype=float), xp)
        close(seen.value, case["zeroedyi"])
        close(seen.by_state, case["dzeroedyi_by_dyi"])
        close(seen.by_xpdef, case["dzeroedyi_by_dxp"])


def test_a_ray_of_a_first_view(scenelib):
    for case in scenelib["partial_feature_model_line_init"]:
        pose = THREE_D.compose(np.array(case["xp"], dtype=float), HALF_TURN)
        h = np.array(case["hi"], dtype=float)
        b = UNIBRAIN.backproject(h, np.ones(1), UNIBRAIN.calib0)
        start = RayWithParticles().initialise(pose.x, b.X)
        close(start.y, case["ypi"])
        close(start.dy_by_dxws @ pose.by_a, case["dypi_by_dxp"])
        # The library's own dypi_by_dhi has the norm squared for the norm.
        close(start.dy_by_dX @ b.dX_by_dz, case["dypi_by_dhi_true"], atol=1e-8)
        close(UNIBRAIN.R(h), case["Ri"])


def test_a_ray_seen_from_another_place(scenelib):
    model = RayWithParticles()
    for case in scenelib["partial_feature_model_line_init"]:
        xp, ypi = np.array(case["xp_measure"], dtype=float), np.array(case["ypi"])
        seen = model.redefine(ypi, xp)
        close(seen.value, case["zeroedyi"])
        close(seen.by_state, case["dzeroedyi_by_dyi"])
        close(seen.by_xpdef, case["dzeroedyi_by_dxp"])
        at = model.point(ypi, np.array([case["lambda"]], dtype=float))
        pose = THREE_D.compose(xp, HALF_TURN)
        local = THREE_D.to_local(pose.x, at.X)
        r = UNIBRAIN.project(local.X, UNIBRAIN.calib0)
        close(r.h, case["hpi"])
        close(r.dh_by_dX @ local.by_xp @ pose.by_a, case["dhpi_by_dxp"], atol=1e-7)
        close(r.dh_by_dX @ local.by_X @ at.dX_by_dy, case["dhpi_by_dyi"], atol=1e-7)


def test_a_ray_that_becomes_a_point(scenelib):
    """By way of an inverse distance; the place and what it depends on are the same."""
    model = RayWithParticles()
    for case in scenelib["partial_feature_model_line_init"]:
        ypi, lam = np.array(case["ypi"]), np.array([case["lambda"]], dtype=float)
        settled = model.settle(ypi, lam)
        became = model.successor().convert(settled.y)
        close(became.y, case["yfi"])
        close(became.dy_by_dy @ settled.dy_by_dy, case["dyfi_by_dypi"])
        close(became.dy_by_dy @ settled.dy_by_dlam, case["dyfi_by_dlambda"])


def test_a_state_on_its_constraint(scenelib):
    """Along the sphere of unit quaternions theirs and the projector are the same."""
    for case in scenelib["impulse_motion_model"]:
        xv = np.array(case["xv"], dtype=float)
        value, J = Impulse().normalise(xv)
        along = np.eye(13)
        along[3:7, 3:7] -= np.outer(xv[3:7], xv[3:7])
        close(value, case["xvnorm"])
        close(J @ along, np.array(case["dxvnorm_by_dxv"]) @ along)
