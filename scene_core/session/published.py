"""What a session shows to the outside: one immutable value, replaced after every change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from scene_core.arrays import Vec
from scene_core.filter.records import Event, Trace
from scene_core.models.plugins import UserFile
from scene_core.session.alignment import Similarity
from scene_core.session.config import Experiment


@dataclass(frozen=True)
class RobotSeries:
    """History of a body of a robot, one row per kept frame; NaN where the robot had none such."""

    labels: tuple[str, ...]
    """Tangent components: x, y, z, rx, ry, rz (3-D); z, x, phi (2-D); z (1-D)."""
    units: tuple[str, ...]
    position: Vec
    """(T, 3) estimated position, embedded in 3-D; all of them in the present axes."""
    true_position: Vec | None
    """(T, 3), NaN where unknown; None without truth."""
    error: Vec | None
    """(T, tangent) estimate minus truth on the tangent."""
    sd: Vec
    """(T, tangent) the filter's own standard deviations."""
    nees: Vec | None
    """(T,)"""
    nees_dof: int
    nees_band: tuple[float, float]
    """95 % interval of one NEES value."""
    alignment: Similarity | None = None
    """How the truth was moved into the estimate's axes, those the run began in; None: it is in
    them."""
    robot: str = ""
    body: str = "base"
    """Its hook of the robot."""


@dataclass(frozen=True)
class Series:
    """Histories for the plots; rows are frames."""

    frames: Vec
    """(T,) frame numbers."""
    times: Vec
    """(T,) seconds."""
    robots: Mapping[str, RobotSeries]
    """Of every body that there is in the last row, by `body_name`."""
    nis: Vec
    """(T,) mean over the frame of d2 of the matches that were put to the gate, per degree of
    freedom; NaN without any."""
    nis_band: Vec
    """(T, 2) 95 % interval of that mean, from its number of degrees of freedom."""
    ms: Mapping[str, Vec]
    """(T,) milliseconds by phase."""
    landmarks: Vec
    """(T,) features in the map."""
    calibrations: Mapping[str, tuple[Vec, Vec, Vec | None]] = field(default_factory=dict)
    """Estimated calibration components, e.g. "robot:nomad:calib speed scale": mean (T,), sd (T,),
    true value (T,) where known."""


@dataclass(frozen=True)
class Light:
    """The consistency light."""

    state: Literal["consistent", "overconfident", "cautious", "unknown"]
    text: str
    """E.g. NEES 5.8 in 1.24 to 14.45 (6 DoF)."""


@dataclass(frozen=True)
class Failure:
    """Why a run paused by itself."""

    text: str
    """One clear sentence: what, where, what to do."""
    details: str = ""
    """Traceback, only for a user's own model."""


@dataclass(frozen=True)
class Busy:
    """A call of a user's model that takes long."""

    model: str
    method: str
    seconds: int


@dataclass(frozen=True)
class RoleOptions:
    """One row of the Models tab."""

    role: str
    """Path below the experiment, for SwapModel."""
    title: str
    current: str
    options: tuple[str, ...]


@dataclass(frozen=True)
class Published:
    """The session as it stands. Readers keep the reference; nothing in it ever changes."""

    seq: int
    """Grows with every publication."""
    run: int
    """Grows when a scenario is loaded or reset: everything drawn must be rebuilt."""
    experiment: Experiment
    """Settings in force."""
    pending: Experiment | None
    """Edited settings that come into force with the next frame; None when there are none."""
    base: Experiment
    """The scenario's own settings, to mark what was changed."""
    roles: tuple[RoleOptions, ...]
    presets: tuple[str, ...]
    mode: Literal["playing", "paused", "finished"]
    trace: Trace | None
    """The frame that was last computed (or is being stepped through); None before the first."""
    first_frame: int
    last_frame: int
    """Kept history for seek; -1 before the first frame."""
    frame_count: int | None
    speed: float
    real_time_factor: float
    series: Series
    light: Light
    events: tuple[Event, ...]
    """Newest first, at most 200."""
    message: str
    """What the last command did, e.g. what a swap kept."""
    failure: Failure | None
    selected: int | None
    can_undo: bool
    can_redo: bool
    files: tuple[UserFile, ...] = ()
    """The user's own files with models, as they were last saved."""
    busy: Busy | None = None
    """What the estimator has been waiting for, for more than two seconds."""
