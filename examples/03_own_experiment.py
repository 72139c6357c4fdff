"""Build an experiment from its parts: a robot, a sensor, a world, and what the filter believes.

A unicycle drives a square among four rows of posts, with a scanner that looks 2 m ahead of it.
Run it with `.venv/bin/python examples/03_own_experiment.py [FRAMES]`.
"""

from __future__ import annotations

import sys

from scene_core.filter.policies import Management, Policies, Selection
from scene_core.models.features.point_2d import Point2D
from scene_core.models.motion.unicycle import PlanarUnicycle
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.session import toml_io
from scene_core.session.config import EstimatorSettings, Experiment, MountSettings, RobotSettings
from scene_core.session.session import Session
from scene_core.sources.drivers import Waypoints
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueMount, TrueRobot
from scene_core.sources.worlds import Field

SQUARE = ((2.0, 2.0), (2.0, -2.0), (-2.0, -2.0), (-2.0, 2.0))
"""Corners (z, x) [m]."""


def experiment() -> Experiment:
    motion = PlanarUnicycle(sd_v=0.05, sd_w=0.1)
    scanner = RangeBearing(sd_range=0.03, sd_bearing=0.01, reach_max=5.0, field_of_view=3.0)
    start = {"z": -2.0, "x": 2.0, "phi": 0.0}
    in_front = (0.2, 0.0, 0.0)  # the scanner's (z, x, phi) on the robot
    return Experiment(
        name="square",
        about="A unicycle drives a square and looks ahead.",
        estimator=EstimatorSettings(
            robots={"cart": RobotSettings(motion, start)},
            mounts={"scanner": MountSettings(scanner, "cart", in_front)},
            policies=Policies(
                landmark=Point2D(),
                selection=Selection(budget=8),
                management=Management(keep_visible=100, max_new=3, max_new_first=10),
            ),
        ),
        # The truth has its own robot and its own sensor; make them differ and see what happens.
        source=Simulation(
            world=Field(),
            robots={"cart": TrueRobot(motion, Waypoints(SQUARE), start)},
            mounts={"scanner": TrueMount(scanner, "cart", in_front)},
            dt=0.1,
        ),
    )


def main(frames: int = 300) -> None:
    square = experiment()
    session = Session(square)
    for _ in range(frames):
        session.advance()
    xv = session.world.gauss.mean("robot:cart")
    truth = session.trace.frame.truth if session.trace else None
    assert truth is not None
    print(f"after {frames} frames: {len(session.world.features)} landmarks")
    for label, estimate, true in zip(("z", "x", "phi"), xv, truth.xp["cart"], strict=True):
        print(f"  {label:<4}estimate {estimate:+.3f}  truth {true:+.3f}")
    lines = toml_io.dumps(square).count("\n")
    print(f"as a settings file for --config it has {lines} lines (toml_io.dumps)")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
