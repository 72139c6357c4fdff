"""Small simulated experiments for any models that fit together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from scene_core.filter.policies import Gate, Management, Policies, Selection, Update
from scene_core.models import registry
from scene_core.models.base import FeatureModel, MotionModel, Sensor
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.motion.velocity_1d import Velocity1D
from scene_core.models.pairs import pairs
from scene_core.session.config import EstimatorSettings, Experiment, MountSettings, RobotSettings
from scene_core.sources.drivers import ConstantControls
from scene_core.sources.scattered import RandomPlane, RandomWorld
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueMount, TrueRobot
from scene_core.sources.worlds import Line, SimulatedWorld
from tests.sensor_worlds import FLU_ON_FLU, OPTICAL_ON_FLU

WORLDS: Mapping[str, SimulatedWorld] = {
    "1-D": Line(),
    "2-D": RandomPlane(count=16, extent=3.0),
    "3-D": RandomWorld(count=20, count_segments=10, extent=1.8, length=2.5, layout=3),
}
ROBOTS: Mapping[str, tuple[MotionModel, Mapping[str, float], Mapping[str, float]]] = {
    "1-D": (Velocity1D(), {"v": 0.4}, {"z": -0.5}),
    "2-D": (PlanarUnicycle(sd_w=0.02, sd_v=0.02), {"v": 1.0, "w": 0.3}, {"z": -3.5, "x": -1.0}),
    # Sideways: what a camera sees ahead shows its depth soon.
    "3-D": (Odometry3D(), {"dy": 0.08, "az": -0.015}, {"x": -3.2, "y": -0.6}),
}
MANAGEMENT = Management(
    keep_visible=500, max_new=1, max_new_first=3, max_features=4, min_attempts=1000
)


def sensor_named(name: str) -> Sensor:
    return registry.model_class("sensors", name)()


def landmark_named(name: str) -> FeatureModel:
    return registry.model_class("features", name)()


def a_landmark_for(sensor: Sensor) -> FeatureModel:
    """Some landmark that the sensor starts as a point."""
    found = (landmark_named(p.landmark) for p in pairs() if started(p, sensor=sensor.name))
    return next(model for model in found if model.shape == "point")


def a_starter_of(landmark: FeatureModel) -> Sensor:
    """The sensor that starts such landmarks and leaves least open."""
    found = (sensor_named(p.sensor) for p in pairs() if started(p, landmark=landmark.name))
    return min(found, key=lambda sensor: len(sensor.unmeasured))


def started(pair: object, **named: str) -> bool:
    return getattr(pair, "verdict") == "starts" and all(  # noqa: B009
        getattr(pair, kind) == name for kind, name in named.items()
    )


def forward(sensor: Sensor) -> tuple[float, ...]:
    """A pose on a robot with x forward and z up (on a line, in a plane: z forward) in which the
    middle of what the sensor measures is ahead."""
    if sensor.space.d < 3:
        return (0.0,) * sensor.space.n
    middle = np.array(sensor.limits).mean(axis=1)
    ray = sensor.backproject(middle, np.ones(len(sensor.unmeasured)), sensor.calib0).X
    return FLU_ON_FLU if ray[0] > 0.9 else OPTICAL_ON_FLU


def experiment(landmark: FeatureModel, sensors: Mapping[str, Sensor], first: str) -> Experiment:
    """A robot that knows where it starts, with sensors of the landmark's space; the one called
    `first` fires in frame 0 only when there are others."""
    space = landmark.space.name
    motion, controls, start = ROBOTS[space]
    points, line = (landmark, None) if landmark.shape == "point" else (of_points(), landmark)
    policies = Policies(
        landmark=points,
        line=line,
        selection=Selection(budget=20),
        gate=Gate(confidence=0.999),
        update=Update("iterated"),
        management=MANAGEMENT,
    )
    up = "z" if space == "3-D" else "y"
    alone = len(sensors) == 1
    true = {
        name: TrueMount(sensor, "robot", forward(sensor), every=1 if alone else 1000)
        if name == first
        else TrueMount(sensor, "robot", forward(sensor), offset=1)
        for name, sensor in sensors.items()
    }
    return Experiment(
        name="pair",
        about="",
        estimator=EstimatorSettings(
            robots={"robot": RobotSettings(motion, start)},
            mounts={i: MountSettings(s, "robot", forward(s)) for i, s in sensors.items()},
            policies=policies,
            up=up,
        ),
        source=Simulation(
            world=world_for(landmark),
            robots={
                "robot": TrueRobot(motion, ConstantControls(controls), start, noise_on="controls")
            },
            mounts=true,
            up=up,
        ),
    )


def world_for(landmark: FeatureModel) -> SimulatedWorld:
    """One with nothing but what the landmark can be."""
    world = WORLDS[landmark.space.name]
    if not isinstance(world, RandomWorld):
        return world
    is_point = landmark.shape == "point"
    return replace(world, count=20 * is_point, count_segments=10 * (not is_point))


def of_points() -> FeatureModel:
    """Some landmark in space that is a point."""
    return next(m for m in map(landmark_named, registry.models("features")) if _is_spatial(m))


def _is_spatial(model: FeatureModel) -> bool:
    return model.space.d == 3 and model.shape == "point"
