"""Every model keeps the promises of its base class, and the check notices one that does not."""

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest

from scene_core import params
from scene_core.models import registry
from scene_core.models.base import (
    Innovation,
    Lifted,
    MotionModel,
    Projection,
    Redefined,
    Transition,
)
from scene_core.models.check import check
from scene_core.models.features.anchored_homogeneous import AnchoredHomogeneous
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.guard import guarded
from scene_core.models.internal.speed import Speed
from scene_core.models.motion.ackermann import PlanarAckermann
from scene_core.models.motion.double import Double
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.inertial import Inertial
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.sensors.civera import Civera
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.models.sensors.wide_angle import WideAngle

BUILT_IN = [cls for kind in registry.KINDS for cls in registry.models(kind).values()]
DESK = Civera(
    width=640, height=480, u0=308.65, v0=236.54, f_u=525.06, f_v=524.25,
    k1=-7.613e-3, k2=9.388e-4, dx_mm=0.00702, dy_mm=0.00703,
)  # fmt: skip
TOOLBOX = Pinhole(width=640, height=480, u0=320, v0=240, f_u=320, f_v=320, distortion=(-0.3, 0.1))
VARIANTS = [
    TOOLBOX,
    dataclasses.replace(TOOLBOX, distortion=(0.2,)),
    dataclasses.replace(TOOLBOX, distortion=(-0.25, 0.1, -0.01)),
    DESK,
    WideAngle(kd1=0.0),
    WideAngle(kd1=-2e-6, sd_grows_to_corner=False),
    RangeBearing(field_of_view=1.0, reach_min=0.5),
    Impulse(noise_per="step", sd_accel=0.05, sd_ang_accel=0.05),
    InverseDepth(pole="y"),
]


@pytest.mark.parametrize("model", BUILT_IN, ids=lambda c: c.name)
def test_built_in_models_conform(model):
    report = check(model)
    assert report.ok, str(report)


@pytest.mark.parametrize("model", VARIANTS, ids=lambda m: f"{m.name} {VARIANTS.index(m)}")
def test_models_conform_with_other_parameters(model):
    report = check(model, seed=1)
    assert report.ok, str(report)


@pytest.mark.parametrize("model", BUILT_IN, ids=lambda c: c.name)
def test_every_parameter_explains_itself(model):
    for spec in params.schema(model()):
        assert spec.help, f"{model.name}.{spec.name} has no help text"
        if isinstance(spec.value, float):
            assert spec.lo is not None, spec.name
            assert spec.hi is not None, spec.name
            assert spec.lo <= spec.value <= spec.hi, spec.name
            if spec.soft:
                assert spec.lo <= spec.soft[0] < spec.soft[1] <= spec.hi, spec.name


# What follows breaks one promise each. They inherit from concrete models, which nothing else may.


@dataclass(frozen=True)
class WrongSign(PlanarUnicycle):
    def f(self, xv, u, dt, k):
        t = super().f(xv, u, dt, k)
        return t._replace(dfv_by_dxv=t.dfv_by_dxv * [[1, 1, -1], [1, 1, 1], [1, 1, 1]])


@dataclass(frozen=True)
class WrongShape(PlanarUnicycle):
    def f(self, xv, u, dt, k):
        return super().f(xv, u, dt, k)._replace(dfv_by_du=np.zeros((3, 3)))


@dataclass(frozen=True)
class NanAtRest(Impulse):
    def f(self, xv, u, dt, k):
        t = super().f(xv, u, dt, k)
        rest = not xv[10:].any()
        return t._replace(dfv_by_dxv=t.dfv_by_dxv * (np.nan if rest else 1.0))


@dataclass(frozen=True)
class Overconfident(Impulse):
    def Q(self, xv, u, dt, k):
        return 0.5 * super().Q(xv, u, dt, k)


