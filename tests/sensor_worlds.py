"""Small simulated experiments to try any sensor of points in."""

from __future__ import annotations

import numpy as np

from scene_core.filter.policies import Gate, Management, Policies, Selection, Update
from scene_core.models.base import FeatureModel, Sensor
from scene_core.models.features.point_2d import Point2D
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.session.config import (
    EstimatorSettings,
    Experiment,
    KnownFeature,
    MountSettings,
    RobotSettings,
)
from scene_core.sources.drivers import ConstantControls
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueMount, TrueRobot
from scene_core.sources.worlds import Field, ThickCloister

OPTICAL_ON_FLU = (0.0, 0.0, 0.6, 0.5, -0.5, 0.5, -0.5)
"""x right, y down, z forward on a robot with x forward, y left, z up."""
SCENE_ON_FLU = (0.0, 0.0, 0.6, 0.5, 0.5, 0.5, 0.5)
"""x left, y up, z forward on the same robot."""
FLU_ON_FLU = (0.0, 0.0, 0.6, 1.0, 0.0, 0.0, 0.0)


def cloister_seen_by(
    sensor: Sensor, pose: tuple[float, ...], landmark: FeatureModel, seed: int = 0
) -> Experiment:
    """The toolbox's robot on its circle among 72 points, with another sensor."""
    start = {"x": 0.0, "y": -4.0, "z": 0.0}
    policies = Policies(
        landmark=landmark,
        selection=Selection(budget=20),
        gate=Gate(confidence=0.999),
        update=Update("iterated"),
        management=Management(
            keep_visible=500, max_new=5, max_new_first=20, max_features=80, min_attempts=1000
        ),
    )
    return Experiment(
        name="cloister",
        about="",
        estimator=EstimatorSettings(
            robots={"robot": RobotSettings(Odometry3D(), start)},
            mounts={"sensor": MountSettings(sensor, "robot", pose)},
            policies=policies,
            up="z",
        ),
        source=Simulation(
            world=ThickCloister(),
            robots={
                "robot": TrueRobot(
                    Odometry3D(),
                    ConstantControls({"dx": 0.08, "az": 0.02}),
                    start,
                    noise_on="controls",
                )
            },
            mounts={"sensor": TrueMount(sensor, "robot", pose)},
            dt=0.1,
            up="z",
            seed=seed,
        ),
        seed=seed,
    )


def field_seen_by(sensor: Sensor, seed: int = 0) -> Experiment:
    """A planar robot among landmarks that it knows to 0.2 m; it starts none of its own, because
    one measurement of `sensor` does not place them."""
    world = Field(rows=4, columns=4)
    ids, at = world.points()
    stray = np.random.default_rng(seed).normal(scale=0.2, size=at.shape)
    known = tuple(
        KnownFeature(tuple(p), int(i), 0.2) for i, p in zip(ids, (at + stray).tolist(), strict=True)
    )
    start = {"z": 0.5, "x": -1.0, "phi": 0.0}
    policies = Policies(
        landmark=Point2D(),
        selection=Selection(budget=20),
        gate=Gate(confidence=0.999),
        management=Management(keep_visible=0, min_attempts=1000),
    )
    motion = PlanarUnicycle()
    drive = ConstantControls({"v": 0.5, "w": 0.5})
    return Experiment(
        name="field",
        about="",
        estimator=EstimatorSettings(
            robots={"robot": RobotSettings(motion, start)},
            mounts={"sensor": MountSettings(sensor, "robot", (0.0, 0.0, 0.0))},
            policies=policies,
            known=known,
            up="y",
        ),
        source=Simulation(
            world=world,
            robots={"robot": TrueRobot(motion, drive, start, noise_on="controls")},
            mounts={"sensor": TrueMount(sensor, "robot", (0.0, 0.0, 0.0))},
            dt=0.1,
            up="y",
            seed=seed,
        ),
        seed=seed,
    )
