"""Lines in the toolbox's own numbers, and where ours are others, how they belong together."""

from functools import partial

import numpy as np
import pytest

from scene_core.geometry.spaces import THREE_D
from scene_core.models import plucker, segments
from scene_core.models.features.anchored_homogeneous_line import AnchoredHomogeneousLine
from scene_core.models.features.anchored_plucker_line import AnchoredPluckerLine
from scene_core.models.features.homogeneous_line import HomogeneousLine
from scene_core.models.features.inverse_depth_line import InverseDepthLine
from scene_core.models.features.plucker_line import PluckerLine
from scene_core.models.sensors.pinhole import Pinhole

close = partial(np.testing.assert_allclose, rtol=1e-9, atol=1e-9)


def rays_by_pixel(k):
    """K with (u, v, 1) ~ K (x, y, z)."""
    u0, v0, f_u, f_v = k
    return np.array([[f_u, 0.0, u0], [0.0, f_v, v0], [0.0, 0.0, 1.0]])


def unit(v, J=None):
    """v / |v|, with its Jacobian when v has the Jacobian J."""
    length = np.linalg.norm(v)
    n = v / length
    return n if J is None else (n, (np.eye(3) - np.outer(n, n)) / length @ J)


def test_plucker_lines_in_another_frame(slamtb):
    ((given, expected),) = slamtb("toFramePlucker")
    seen, tangent = plucker.to_local(given["F"], given["L"]), THREE_D.from_tangent(given["F"])
    close(seen.L, expected["lf"])
    close(seen.by_L, expected["LF_l"])
    close(seen.by_xp @ tangent, expected["LF_f"] @ tangent)
    close(plucker.to_world(given["F"], seen.L).L, given["L"])


def test_the_point_of_a_line_nearest_to_the_origin(slamtb):
    ((given, expected),) = slamtb("pluckerOrigin")
    X = plucker.metres(given["L"])
    close(X[:3] / X[3], expected["p0"])


def test_a_plucker_line_without_its_anchor(slamtb):
    ((given, expected),) = slamtb("unanchorPlucker")
    became = AnchoredPluckerLine(linearity=0.1).convert(given["aL"])
    close(became.y, expected["L"])
    close(became.dy_by_dy, expected["L_al"])
    ((given, expected),) = slamtb("anchorPlucker")
    close(AnchoredPluckerLine(linearity=0.1).convert(expected["aL"]).y, given["L"])


def test_an_anchored_plucker_line_in_the_image(slamtb):
    """Their homogeneous line of the image is K^-T of our normal; by y along the constraint."""
    ((given, expected),) = slamtb("projAplLinIntoPinHoleOnRob")
    y, pose = given["l"], THREE_D.compose(given["Rf"], given["Sf"])
    X, by_y = AnchoredPluckerLine().primitive(y)
    X_S, by_xp, by_X = segments.to_local(THREE_D, pose.x, X)
    n, by_S = segments.normal(X_S)
    K = rays_by_pixel(given["k"])
    free = np.linalg.svd(np.r_[np.zeros(3), y[6:], y[3:6]][None])[2][1:].T
    for ours, theirs, along in (
        (by_S @ by_X @ by_y, "HM_l", free),
        (by_S @ by_xp @ pose.by_a, "HM_r", THREE_D.from_tangent(given["Rf"])),
        (by_S @ by_xp @ pose.by_b, "HM_s", THREE_D.from_tangent(given["Sf"])),
    ):
        wanted, J = unit(K.T @ expected["hm"], K.T @ expected[theirs])
        sign = np.sign(n @ wanted)
        close(sign * n, wanted)
        close(sign * ours @ along, J @ along)


def test_a_plucker_line_of_a_first_view(slamtb):
    """Theirs starts from the plane and two numbers in it, ours from the ends: where they mean the
    same line they are the same six numbers."""
    ((given, expected),) = slamtb("retroProjPlkLinFromPinHoleOnRob")
    xws, l = THREE_D.compose(given["Rf"], given["Sf"]).x, expected["l"]
    a, b, c = given["hm"]
    pixels = np.array([[u, -(a * u + c) / b, 1.0] for u in (100.0, 400.0)])
    r1, r2 = (unit(r) for r in pixels @ np.linalg.inv(rays_by_pixel(given["k"])).T)
    seen = plucker.to_local(xws, l).L
    n = np.cross(r1, r2)
    assert np.isclose(abs(unit(n) @ seen[:3]), 1.0) and np.isclose(np.linalg.norm(seen[:3]), 1.0)
    sign = np.sign(n @ seen[:3])
    A = np.stack([r2, -r1], axis=1) / np.linalg.norm(n)
    w, rest, *_ = np.linalg.lstsq(A, sign * seen[3:], rcond=None)
    close(rest, 0.0)
    close(sign * PluckerLine().initialise(xws, np.r_[r1, w[0], r2, w[1]]).y, l)


@pytest.mark.parametrize(
    ("name", "model", "exact"),
    [
        ("retroProjIdpLinFromPinHoleOnRob", InverseDepthLine(), ("L_seg", "L_k")),
        # Their I / |v| for the Jacobian of v / |v|, and a row too high in the second.
        ("retroProjHmgLinFromPinHoleOnRob", HomogeneousLine(), ()),
        ("retroProjAhmLinFromPinHoleOnRob", AnchoredHomogeneousLine(), ()),
    ],
    ids=lambda x: getattr(x, "name", None),
)
def test_two_points_of_a_first_view(slamtb, name, model, exact):
    ((given, expected),) = slamtb(name)
    pose = THREE_D.compose(given["Rf"], given["Sf"])
    seen = segments.backproject(Pinhole(), given["seg"], given["n"], given["k"])
    start = model.initialise(pose.x, seen.X)
    close(start.y, expected["l"])
    ours = {
        "L_n": start.dy_by_dX @ seen.dX_by_dn,
        "L_seg": start.dy_by_dX @ seen.dX_by_dz,
        "L_k": start.dy_by_dX @ seen.dX_by_dk,
    }
    for theirs in ("L_n", *exact):
        close(ours[theirs], expected[theirs])
    for by_pose, frame, theirs in ((pose.by_a, "Rf", "L_rf"), (pose.by_b, "Sf", "L_sf")):
        tangent = THREE_D.from_tangent(given[frame])
        close(start.dy_by_dxws @ by_pose @ tangent, expected[theirs] @ tangent)


def test_distances_of_ends_on_the_sphere_and_in_the_image(slamtb):
    """nu [rad] is their distance [px], times |(a, b)| over |K' e| and the length of K^-1 (u, v, 1),
    e = (a, b, c) the line."""
    ((given, expected),) = slamtb("innovation_line")
    k, e = np.array([320.0, 240.0, 320.0, 300.0]), given["e"]
    K = rays_by_pixel(k)
    nu = segments.end_distances(Pinhole(), unit(K.T @ e), given["y"], k).nu
    ends = np.c_[given["y"].reshape(2, 2), np.ones(2)]
    rays = np.linalg.norm(ends @ np.linalg.inv(K).T, axis=1)
    close(nu * np.linalg.norm(K.T @ e) * rays / np.linalg.norm(e[:2]), expected["z"])
