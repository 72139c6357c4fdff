"""The scenarios: complete experiments, each with one sentence about what to look at.

Those that play somebody's files are in `presets_recordings` and `presets_identified`; `images`,
`mrclam` and RECORDINGS can be taken from here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from scene_core.filter.policies import Association, Gate, Management, Policies, Selection, Update
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.features.point_1d import Point1D
from scene_core.models.features.point_2d import Point2D
from scene_core.models.internal.gyro import Gyro
from scene_core.models.internal.speed import Speed
from scene_core.models.motion.impulse import Impulse
from scene_core.models.motion.nomad import PlanarNomad
from scene_core.models.motion.odometry_3d import Odometry3D
from scene_core.models.motion.velocity_1d import Velocity1D
from scene_core.models.sensors.distance_1d import Distance1D
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.range_bearing import RangeBearing
from scene_core.models.sensors.wide_angle import WideAngle
from scene_core.params import ParamError
from scene_core.session import presets_recordings
from scene_core.session.config import (
    EstimatorSettings,
    Experiment,
    InstrumentSettings,
    KnownFeature,
    MountSettings,
    RobotSettings,
)
from scene_core.session.presets_identified import ALL
from scene_core.session.presets_identified import RECORDINGS as RECORDINGS
from scene_core.session.presets_recordings import NEEDS
from scene_core.session.presets_recordings import images as images
from scene_core.session.presets_recordings import mrclam as mrclam
from scene_core.sources.drivers import ConstantControls, Shuttle, Waypoints
from scene_core.sources.handheld import HandHeld
from scene_core.sources.render import Rendering
from scene_core.sources.room import TexturedRoom, poster_corners
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueInstrument, TrueMount, TrueRobot
from scene_core.sources.worlds import Field, Line, ThickCloister, landmarks

DEFAULT = "room"
EXAMPLE_EDIT = "estimator.policies.selection.budget=6"


@dataclass(frozen=True)
class Preset:
    """A scenario by name."""

    name: str
    about: str
    make: Callable[[], Experiment] | None
    """None: it needs files."""
    needs: str = ""
    """The flags that name the files."""


def room() -> Experiment:
    """A camera carried through a rendered room, started from the four corners of a poster."""
    camera = WideAngle(
        width=320,
        height=240,
        u0=160.0,
        v0=120.0,
        f_u=195.0,
        f_v=195.0,
        kd1=6e-6,
        # Matches scatter by half of this; one patch's error is much the same from frame to frame.
        sd_px=0.7,
        sd_grows_to_corner=False,
        border=12.0,
    )
    hand, dt = HandHeld(sd_accel=2.0, sd_ang_accel=5.0), 1.0 / 30.0
    motion = Impulse(sd_accel=hand.sd_accel, sd_ang_accel=hand.sd_ang_accel)
    # The truth starts around what the estimator believes, as far off as the estimator says.
    start, start_sd = hand.start(motion, dt), HAND_START_SD
    own_axes = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    policies = Policies(
        landmark=InverseDepth(rho_mean=0.5, rho_sd=0.4, pole="z"),
        selection=Selection(budget=12),
        association=Association("search"),
        gate=Gate(joint=True),
        update=Update("iterated"),
        management=Management(keep_visible=14, max_new=2, max_new_first=8, max_features=150),
    )
    return Experiment(
        name="room",
        about=ABOUT["room"],
        estimator=EstimatorSettings(
            robots={"hand": RobotSettings(motion, start, start_sd)},
            mounts={"camera": MountSettings(camera, "hand", own_axes)},
            policies=policies,
            known=tuple(
                KnownFeature(tuple(float(x) for x in place), f"poster:{i}", 0.001)
                for i, place in enumerate(poster_corners())
            ),
            up="z",
        ),
        source=Simulation(
            # A lively hand must be searched for; a fine repeat is taken for its neighbour.
            world=TexturedRoom(pattern=0.08),
            robots={"hand": TrueRobot(motion, hand, start, start_sd)},
            mounts={"camera": TrueMount(replace(camera, border=0.0), "hand", own_axes)},
            rendering=Rendering(),
            dt=dt,
            up="z",
        ),
    )


def gyro() -> Experiment:
    """A hand-held camera among points that also measures its own turn rate and speed."""
    camera = Pinhole(
        width=320,
        height=240,
        u0=160.0,
        v0=120.0,
        f_u=195.0,
        f_v=195.0,
        border=0.0,
        max_scale=0.0,
        max_angle=0.0,
    )
    hand, dt = HandHeld(), 1.0 / 30.0
    motion = Impulse(sd_accel=hand.sd_accel, sd_ang_accel=hand.sd_ang_accel)
    start, own_axes = hand.start(motion, dt), (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    felt = {"gyro": Gyro(), "speedometer": Speed(sd=0.1)}
    world = ThickCloister()
    places = dict(zip(*(a.tolist() for a in landmarks(world)), strict=True))
    # Three columns in the first view are known: a camera alone can not tell how large the world is.
    known = tuple(KnownFeature(tuple(places[i]), i, 0.01) for i in (7, 8, 9, 43, 44, 45))
    policies = Policies(
        landmark=InverseDepth(rho_mean=0.2, rho_sd=0.3, pole="z"),
        selection=Selection(budget=8),
        management=Management(keep_visible=20, max_new=2, max_new_first=8),
    )
    return Experiment(
        name="gyro",
        about=ABOUT["gyro"],
        estimator=EstimatorSettings(
            robots={"hand": RobotSettings(motion, start, HAND_START_SD)},
            mounts={"camera": MountSettings(camera, "hand", own_axes)},
            policies=policies,
            instruments={i: InstrumentSettings("hand", model) for i, model in felt.items()},
            known=known,
            up="z",
        ),
        source=Simulation(
            world=world,
            robots={"hand": TrueRobot(motion, hand, start, HAND_START_SD)},
            mounts={"camera": TrueMount(camera, "hand", own_axes)},
            instruments={i: TrueInstrument("hand", model) for i, model in felt.items()},
            dt=dt,
            up="z",
        ),
    )


def cloister() -> Experiment:
    """The default experiment of Solà's toolbox (`userData`): a circle in a cloister of 72 points.

    Source: An EKF-SLAM toolbox in Matlab, section 4 and appendix (userData.m).
    """
    camera = Pinhole(
        width=640, height=480, u0=320.0, v0=240.0, f_u=320.0, f_v=320.0,
        distortion=(-0.3, 0.1), sd_px=1.0, border=0.0, max_scale=0.0, max_angle=0.0,
    )  # fmt: skip
    pose = (0.0, 0.0, 0.6, 0.5, -0.5, 0.5, -0.5)
    start = {"x": 0.0, "y": -5.0, "z": 0.0}
    policies = Policies(
        landmark=InverseDepth(rho_mean=0.01, rho_sd=0.5, linearity=0.1, pole="z"),
        selection=Selection(budget=10, score="determinant"),
        association=Association("identity"),
        gate=Gate(confidence=-math.expm1(-4.5)),
        update=Update("iterated"),
        management=Management(
            keep_visible=ALL,
            max_new=1,
            max_new_first=5,
            max_features=73,
            min_attempts=10,
            min_match_ratio=0.1,
            min_accept_ratio=0.5,
        ),
    )
    circle = ConstantControls({"dx": 0.08, "az": math.radians(0.9)})
    return Experiment(
        name="cloister",
        about=ABOUT["cloister"],
        estimator=EstimatorSettings(
            robots={"robot": RobotSettings(Odometry3D(), start)},
            mounts={"camera": MountSettings(camera, "robot", pose)},
            policies=policies,
            up="z",
        ),
        source=Simulation(
            world=ThickCloister(),
            robots={"robot": TrueRobot(Odometry3D(), circle, start, noise_on="controls")},
            # New landmarks keep 1/25 of the width from the border, as in the toolbox.
            mounts={"camera": TrueMount(camera, "robot", pose, margin=640 / 25)},
            dt=0.1,
            up="z",
        ),
        frames=400,
    )


def line() -> Experiment:
    """Scene's one-dimensional tutorial world."""
    policies = Policies(
        landmark=Point1D(),
        selection=Selection(budget=10),
        management=Management(keep_visible=ALL, max_new=2, max_new_first=10, min_match_ratio=0.0),
    )
    return Experiment(
        name="line",
        about=ABOUT["line"],
        estimator=EstimatorSettings(
            robots={"robot": RobotSettings(Velocity1D(), {"z": 0.0})},
            mounts={"range": MountSettings(Distance1D(), "robot", (0.0,))},
            policies=policies,
            up="z",
        ),
        source=Simulation(
            world=Line(),
            robots={"robot": TrueRobot(Velocity1D(), Shuttle(), {"z": 0.0})},
            mounts={"range": TrueMount(Distance1D(), "robot", (0.0,))},
            dt=0.1,
            up="z",
        ),
    )


