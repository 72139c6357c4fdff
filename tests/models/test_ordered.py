"""Two limits that exchange places are refused, whichever of the two was moved."""

import dataclasses

import numpy as np
import pytest

from scene_core import params
from scene_core.models import registry
from scene_core.models.features.range_ring_2d import PlanarRangeRing
from scene_core.models.features.ray_particles import RayWithParticles
from scene_core.models.sensors.depth_camera import DepthCamera
from scene_core.params import ParamError

EVERY = [
    cls()
    for kind in ("motion", "sensors", "features", "internal")
    for cls in registry.models(kind).values()
]
PAIRS = [
    (model, *pair)
    for model in EVERY
    for pair in (
        ("reach_min", "reach_max"),
        ("min_depth", "max_depth"),
        ("min_particles", "particles"),
    )
    if all(hasattr(model, name) for name in pair)
]


def test_pairs_are_told_to_forms():
    told = [(m, s.name, s.below) for m in EVERY for s in params.schema(m) if s.below]
    assert sorted(told, key=str) == sorted(PAIRS, key=str)


@pytest.mark.parametrize(
    ("model", "lower", "upper"), PAIRS, ids=lambda v: v if isinstance(v, str) else v.name
)
def test_limits_that_leave_nothing_between_them_are_refused(model, lower, upper):
    low, high = getattr(model, lower), getattr(model, upper)
    with pytest.raises(ParamError, match=f"'{model.name}': {lower} = .* give {lower} from .* or"):
        params.replace(model, lower, high + 1)
    with pytest.raises(ParamError, match=f"{upper} = "):
        dataclasses.replace(model, **{upper: low / 2 if isinstance(low, float) else low - 1})
    assert getattr(params.replace(model, upper, high + 1), upper) == high + 1


def test_the_sentence_names_values_units_and_the_way_out():
    with pytest.raises(ParamError) as caught:
        RayWithParticles(min_depth=5.0)
    assert str(caught.value) == (
        "'ray with particles': min_depth = 5 m is not below max_depth = 5 m: give min_depth from "
        "0.001 to below 5 m, or first raise max_depth (to at most 1e+06 m)"
    )
    with pytest.raises(ParamError, match="min_particles = 800 is above particles = 720"):
        PlanarRangeRing(min_particles=800)


def test_as_many_particles_as_have_to_stay_are_enough_and_a_reach_of_nothing_is_not():
    assert PlanarRangeRing(particles=30, min_particles=30).particles == 30
    with pytest.raises(ParamError, match="reach_min = 8 m is not below reach_max = 8 m"):
        DepthCamera(reach_min=8.0, reach_max=8.0)


@pytest.mark.parametrize(("uniform_in", "spread"), [("depth", "0.476"), ("inverse depth", "0.583")])
def test_a_spread_at_which_new_particles_settle_is_refused(uniform_in, spread):
    ray = RayWithParticles(uniform_in=uniform_in, ratio=0.4)
    assert not ray.settled(np.zeros(6), ray.particles0())
    with pytest.raises(ParamError, match=f"ratio = 0.6 is not below {spread}.*settle at once"):
        params.replace(ray, "ratio", 0.6)
