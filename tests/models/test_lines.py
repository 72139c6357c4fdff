"""What the parametrisations of straight lines have in common, and where they differ."""

from dataclasses import dataclass

import numpy as np
import pytest

from scene_core.geometry.numdiff import central_differences
from scene_core.geometry.spaces import THREE_D
from scene_core.models import plucker, registry, segments
from scene_core.models.check import check
from scene_core.models.features.anchored_homogeneous_line import AnchoredHomogeneousLine
from scene_core.models.features.anchored_plucker_line import AnchoredPluckerLine
from scene_core.models.features.homogeneous_line import HomogeneousLine
from scene_core.models.features.inverse_depth_line import InverseDepthLine
from scene_core.models.features.plucker_line import PluckerLine
from scene_core.models.straight_line import cut

ANCHORED = [InverseDepthLine(), AnchoredHomogeneousLine(), AnchoredPluckerLine()]
LINES = [*ANCHORED, InverseDepthLine(pole="y"), PluckerLine(), HomogeneousLine()]
each_line = pytest.mark.parametrize("model", LINES, ids=lambda m: f"{m.name} {LINES.index(m)}")
rng = np.random.default_rng(3)
POSE = np.r_[rng.standard_normal(3), THREE_D.normalise(rng.standard_normal(7))[0][3:]]
RAYS = np.array([[0.48, -0.36, 0.8], [0.0, 0.28, 0.96]])


def seen(model, rho=(0.4, 0.25), pose=POSE):
    return model.initialise(pose, np.r_[RAYS[0], rho[0], RAYS[1], rho[1]])


def plane(model, y, pose):
    """What a sensor at `pose` sees, and its Jacobian by y."""
    X, by_y = model.primitive(y)
    X_S, _, by_X = segments.to_local(THREE_D, pose, X)
    n, by_S = segments.normal(X_S)
    return n, by_S @ by_X @ by_y


def test_all_kinds_of_lines_are_found():
    found = {c.name for c in registry.models("features").values() if c.shape == "segment"}
    assert found == {m.name for m in LINES}


@each_line
def test_all_start_with_the_same_line_and_the_same_uncertainty(model):
    """Of the plane in which another sensor sees it, to first order, whatever the coordinates."""
    A = THREE_D.from_tangent(POSE) @ rng.standard_normal((6, 6))
    P_pose, P_X = A @ A.T, np.diag([1e-4, 2e-4, 3e-4, 0.01, 2e-4, 1e-4, 2e-4, 0.02])
    elsewhere = np.r_[2.0, -1.0, 0.5, 0.8, 0.0, 0.6, 0.0]

    def expected(model):
        first = seen(model)
        P = first.dy_by_dxws @ P_pose @ first.dy_by_dxws.T + first.dy_by_dX @ P_X @ first.dy_by_dX.T
        n, J = plane(model, first.y, elsewhere)
        return np.outer(n, n), J @ P @ J.T

    for mine, other in zip(expected(model), expected(InverseDepthLine()), strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-8, atol=1e-10)


@each_line
def test_a_line_at_infinity_is_seen_where_it_was_from_anywhere(model):
    y = seen(model, rho=(0.0, 0.0)).y
    moved = POSE + np.r_[3.0, -2.0, 1.0, np.zeros(4)]
    n, J = plane(model, y, moved)
    assert np.isfinite(J).all()
    np.testing.assert_allclose(np.abs(n @ plane(model, y, POSE)[0]), 1.0, atol=1e-12)


@each_line
def test_the_distances_do_not_show_from_the_place_of_the_first_view(model):
    """Whatever they are, behind the sensor and beyond infinity included."""
    first = plane(model, seen(model).y, POSE)[0]
    for rho in ((0.0, 0.7), (2.0, 0.001), (-0.2, 0.3)):
        other = plane(model, seen(model, rho).y, POSE)[0]
        np.testing.assert_allclose(np.abs(first @ other), 1.0, atol=1e-12)


