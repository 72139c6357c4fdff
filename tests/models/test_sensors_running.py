"""Sensors in the filter: landmarks become better, and as much as the filter says."""

import numpy as np
import pytest

from scene_core.geometry.ellipses import chi2_band
from scene_core.geometry.spaces import TWO_D
from scene_core.models.features.point_3d import EuclideanPoint
from scene_core.models.sensors.bearing_2d import PlanarBearing
from scene_core.models.sensors.depth_camera import DepthCamera
from scene_core.models.sensors.range_2d import PlanarRange
from scene_core.models.sensors.range_bearing_3d import RangeBearingElevation
from scene_core.models.sensors.stereo_head import StereoHead
from scene_core.models.sensors.stereo_pair import StereoPair
from scene_core.session.session import Session
from tests.sensor_worlds import (
    FLU_ON_FLU,
    OPTICAL_ON_FLU,
    SCENE_ON_FLU,
    cloister_seen_by,
    field_seen_by,
)

IMAGE = dict(width=640, height=480, u0=320.0, v0=240.0, f_u=400.0, f_v=500.0)
RUNS = [
    (RangeBearingElevation(sd_range=0.05, sd_azimuth=0.01, sd_elevation=0.01), FLU_ON_FLU),
    (DepthCamera(**IMAGE, max_scale=0.0, max_angle=0.0), OPTICAL_ON_FLU),
    (StereoPair(**IMAGE, max_scale=0.0, max_angle=0.0), OPTICAL_ON_FLU),
    (StereoHead(sd_elevation=0.002), SCENE_ON_FLU),
]


def run(experiment, frames):
    """Errors of the landmarks when they were started and at the end [m], NIS and its band."""
    session = Session(experiment)
    d2, dof, at_birth = 0.0, 0, {}
    for _ in range(frames):
        session.advance()
        trace = session.trace
        assert trace is not None and trace.frame.truth is not None
        true = dict(zip(trace.frame.truth.ids.tolist(), trace.frame.truth.points, strict=True))
        mean = trace.world.gauss.mean
        error = {
            label: float(np.linalg.norm(mean(f.block) - true[f.appearance]))
            for label, f in trace.world.features.items()
        }
        for label, e in error.items():
            at_birth.setdefault(label, e)
        for a in trace.associations():
            if a.verdict == "accepted":
                d2, dof = d2 + a.d2, dof + a.dof
    return list(at_birth.values()), list(error.values()), d2 / dof, chi2_band(1, dof, 0.999)


def rms(errors):
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize(("sensor", "pose"), RUNS, ids=lambda p: getattr(p, "name", ""))
def test_landmarks_started_from_one_view_become_better_and_nis_stays_in_its_band(sensor, pose):
    before, after, nis, (low, high) = run(cloister_seen_by(sensor, pose, EuclideanPoint()), 60)
    assert len(after) > 25
    assert rms(after) < 0.6 * rms(before)
    assert low - 0.05 < nis < high + 0.05


@pytest.mark.parametrize("sensor", [PlanarBearing(), PlanarRange()], ids=lambda s: s.name)
def test_half_a_measurement_improves_landmarks_that_are_roughly_known(sensor):
    before, after, nis, (low, high) = run(field_seen_by(sensor), 60)
    assert rms(after) < 0.6 * rms(before)
    assert low - 0.05 < nis < high + 0.05
    assert sensor.space is TWO_D
