"""The scenarios of what is only partly known, or known through another robot: particles and
markers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from scene_core import params
from scene_core.models.features.point_2d import Point2D
from scene_core.models.features.range_ring_2d import PlanarRangeRing
from scene_core.models.features.ray_particles import RayWithParticles
from scene_core.models.motion.double import Double
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.odometry_2d import PlanarOdometry
from scene_core.models.sensors.range_2d import PlanarRange
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.session.config import Experiment, MarkerSettings
from scene_core.session.presets_parts import Scenario, identified, mount, robot, simulated
from scene_core.session.presets_toolbox import cloister
from scene_core.sources.drivers import ConstantControls, Waypoints
from scene_core.sources.truth import TrueMarker
from scene_core.sources.worlds import Field

ABOUT: Mapping[str, str] = {
    "particles": "The cloister with new points as rays of particles: watch a cloud thin out and "
    "become an ellipsoid, then choose inverse depth for new points and reset: the same run, the "
    "other way.",
    "ranges": "A planar robot hears how far beacons are and nothing else: watch rings of particles "
    "become two arcs on either side of its way, and one of them go when it turns.",
    "cooperation": "Of two robots one carries the sensor: watch the ellipse of the blind one grow "
    "while it is out of sight, and shrink when it is seen again.",
    "pair": "The cooperating pair as Scene has it, two robots in one motion model and one state "
    "vector: watch the trail of the second, which has no sensor, leave the true one and jump back "
    "when the first sees it.",
}
CENTRE = (0.0, 0.0, 0.0)
"""Where a sensor of the plane sits on its robot."""


def particles() -> Experiment:
    """Davison's partially initialised features in the toolbox's world."""
    ray = RayWithParticles(
        uniform_in="inverse depth", min_depth=1.0, max_depth=20.0, particles=800,
        min_particles=10,
    )  # fmt: skip
    start = replace(cloister(), name="particles", about=ABOUT["particles"])
    return params.put(start, "estimator.policies.landmark", ray)


def ranges() -> Experiment:
    """Range-only SLAM: round a square among beacons that say who they are."""
    corners = ((3.0, 2.4), (3.0, -2.4), (-3.0, -2.4), (-3.0, 2.4))
    start = {"z": 3.0, "x": 2.4, "phi": -math.pi / 2}
    motion = PlanarOdometry(rot_per_metre=0.02, trans_per_metre=0.05)
    policies = identified(PlanarRangeRing(), 20, new=2, features=60, update="iterated")
    # A beacon stays a ring of two arcs for a whole side of the square.
    policies = replace(policies, management=replace(policies.management, open_attempts=400))
    return simulated(
        "ranges",
        ABOUT["ranges"],
        Field(rows=4, columns=4, step=2.4),
        {"robot": robot(motion, Waypoints(corners), start)},
        {"radio": mount(PlanarRange(sd=0.05, reach_max=6.0), "robot", CENTRE)},
        policies,
        dt=0.2,
        up="y",
    )


def cooperation() -> Experiment:
    """Scene's ETLDouble: a guide that sees, and an assistant that has odometry and nothing else.

    Scene keeps both in one motion model, DOUBLE, as `pair` does; here they are two robots, and the
    lamp on the assistant is a feature of the guide's sensor whose place is a function of the
    assistant's state.
    """
    inner = ((1.6, 1.2), (1.6, -1.2), (-1.6, -1.2), (-1.6, 1.2))
    outer = ((4.4, 3.4), (4.4, -3.4), (-4.4, -3.4), (-4.4, 3.4))
    motion, scanner = PlanarOdometry(), RangeBearing(sd_range=0.05, sd_bearing=0.02, reach_max=3.5)
    there = {
        "guide": (Waypoints(inner), {"z": 1.6, "x": 1.2, "phi": -math.pi / 2}),
        "assistant": (Waypoints(outer), {"z": 4.4, "x": 3.4, "phi": -math.pi / 2}),
    }
    both = simulated(
        "cooperation",
        ABOUT["cooperation"],
        Field(),
        {name: robot(motion, driver, start) for name, (driver, start) in there.items()},
        {"scanner": mount(scanner, "guide", CENTRE)},
        identified(Point2D(), 20, new=5, first=20, features=60, update="iterated"),
        up="y",
        markers={"lamp": TrueMarker("assistant", (0.2, 0.0), 1000)},
    )
    lamp = {"lamp": MarkerSettings("assistant", (0.2, 0.0), 1000)}
    return replace(both, estimator=replace(both.estimator, markers=lamp))


def pair() -> Experiment:
    """Scene's ETLDouble as it was: one motion model of two Nomads, of which the first has the
    sensor. They go round the same place in opposite directions, and meet every 18 s."""
    motion = Double(PlanarNomad(), PlanarNomad(sd_steer=0.3))
    near, far, turn = 0.3 / 1.6, 0.6 / 4.0, 0.5 * math.pi
    u = {"v": 0.3, "dS": 0.1 * near, "dT": 0.1 * near}
    u |= {"2:v": 0.6, "2:dS": -0.1 * far, "2:dT": -0.1 * far}
    start = {"z": 1.6, "S": turn, "T": turn, "2:z": 4.0, "2:S": -turn, "2:T": -turn}
    scanner = RangeBearing(sd_range=0.05, sd_bearing=0.02, reach_max=3.5)
    both = simulated(
        "pair",
        ABOUT["pair"],
        Field(),
        {"pair": robot(motion, ConstantControls(u), start)},
        {"scanner": mount(scanner, "pair", CENTRE)},
        identified(Point2D(), 20, new=5, first=20, features=60, update="iterated"),
        up="y",
        markers={"lamp": TrueMarker("pair", (0.2, 0.0), 1000, "second")},
    )
    lamp = {"lamp": MarkerSettings("pair", (0.2, 0.0), 1000, "second")}
    return replace(both, estimator=replace(both.estimator, markers=lamp))


SCENARIOS: Mapping[str, Scenario] = {
    "particles": Scenario(particles),
    "ranges": Scenario(ranges),
    "cooperation": Scenario(cooperation),
    "pair": Scenario(pair),
}