@pytest.mark.parametrize("model", ANCHORED, ids=lambda m: m.name)
def test_an_anchored_line_moves_with_its_anchor(model):
    y = seen(model).y
    shifted = y + np.r_[[1.0, 2.0, 3.0], np.zeros(len(y) - 3)]
    by = np.array([[1.0, 2.0, 3.0]])
    X, moved = (model.primitive(v).X.reshape(2, 4) for v in (y, shifted))
    np.testing.assert_allclose(moved[:, :3], X[:, :3] + X[:, 3:] * by, atol=1e-12)


@pytest.mark.parametrize("normal", [plucker.unit_normal, plucker.orthogonal])
def test_the_constraint_is_imposed_with_its_jacobian(normal):
    """n . v = 0 holds after, lines that obey it keep their place, and the change is the smallest
    in the direction that is free: J takes the gradient of the constraint to zero."""
    L = rng.standard_normal((20, 6))
    after = normal(L)
    np.testing.assert_allclose(np.vecdot(after.L[:, :3], after.L[:, 3:]), 0.0, atol=1e-12)
    numeric = central_differences(lambda L: normal(L).L, (L,), 0)
    np.testing.assert_allclose(after.jacobian, numeric, atol=1e-6)
    proper = after.L
    again = normal(proper)
    np.testing.assert_allclose(again.L, proper, atol=1e-12)
    gradient = np.concatenate([proper[:, 3:], proper[:, :3]], axis=1)
    pressed = (gradient[:, None, :] @ again.jacobian)[:, 0]
    np.testing.assert_allclose(pressed, 0.0, atol=1e-12)


def test_no_line_is_singular():
    """Not one through the origin, at infinity, along an axis or with six equal numbers."""
    eye = np.eye(3)
    some = [np.r_[eye[i], np.zeros(3)] for i in range(3)]
    some += [np.r_[np.zeros(3), eye[i]] for i in range(3)]
    some += [np.r_[1.0, 1.0, -1.0, 1.0, 1.0, 2.0], np.r_[1e-9 * eye[0], eye[1]]]
    L = np.array(some)
    back = plucker.join(plucker.pair(L).X).L
    scale = np.linalg.norm(back, axis=1) / np.linalg.norm(L, axis=1)
    assert (scale > 1.0 / np.sqrt(8.0) * np.abs(L).max(axis=1)).all()
    np.testing.assert_allclose(
        np.abs(np.vecdot(back, L)), np.linalg.norm(back, axis=1) * np.linalg.norm(L, axis=1)
    )


def test_plucker_lines_count_metres_from_the_nearest_point():
    y = np.r_[np.cross([2.0, 0.0, 5.0], [0.0, 0.0, 1.0]), 0.0, 0.0, 1.0]
    X = PluckerLine().ends(y, np.array([-1.0, 3.0])).reshape(2, 4)
    np.testing.assert_allclose(X[:, :3] / X[:, 3:], [[2.0, 0.0, -1.0], [2.0, 0.0, 3.0]])
    toward = np.array([[2.0, 0.0, -1.0], [2.0, 0.0, 3.0]])
    np.testing.assert_allclose(PluckerLine().along(y, np.zeros(3), toward), [-1.0, 3.0])


def test_anchored_plucker_lines_count_angles_from_the_nearest_point():
    """To infinity and, with w < 0, beyond it."""
    model, x0 = AnchoredPluckerLine(), np.array([1.0, -2.0, 3.0])
    y = np.r_[x0, np.cross([2.0, 0.0, 5.0], [0.0, 0.0, 1.0]), 0.0, 0.0, 1.0]
    t = np.array([-np.pi / 4, np.pi / 3])
    X = model.ends(y, t).reshape(2, 4)
    places = X[:, :3] / X[:, 3:] - x0
    np.testing.assert_allclose(places, [[2.0, 0.0, -2.0], [2.0, 0.0, 2.0 * np.sqrt(3.0)]])
    np.testing.assert_allclose(model.along(y, x0, places), t)
    beyond = np.array([[-0.1, 0.0, 1.0], [0.1, 0.0, 1.0]])
    found = model.along(y, x0, beyond)
    np.testing.assert_allclose(found, np.pi / 2 + np.array([1, -1]) * np.arctan(0.1))
    ends = model.ends(y, found).reshape(2, 4)
    assert ends[0, 3] < 0.0 < ends[1, 3]


