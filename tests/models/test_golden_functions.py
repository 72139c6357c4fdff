"""The toolbox's small functions in our numbers: frames, directions, pixels with depth, segments."""

from functools import partial

import numpy as np
import pytest

from scene_core.filter.gaussian import Gaussian, Workspace
from scene_core.filter.world import Layout
from scene_core.geometry import quaternion
from scene_core.geometry.ellipses import d2, ellipse_points
from scene_core.geometry.spaces import THREE_D
from scene_core.models import free_body, plucker, radial, segments
from scene_core.models.features.anchored_homogeneous import AnchoredHomogeneous
from scene_core.models.features.homogeneous_line import HomogeneousLine
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.inverse_depth_line import InverseDepthLine
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.features.ray_particles import RayWithParticles
from scene_core.models.sensors.depth_camera import DepthCamera
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.sources.buildings import House
from scene_core.sources.segments import clipped

close = partial(np.testing.assert_allclose, rtol=1e-9, atol=1e-9)


def test_quaternions_and_their_matrices(slamtb):
    ((given, expected),) = slamtb("Rtp")
    turned = quaternion.rotate_back(given["q"], given["p"])
    close(turned.v, expected["rtp"])
    close(turned.by_q, expected["RTP_q"])
    close(turned.by_v, expected["RTP_p"])
    ((given, expected),) = slamtb("w2omega")
    close(quaternion.right_matrix(np.r_[0.0, given["w"]]), expected["Omega"])
    ((given, expected),) = slamtb("q2Qn")
    close(quaternion.right_matrix(given["q"]), expected["Qn"])
    ((given, expected),) = slamtb("q2Pi")
    close(quaternion.left_matrix(given["q"])[:, 1:], expected["Pi"])
    ((given, expected),) = slamtb("R2q")
    close(quaternion.from_matrix(given["R"]), expected["q"])


def test_euler_angles(slamtb):
    for given, expected in slamtb("e2q"):
        close(quaternion.from_euler(*given["e_rpy"]), expected["q"])
    for given, expected in slamtb("q2e"):
        close(quaternion.from_euler(*expected["e_rpy"]), given["q"])
    for given, expected in slamtb("qpose2epose"):
        close(expected["ep"][:3], given["qp"][:3])
        close(quaternion.from_euler(*expected["ep"][3:]), given["qp"][3:])


def test_one_turn_is_exact_where_the_toolbox_s_filter_stops_short(slamtb):
    """It turns by q + q w dt / 2, which is 2 atan(a / 2) about the axis where we turn by a."""
    ((given, expected),) = slamtb("qpredict_tustin")
    theta, q = given["w"] * given["dt"], given["q"]
    ours = free_body.turned(q, theta).q
    back = quaternion.conjugate(q)
    a = np.linalg.norm(theta)
    close(quaternion.to_rotation_vector(quaternion.product(back, ours))[0], theta)
    theirs = quaternion.to_rotation_vector(quaternion.product(back, expected["q1"]))[0]
    close(theirs, theta / a * 2.0 * np.arctan(a / 2.0))


def test_points_and_directions_of_a_frame(slamtb):
    ((given, expected),) = slamtb("toFrameHmg")
    seen = THREE_D.to_local(given["F"], given["hmg"])
    close(seen.X, expected["h"])
    close(seen.by_xp, expected["H_f"])
    close(seen.by_X, expected["H_h"])
    ((given, expected),) = slamtb("fromFrameVec")
    turned = THREE_D.to_world(given["F"], np.r_[given["v"], 0.0])
    close(turned.X[:3], expected["w"])
    close(turned.by_xp[:3], expected["W_f"])
    close(turned.by_X[:3, :3], expected["W_v"])
    ((given, expected),) = slamtb("euc2hmg")
    X, by_y = EuclideanPoint().primitive(given["p"])
    close(X, expected["hmg"])
    close(by_y, expected["HMG_p"])


@pytest.mark.parametrize("model", [RayWithParticles(), AnchoredHomogeneous()])
def test_a_vector_of_unit_length(slamtb, model):
    (given, expected), (_, approximate) = slamtb("normvec")
    y = np.r_[np.zeros(3), given["v"], np.ones(model.state_size - 6)]
    unit = model.normalise(y)
    close(unit.value[3:6], expected["vn"])
    close(unit.jacobian[3:6, 3:6], expected["VN_v"])
    # Their other method is I / |v|.
    across = np.eye(3) - np.outer(expected["vn"], expected["vn"])
    close(across @ approximate["VN_v"], expected["VN_v"])


