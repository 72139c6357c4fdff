"""Models are found by name, and pairs that make no sense are refused with a reason."""

import pytest

from scene_core.models import registry
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_1d import Point1D
from scene_core.models.features.point_2d import Point2D
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.internal.gyro import Gyro
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.sensors.distance_1d import Distance1D
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing

NAMES = {
    "motion": {"1-D velocity", "planar nomad", "planar unicycle", "6-DoF odometry", "impulse"},
    "sensors": {"1-D distance", "range-bearing", "pinhole", "wide-angle", "Civera"},
    "features": {"1-D point", "2-D point", "Euclidean point", "inverse depth"},
    "internal": {"gyro", "speed"},
}


@pytest.mark.parametrize("kind", NAMES)
def test_the_built_in_models_are_found(kind):
    assert NAMES[kind] <= set(registry.models(kind))
    for name, cls in registry.models(kind).items():
        assert cls.name == name
        assert registry.kind_of(cls()) == kind
        assert registry.model_class(kind, name) is cls


def test_abstract_classes_are_no_models():
    assert "Camera" not in {cls.__name__ for cls in registry.models("sensors").values()}


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(KeyError, match="impulse"):
        registry.model_class("motion", "teleport")


@pytest.mark.parametrize(
    ("sensor", "feature"),
    [
        (Distance1D(), Point1D()),
        (RangeBearing(), Point2D()),
        (Pinhole(), InverseDepth()),
    ],
)
def test_pairs_that_can_start_a_feature(sensor, feature):
    assert registry.compatible(sensor, feature) is None
    assert registry.observable(sensor, feature) is None


def test_a_camera_alone_can_not_start_a_euclidean_point_but_can_see_one():
    reason = registry.compatible(Pinhole(), EuclideanPoint())
    assert reason is not None
    assert "leaves rho open" in reason
    assert registry.observable(Pinhole(), EuclideanPoint()) is None


def test_spaces_must_agree():
    reason = registry.compatible(RangeBearing(), EuclideanPoint())
    assert reason == "'range-bearing' measures 2-D points, 'Euclidean point' is a 3-D point"


def test_a_planar_robot_carries_a_camera_and_not_the_reverse():
    assert registry.carriable(PlanarUnicycle(), Pinhole()) is None
    assert "fewer dimensions" in (registry.carriable(Impulse(), RangeBearing()) or "")


def test_a_gyro_needs_a_model_with_angular_velocity():
    assert registry.runs_on(Gyro(), Impulse()) is None
    assert "wx, wy, wz" in (registry.runs_on(Gyro(), Odometry3D()) or "")