def test_an_anchored_plucker_line_becomes_a_plucker_line_when_its_distance_is_known():
    model = AnchoredPluckerLine(linearity=0.1)
    y = seen(model).y[None]
    P = np.zeros((1, 9, 9))
    P[0, 6:, 6:] = 0.001**2 * np.eye(3)
    assert model.ready(y, P, POSE)[0] and not model.ready(y, 400.0 * P, POSE)[0]
    assert isinstance(model.successor(), PluckerLine)
    assert AnchoredPluckerLine(linearity=0.0).successor() is None
    report = check(model)
    assert report.ok, str(report)


@each_line
def test_a_measured_end_beside_the_line_is_put_where_the_line_is_nearest(model):
    """Nearest in direction, as seen from there."""
    y, eye = seen(model).y, POSE[:3] + np.array([0.3, 0.1, -0.2])
    X = model.ends(y, np.array([0.2, 0.8]) * model.shown[1]).reshape(2, 4)
    rays = X[:, :3] - X[:, 3:] * eye
    normal = np.cross(rays[0], rays[1])
    beside = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    beside = beside + 0.05 * normal / np.linalg.norm(normal)
    there = model.along(y, eye, beside)
    np.testing.assert_allclose(there, np.array([0.2, 0.8]) * model.shown[1], atol=1e-9)


@each_line
def test_what_is_drawn_has_the_spread_of_samples(model):
    y = seen(model).y
    A = 2e-4 * rng.standard_normal((len(y), len(y)))
    P = A @ A.T
    t = np.array(model.shown)
    at, cov = model.drawn(y, P, t)
    draws = rng.multivariate_normal(y, P, 4000)
    X = model.ends(draws, np.broadcast_to(t, (4000, 2))).reshape(-1, 2, 4)
    places = X[..., :3] / X[..., 3:]
    for end in range(2):
        np.testing.assert_allclose(at[end], places[:, end].mean(axis=0), atol=1e-3)
        sample = np.cov(places[:, end].T)
        np.testing.assert_allclose(cov[end], sample, atol=0.1 * np.trace(sample))


# What follows breaks one promise each. They inherit from concrete models, which nothing else may.


@dataclass(frozen=True)
class MeasuresAlongTheFirst(InverseDepthLine):
    """Right for one line; of many it lays the rays against the first."""

    def along(self, y, origin, rays):
        X = self.primitive(np.atleast_2d(y)[0]).X
        return cut(X, origin, rays)


@dataclass(frozen=True)
class EndsOfTheFirst(InverseDepthLine):
    def ends(self, y, t):
        return super().ends(y, np.broadcast_to(np.atleast_2d(t)[0], np.shape(t)))


@dataclass(frozen=True)
class CountsBackwards(HomogeneousLine):
    def along(self, y, origin, rays):
        return 1.0 - super().along(y, origin, rays)


@dataclass(frozen=True)
class LeavesConstraint(PluckerLine):
    """Imposes n . v = 0, and says that nothing else changed."""

    def normalise(self, y):
        return super().normalise(y)._replace(jacobian=np.broadcast_to(np.eye(6), (*y.shape, 6)))


@pytest.mark.parametrize(
    ("model", "law", "detail"),
    [
        (MeasuresAlongTheFirst, "one by one", "along, result 0"),
        (EndsOfTheFirst, "one by one", "ends, result 0"),
        (CountsBackwards, "same places", "along, towards what ends gave"),
        (LeavesConstraint, "normalise", "dynorm_by_dy"),
    ],
    ids=lambda m: getattr(m, "__name__", ""),
)
def test_a_line_that_breaks_a_promise_is_found_and_named(model, law, detail):
    report = check(model)
    failed = [line for line in report.lines if not line.ok and law in line.law]
    assert failed, str(report)
    assert any(detail in line.detail for line in failed), str(report)