def test_a_direction_as_pitch_and_yaw(slamtb):
    ((given, expected),) = slamtb("vec2py")
    c, by_m = InverseDepth().coordinates(given["v"])
    close(c, expected["py"])
    close(by_m, expected["PY_v"])


def test_a_place_seen_from_an_anchor(slamtb):
    """Their rho with Jacobians is 1 / d^2, by mistake; all else is as it should be."""
    ((given, expected),) = slamtb("p2idp_withjac_BUG")
    xws = np.r_[given["p0"], 1.0, 0.0, 0.0, 0.0]
    start = InverseDepth().initialise(xws, np.r_[given["p"] - given["p0"], 1.0])
    close(start.y[:5], expected["idp"][:5])
    close(start.y[5] ** 2, expected["idp"][5])
    close(start.dy_by_dX[3:5, :3], expected["IDP_p"][3:5])


def test_a_pixel_with_its_depth(slamtb):
    for given, expected in slamtb("invPinHole"):
        if given["c"].size:
            continue  # their inverse distortion is a fitted polynomial
        b = DepthCamera().backproject(np.r_[given["u"], given["s"]], np.zeros(0), given["k"])
        start = EuclideanPoint().initialise(THREE_D.identity(), b.X)
        close(start.y, expected["p"])
        by_z = start.dy_by_dX @ b.dX_by_dz
        close(by_z[:, :2], expected["P_u"])
        close(by_z[:, 2:], expected["P_s"].reshape(3, 1))
        close(start.dy_by_dX @ b.dX_by_dk, expected["P_k"])


def test_the_fitted_inverse_of_a_distortion_is_fitted_to_ours(slamtb):
    for given, expected in slamtb("invDistortion"):
        u0, v0, f_u, f_v = given["k"]
        r = np.linspace(0.0, 1.1 * np.hypot(u0 / f_u, v0 / f_v), 101)
        d = np.atleast_1d(given["d"])
        r_out = radial.distort(np.c_[r, 0.0 * r], d).p[:, 0]
        A = np.stack([r_out ** (2 * i + 3) for i in range(int(given["n"]))], axis=1)
        close(np.linalg.lstsq(A, r - r_out, rcond=None)[0], expected["c"], rtol=1e-6)


def test_both_ends_of_a_segment(slamtb):
    ((given, expected),) = slamtb("projSegLinIntoPinHoleOnRob")
    pose = THREE_D.compose(given["Rf"], given["Sf"])
    X = np.c_[given["seg"].reshape(2, 3), np.ones(2)]
    seen = THREE_D.to_local(pose.x, X)
    r = DepthCamera().project(seen.X, given["k"])
    close(r.h[:, :2].ravel(), expected["s"])
    close(r.h[:, 2], expected["d"])
    by_pose = (r.dh_by_dX @ seen.by_xp)[:, :2].reshape(4, 7)
    # Off the unit sphere the two routes differ; no filter with a projector sees that.
    for J, xp, theirs in (
        (by_pose @ pose.by_a, given["Rf"], "S_rf"),
        (by_pose @ pose.by_b, given["Sf"], "S_sf"),
    ):
        G = THREE_D.from_tangent(xp)
        close(J @ G, expected[theirs] @ G, atol=1e-7)
    close(r.dh_by_dk[:, :2].reshape(4, 4), expected["S_k"])
    by_ends = (r.dh_by_dX @ seen.by_X)[:, :2, :3]
    close(by_ends[0], expected["S_seg"][:2, :3])
    close(by_ends[1], expected["S_seg"][2:, 3:])


def test_the_place_of_both_points_of_a_line(slamtb):
    ((given, expected),) = slamtb("hmgLin2seg")
    places, P = HomogeneousLine().drawn(given["l"], np.diag(np.arange(1.0, 9.0)), np.arange(2.0))
    close(places.ravel(), expected["s"])
    wanted = expected["S_l"] @ np.diag(np.arange(1.0, 9.0)) @ expected["S_l"].T
    for i, end in enumerate((slice(0, 3), slice(3, 6))):
        close(P[i], wanted[end, end], rtol=1e-6)


def test_a_segment_of_an_inverse_depth_line(slamtb):
    """Their t is even along the line in space, ours as seen from the anchor: the same line."""
    ((given, expected),) = slamtb("idpLinSegment")
    model, ends = InverseDepthLine(), expected["seg"].reshape(2, 3)
    eye = np.array([1.0, -8.0, 3.0])
    X = model.ends(given["l"], model.along(given["l"], eye, ends - eye)).reshape(2, 4)
    close(X[:, :3] / X[:, 3:], ends)


