"""A camera in somebody's hand: in a rendered room, and with a gyro."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from scene_core.filter.policies import Association, Gate, Management, Policies, Selection, Update
from scene_core.models.features.inverse_depth import InverseDepth
from scene_core.models.internal.gyro import Gyro
from scene_core.models.internal.speed import Speed
from scene_core.models.motion.impulse import Impulse
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.models.sensors.wide_angle import WideAngle
from scene_core.session.config import Experiment, KnownFeature
from scene_core.session.presets_parts import (
    OWN_AXES,
    RobotParts,
    Scenario,
    known_points,
    mount,
    robot,
    seen_from_anywhere,
    simulated,
)
from scene_core.sources.handheld import HandHeld
from scene_core.sources.render import Rendering
from scene_core.sources.room import TexturedRoom, poster_corners
from scene_core.sources.worlds import ThickCloister

ABOUT: Mapping[str, str] = {
    "room": "A camera in somebody's hand looks round a room and comes back to the poster it "
    "started from: watch patches being searched in their ellipses.",
    "gyro": "A hand-held camera that also feels how fast it turns and moves: watch the internal "
    "measurements narrow the search ellipses before an image is looked at.",
}
HAND_START_SD: Mapping[str, float] = {
    **{"x": 0.02, "y": 0.02, "z": 0.02, "rx": 0.01, "ry": 0.01, "rz": 0.01},
    **{"vx": 0.1, "vy": 0.1, "vz": 0.1, "wx": 0.1, "wy": 0.1, "wz": 0.1},
}
"""m, rad, m/s and rad/s: how well a hand knows where it starts."""
RATE = 30.0
"""Images per second."""


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
    eye = mount(camera, "hand", OWN_AXES)
    return simulated(
        "room",
        ABOUT["room"],
        # A repeat fine enough to be taken for its neighbour now and then. A livelier hand
        # (1.5 m/s², 3.5 rad/s²) before a finer one (0.08 m) is lost in 2 of 20 runs.
        TexturedRoom(pattern=0.11),
        {"hand": _hand()},
        {"camera": eye._replace(true=replace(eye.true, sensor=replace(camera, border=0.0)))},
        Policies(
            # Nothing is nearer than 1 m. The error of a depth times that of the way travelled is
            # left out by linearising: with 0.4 one run in 20 is lost before it has any parallax.
            landmark=InverseDepth(rho_mean=0.5, rho_sd=0.25, pole="z"),
            selection=Selection(budget=12),
            association=Association("search"),
            gate=Gate(joint=True),
            update=Update("iterated"),
            management=Management(keep_visible=14, max_new=2, max_new_first=8, max_features=150),
        ),
        known=tuple(
            KnownFeature(tuple(float(x) for x in place), f"poster:{i}", 0.001)
            for i, place in enumerate(poster_corners())
        ),
        dt=1.0 / RATE,
        rendering=Rendering(),
    )


def gyro() -> Experiment:
    """A hand-held camera among points that also measures its own turn rate and speed."""
    world = ThickCloister()
    return simulated(
        "gyro",
        ABOUT["gyro"],
        world,
        {"hand": _hand()},
        {"camera": mount(_pinhole(), "hand", OWN_AXES)},
        Policies(
            landmark=InverseDepth(rho_mean=0.2, rho_sd=0.3, pole="z"),
            selection=Selection(budget=8),
            management=Management(keep_visible=20, max_new=2, max_new_first=8),
        ),
        felt={"gyro": ("hand", Gyro()), "speedometer": ("hand", Speed(sd=0.1))},
        # Three columns: a camera alone can not tell how large the world is.
        known=known_points(world, (7, 8, 9, 43, 44, 45)),
        dt=1.0 / RATE,
    )


def _hand() -> RobotParts:
    """A hand that trembles as much as the estimator expects."""
    driver = HandHeld()
    motion = Impulse(sd_accel=driver.sd_accel, sd_ang_accel=driver.sd_ang_accel)
    return robot(motion, driver, driver.start(motion, 1.0 / RATE), HAND_START_SD)


def _pinhole() -> Pinhole:
    return seen_from_anywhere(
        Pinhole(width=320, height=240, u0=160.0, v0=120.0, f_u=195.0, f_v=195.0, border=0.0)
    )


SCENARIOS: Mapping[str, Scenario] = {
    "room": Scenario(room, frames=900),
    "gyro": Scenario(gyro, frames=450),
}
