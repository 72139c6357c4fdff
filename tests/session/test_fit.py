"""A lens of another kind that sees the same images."""

import numpy as np
import pytest

from scene_core import params
from scene_core.models.sensors.fisheye import Fisheye
from scene_core.models.sensors.omnidirectional import Omnidirectional
from scene_core.models.sensors.opencv import OpenCV
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.unified import Unified
from scene_core.models.sensors.wide_angle import WideAngle
from scene_core.params import ParamError
from scene_core.session.fit import fitted


@pytest.mark.parametrize("new", [OpenCV(), Fisheye(), Omnidirectional()], ids=lambda m: m.name)
@pytest.mark.parametrize("old", [Pinhole(), WideAngle()], ids=lambda m: m.name)
def test_any_lens_can_take_over_from_a_narrow_one(old, new):
    sensor, rms = fitted(old, new)
    assert type(sensor) is type(new)
    assert rms < 0.2
    assert sensor.image_size == old.image_size
    X = np.array([[0.2, -0.1, 1.0, 0.5], [0.0, 0.3, 1.0, 0.0]])
    h, expected = (s.project(X, s.calib0).h for s in (sensor, old))
    np.testing.assert_allclose(h, expected, atol=0.6)


def test_a_wide_lens_can_take_over_from_a_wider_one():
    fisheye, rms = fitted(Omnidirectional(), Fisheye())
    assert rms < 0.01
    back, rms = fitted(fisheye, Omnidirectional())
    assert rms < 0.01
    np.testing.assert_allclose(back.calib0[2:5], [1.0, 0.0, 0.0], atol=1e-4)


def test_a_fitted_lens_is_one_that_settings_may_have():
    """The fit leaves xi at -3e-16, for it is to be zero."""
    sensor, _ = fitted(Pinhole(f_u=320.0, f_v=320.0), Unified())
    for spec in params.schema(sensor):
        if isinstance(spec.value, float):
            assert params.replace(sensor, spec.path, spec.value) == sensor


def test_no_plane_shows_what_is_behind_it():
    with pytest.raises(ParamError, match="can not see the same images"):
        fitted(Omnidirectional(), Pinhole())
