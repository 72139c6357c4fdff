"""Runs with lines and with partial features, and what the page shows of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from scene_core.filter.policies import Management, Policies
from scene_core.models import registry
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.session.config import (
    EstimatorSettings,
    Experiment,
    MountSettings,
    RobotSettings,
)
from scene_core.session.presets import build
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from scene_core.sources.buildings import CorridorLoop, House
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueMount, TrueRobot
from tests.sources.test_segments import CIRCLE, DISTORTED, SIDEWAYS

MANY = Management(keep_visible=500, max_new=2, max_new_first=8, min_match_ratio=0.1)


def house(line: str = "Plücker line", corridor: bool = False) -> Experiment:
    """The toolbox's run round its house, mapping lines; with points as well in a corridor."""
    policies = Policies(
        landmark=InverseDepth(rho_mean=0.1, rho_sd=0.3, pole="z"),
        line=registry.model_class("features", line)(),
        management=MANY,
    )
    camera = replace(DISTORTED, border=0.0, max_scale=0.0, max_angle=0.0)
    start = {"y": -5.0}
    robot = TrueRobot(Odometry3D(), CIRCLE, start, noise_on="controls")
    return Experiment(
        name="house",
        about="Lines.",
        estimator=EstimatorSettings(
            robots={"robot": RobotSettings(Odometry3D(), start)},
            mounts={"camera": MountSettings(camera, "robot", SIDEWAYS)},
            policies=policies,
        ),
        source=Simulation(
            CorridorLoop() if corridor else House(),
            {"robot": robot},
            {"camera": TrueMount(camera, "robot", SIDEWAYS)},
        ),
    )


def particles() -> Experiment:
    """The cloister with rays that carry particles over their depth."""
    e = build("cloister")
    rays = registry.model_class("features", "ray with particles")(max_depth=12.0)
    policies = replace(e.estimator.policies, landmark=rays)
    return replace(e, estimator=replace(e.estimator, policies=policies))


def run(experiment: Experiment, frames: int) -> Session:
    session = Session(experiment)
    for _ in range(frames):
        session.advance()
    return session


@cache
def shown(kind: str, frames: int = 12) -> Published:
    """What the page is given after some frames of a run."""
    make = {"house": house, "corridor": lambda: house(corridor=True), "particles": particles}
    return Runner(run(make[kind](), frames)).latest