def test_a_plucker_line_in_the_image(slamtb):
    """(u, v, 1) . l = f_u f_v |n| |K^-1 (u, v, 1)| nu for their line l; where nu = 0 so do the
    derivatives."""
    ((given, expected),) = slamtb("pinHolePlucker")
    L, k, (a, b, c) = given["L"], given["k"], expected["l"]
    pixels = np.array([[u, -(a * u + c) / b, 1.0] for u in (100.0, 400.0)])
    X, by_L = plucker.pair(L)
    n, by_X = segments.normal(X)
    nu = segments.end_distances(Pinhole(), n, pixels[:, :2].ravel(), k)
    close(nu.nu, 0.0, atol=1e-12)
    rays = np.c_[(pixels[:, :2] - k[:2]) / k[2:], np.ones(2)]
    scale = k[2] * k[3] * np.linalg.norm(L[:3]) * np.linalg.norm(rays, axis=1)
    scale *= np.sign(n @ L[:3])
    close(scale[:, None] * nu.by_k, pixels @ expected["L_k"], rtol=1e-7)
    along = np.linalg.svd(np.r_[L[3:], L[:3]][None])[2][1:].T
    ours = scale[:, None] * (nu.by_n @ by_X @ by_L @ along)
    close(ours, pixels @ expected["L_l"] @ along, rtol=1e-7, atol=1e-7)


def test_the_line_through_two_pixels(slamtb):
    ((given, expected),) = slamtb("seg2hmgLin")
    k = np.array([320.0, 240.0, 320.0, 300.0])
    seen = segments.backproject(Pinhole(), given["s"], np.ones(2), k)
    n = segments.normal(seen.X).n
    line = np.array([n[0] / k[2], n[1] / k[3], 0.0])
    line[2] = n[2] - line[:2] @ k[:2]
    line, wanted = line / np.linalg.norm(line[:2]), expected["hm"] / np.hypot(*expected["hm"][:2])
    close(line * np.sign(line @ wanted), wanted)
    ((given, expected),) = slamtb("lp2d")
    close((np.r_[given["p"], 1.0] @ wanted), expected["d"])


def test_a_line_cut_to_the_image(slamtb):
    ((given, expected),) = slamtb("trimHmgLin")
    (a, b, c), size = given["hm"], given["imSize"]
    z = np.array([[u, -(a * u + c) / b] for u in (-1e3, 2e3)]).reshape(1, 4)
    ends, there = clipped(z, np.c_[np.zeros(2), size])
    assert there.all()
    close(ends[0], expected["e"])


def test_an_ellipse_of_three_sigma(slamtb):
    ((given, expected),) = slamtb("cov2elli")
    theirs = np.c_[expected["X"].ravel(), expected["Y"].ravel()]
    ours = ellipse_points(given["x"], given["P"], float(given["ns"]), 10)
    for points in (theirs, ours):
        close(d2(points - given["x"], np.broadcast_to(given["P"], (len(points), 2, 2))), 9.0)


def test_a_prediction_touches_only_its_own_rows(slamtb):
    ((given, expected),) = slamtb("predictBlockEkf")
    used = np.flatnonzero(given["used"])
    inside = np.ix_(used, used)
    layout = Layout.of({"robot:r": 3, "feature:1": len(used) - 3})
    work = Workspace(Gaussian(given["x"][used], given["P"][inside], layout))
    rows = given["r"].astype(int)
    noise = given["F_u"] @ given["U"] @ given["F_u"].T
    work.transform(rows, rows, given["F_r"], noise)
    close(work.P, expected["P"][inside])


def test_a_quaternion_of_unit_length_in_the_map(slamtb):
    """Theirs scales its rows of P by 1 / |q|; the projector takes the radial part as well."""
    ((given, expected),) = slamtb("map2rob")
    layout = Layout.of({"robot:r": 7, "feature:1": 1})
    work = Workspace(Gaussian(given["x"], given["P"], layout))
    work.set_block(layout["robot:r"], *THREE_D.normalise(given["x"][:7]))
    close(work.x, expected["x"])
    across, q = np.eye(8), expected["x"][3:7]
    across[3:7, 3:7] -= np.outer(q, q)
    close(work.P, across @ expected["P"] @ across)


def test_the_house_has_the_toolbox_s_segments_in_any_order(slamtb):
    ((given, expected),) = slamtb("house")
    theirs = expected["H"].T.reshape(-1, 2, 3)
    ours = House(**given).segments()
    each = [sorted(tuple(sorted(map(tuple, s.round(9) + 0.0))) for s in x) for x in (theirs, ours)]
    assert each[0] == each[1]