@dataclass(frozen=True)
class LeavesVelocityBehind(Impulse):
    def redefine(self, xv, xpdef):
        r = super().redefine(xv, xpdef)
        value, by_state, by_xpdef = r.value.copy(), r.by_state.copy(), r.by_xpdef.copy()
        value[7:10], by_state[7:10, 7:10], by_xpdef[7:10] = xv[7:10], np.eye(3), 0.0
        return Redefined(value, by_state, by_xpdef)


@dataclass(frozen=True)
class LiftsElsewhere(PlanarUnicycle):
    def lift(self, xp):
        return Lifted(xp + 1.0, np.eye(3), np.zeros((3, 3)))


@dataclass(frozen=True)
class SteersAway(PlanarUnicycle):
    def navigate(self, xv, goal, dt):
        u = super().navigate(xv, goal, dt)
        return u if u is None else u * [1.0, -1.0]


@dataclass(frozen=True)
class BacksOff(PlanarUnicycle):
    def navigate(self, xv, goal, dt):
        u = super().navigate(xv, goal, dt)
        return u if u is None else -u


@dataclass(frozen=True)
class ArrivesAtOnce(PlanarUnicycle):
    def navigate(self, xv, goal, dt):
        return None


@dataclass(frozen=True)
class TwoControlsForThree(PlanarNomad):
    def navigate(self, xv, goal, dt):
        u = super().navigate(xv, goal, dt)
        return u if u is None else u[:2]


@dataclass(frozen=True)
class NeverBrakes(PlanarAckermann):
    def stay(self, xv, dt):
        return np.zeros(2)


@dataclass(frozen=True)
class Falls(Inertial):
    def stay(self, xv, dt):
        return np.zeros(6)


@dataclass(frozen=True)
class ScalarNormalisation(Impulse):
    """The ancestors' Jacobian of q / |q|."""

    def normalise(self, xv):
        r = super().normalise(xv)
        J = np.eye(13)
        J[3:7, 3:7] /= np.linalg.norm(xv[3:7])
        return r._replace(jacobian=J)


@dataclass(frozen=True)
class Raises(Pinhole):
    def project(self, X, k):
        raise RuntimeError("no film")


@dataclass(frozen=True)
class ForgetsDistortion(Pinhole):
    def project(self, X, k):
        p = super().project(X, k)
        by_k = p.dh_by_dk.copy()
        by_k[..., 4] *= 0.99
        return Projection(p.h, p.dh_by_dX, by_k)


@dataclass(frozen=True)
class LongRays(Pinhole):
    def backproject(self, z, n, k):
        b = super().backproject(z, n, k)
        return b._replace(X=1.5 * b.X)


@dataclass(frozen=True)
class ScalarRays(Pinhole):
    """SceneLib's derivative of v / |v| (it takes the norm squared for the norm)."""

    def backproject(self, z, n, k):
        b = super().backproject(z, n, k)
        return b._replace(dX_by_dz=1.1 * b.dX_by_dz)


@dataclass(frozen=True)
class DoesNotWrap(RangeBearing):
    def nu(self, h, z):
        return Innovation(z - h, -np.eye(2), np.eye(2))


@dataclass(frozen=True)
class RelativeError(RangeBearing):
    def nu(self, h, z):
        nu = super().nu(h, z).nu
        return Innovation(nu / [2.0, 1.0], -np.diag([0.5, 1.0]), np.diag([0.5, 1.0]))


@dataclass(frozen=True)
class BentError(RangeBearing):
    """Says nothing of its Jacobians."""

    def nu(self, h, z):
        nu = super().nu(h, z).nu
        nu[..., 0] += 0.5 * nu[..., 0] ** 2
        return Innovation(nu)


@dataclass(frozen=True)
class QuietNoise(RangeBearing):
    def h_noisy(self, X, k, rng):
        h = self.project(X, k).h
        return h + 0.5 * (super().h_noisy(X, k, rng) - h)


@dataclass(frozen=True)
class OneByOne(EuclideanPoint):
    def primitive(self, y):
        p = super().primitive(np.atleast_2d(y)[0])
        shape = np.shape(y)[:-1]
        return p._replace(X=np.broadcast_to(p.X, (*shape, 4)))