def nomad() -> Experiment:
    """Scene's planar robot with its velocity scale in the state: truth 0.9, belief 1.0 +- 0.2."""
    sensor = RangeBearing(sd_range=0.05, sd_bearing=0.02, reach_max=4.0)
    corners = ((3.2, 2.4), (3.2, -2.4), (-3.2, -2.4), (-3.2, 2.4))
    policies = Policies(
        landmark=Point2D(),
        selection=Selection(budget=20),
        management=Management(
            keep_visible=ALL, max_new=5, max_new_first=20, max_features=60, min_match_ratio=0.0
        ),
    )
    start = {"z": 3.2, "x": 2.4, "S": -math.pi / 2, "T": -math.pi / 2}
    return Experiment(
        name="nomad",
        about=ABOUT["nomad"],
        estimator=EstimatorSettings(
            robots={"nomad": RobotSettings(PlanarNomad(), start, calib_sd={"speed scale": 0.2})},
            mounts={"scanner": MountSettings(sensor, "nomad", (0.0, 0.0, 0.0))},
            policies=policies,
            up="y",
        ),
        source=Simulation(
            world=Field(),
            robots={
                "nomad": TrueRobot(
                    PlanarNomad(), Waypoints(corners), start, calib={"speed scale": 0.9}
                )
            },
            mounts={"scanner": TrueMount(sensor, "nomad", (0.0, 0.0, 0.0))},
            dt=0.1,
            up="y",
        ),
    )


HAND_START_SD: Mapping[str, float] = {
    **{"x": 0.02, "y": 0.02, "z": 0.02, "rx": 0.01, "ry": 0.01, "rz": 0.01},
    **{"vx": 0.1, "vy": 0.1, "vz": 0.1, "wx": 0.1, "wy": 0.1, "wz": 0.1},
}
"""m, rad, m/s and rad/s: how well a hand knows where it starts."""
ABOUT: Mapping[str, str] = {
    "room": "A camera in somebody's hand looks round a room and comes back to the poster it "
    "started from: watch patches being searched in their ellipses.",
    "cloister": "The toolbox's robot drives a circle among 72 points: watch rays shrink to "
    "ellipsoids, and the error stay inside its bounds.",
    "gyro": "A hand-held camera that also feels how fast it turns and moves: watch the internal "
    "measurements narrow the search ellipses before an image is looked at.",
    "line": "A cart on a line measures six landmarks: the smallest SLAM there is; watch the "
    "covariance matrix fill.",
    "nomad": "A planar robot finds out that it is slower than it believes: its velocity scale is "
    "part of the state and goes from 1.0 to 0.9.",
    **presets_recordings.ABOUT,
}

PRESETS: Mapping[str, Preset] = {
    p.name: p
    for p in (
        Preset("room", ABOUT["room"], room),
        Preset("cloister", ABOUT["cloister"], cloister),
        Preset("gyro", ABOUT["gyro"], gyro),
        Preset("line", ABOUT["line"], line),
        Preset("nomad", ABOUT["nomad"], nomad),
        *(Preset(name, ABOUT[name], None, flags) for name, flags in NEEDS.items()),
    )
}


def loadable() -> tuple[str, ...]:
    """Names of the scenarios that need no file."""
    return tuple(p.name for p in PRESETS.values() if p.make)


def named(name: str) -> Preset:
    """A scenario's entry; raises ParamError for an unknown one."""
    if name not in PRESETS:
        raise ParamError(f"no preset '{name}': choose one of {', '.join(PRESETS)}")
    return PRESETS[name]


def build(name: str) -> Experiment:
    """A scenario by name. Raises ParamError for an unknown one, or one that needs files."""
    preset = named(name)
    if preset.make is None:
        raise ParamError(f"preset '{name}' needs files: start with {preset.needs}")
    return preset.make()