@dataclass(frozen=True)
class DepthAlongZ(InverseDepth):
    """Converts as if rho were inverse depth along the pole."""

    def convert(self, y):
        c = super().convert(y)
        return c._replace(y=c.y + 0.01)


@dataclass(frozen=True)
class ForgetsScale(AnchoredHomogeneous):
    """Puts its vector back to length one, and says that nothing else changed."""

    def normalise(self, y):
        return super().normalise(y)._replace(jacobian=np.eye(7))


@dataclass(frozen=True)
class Asymmetric(Speed):
    def R(self, hv):
        return np.array([[-1.0]])


BROKEN = [
    (WrongSign, "f has", "dfv_by_dxv[0, 2]"),
    (WrongShape, "f has", "shape (3, 3), not (3, 2)"),
    (NanAtRest, "f has", "dfv_by_dxv is not finite"),
    (Overconfident, "f_noisy", "draws"),
    (LeavesVelocityBehind, "commute", "off by"),
    (LiftsElsewhere, "lift", "off by"),
    (SteersAway, "comes to a goal", "s it is"),
    (BacksOff, "comes to a goal", "s it is"),
    (ArrivesAtOnce, "comes to a goal", "arrived, it says, and is 8"),
    (TwoControlsForThree, "comes to a goal", "navigate has shape (2,), not (3,)"),
    (NeverBrakes, "stay brings it to rest", "it still moves at"),
    (Falls, "stay brings it to rest", "it still moves at 2"),
    (ScalarNormalisation, "normalise", "dxvnorm_by_dxv"),
    (Raises, "project", "RuntimeError: no film"),
    (ForgetsDistortion(distortion=(-0.2,)), "project has", "dh_by_dk"),
    (LongRays, "backproject", "length of the ray"),
    (ScalarRays, "backproject", "dX_by_dz"),
    (DoesNotWrap, "wrap", "full turn"),
    (RelativeError, "nu is z - h", "dnu_by_dz is off by 0.5: it has to be I, because"),
    (BentError, "nu is z - h", "put what bends it into project"),
    (QuietNoise, "h_noisy", "draws"),
    (OneByOne, "one by one", "off by"),
    (DepthAlongZ, "convert", "off by"),
    (ForgetsScale, "normalise", "dynorm_by_dy"),
    (Asymmetric, "R is", "negative eigenvalue"),
]


@pytest.mark.parametrize(
    ("model", "law", "detail"), BROKEN, ids=lambda m: getattr(m, "__name__", "")
)
def test_a_broken_promise_is_found_and_named(model, law, detail):
    report = check(model)
    assert not report.ok
    failed = [line for line in report.lines if not line.ok and law in line.law]
    assert failed, str(report)
    assert any(detail in line.detail for line in failed), str(report)


def test_jacobians_left_to_numbers_are_no_offence():
    @dataclass(frozen=True)
    class FirstDraft(PlanarUnicycle):
        def f(self, xv, u, dt, k):
            return Transition(super().f(xv, u, dt, k).fv)

    assert check(FirstDraft).ok


@dataclass(frozen=True)
class Wanders(PlanarUnicycle):
    """Has controls and knows no way."""

    navigate = MotionModel.navigate


def test_a_model_says_whether_it_steers_by_itself():
    assert PlanarUnicycle().navigates and guarded(PlanarUnicycle)().navigates
    for model in (Wanders(), guarded(Wanders)(), Impulse(), Double(PlanarUnicycle(), Wanders())):
        assert not model.navigates
        assert check(model).ok, str(check(model))


@pytest.mark.parametrize("arrive", [0.75, 2.0, 5.0])
def test_a_large_robot_may_count_a_goal_as_reached_from_afar(arrive):
    report = check(PlanarUnicycle(arrive=arrive))
    assert report.ok, str(report)


def test_something_that_is_no_model_is_refused():
    with pytest.raises(TypeError, match="not a model"):
        check(object())
