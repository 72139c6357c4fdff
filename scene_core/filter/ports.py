"""What the filter asks of a world, real or simulated: the only way anything enters it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.policies import Vision
from scene_core.models.base import Shape


@dataclass(frozen=True)
class Control:
    """Controls held over an interval of dt seconds, matched to a motion model by label."""

    dt: float
    labels: tuple[str, ...] = ()
    u: Vec = field(default_factory=lambda: np.zeros(0))
    U: Mat | None = None
    """Covariance of u; None: the motion model's own."""


@dataclass(frozen=True)
class Image:
    """A grey image, uint8 (height, width), read-only."""

    pixels: np.ndarray


@dataclass(frozen=True)
class Points:
    """Measurements z (k, m) of one sensor in one frame, with what identifies them."""

    z: Vec
    ids: np.ndarray | None = None
    """Identities (k,) int; None when the sensor can not tell."""
    R: Mat | None = None
    """Their own covariance (k, m, m); None: the sensor's."""
    lines: Points | None = None
    """Segments seen in the same frame: z (k, 2 m) both ends, with identities of their own."""


Raw = Image | Points


@dataclass(frozen=True)
class Truth:
    """What is really so, as far as it is known; for display and metrics, never for the filter."""

    xp: Mapping[str, Vec]
    """Position state by robot."""
    labels: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """True values of state and calibration components by block name and label."""
    points: Vec = field(default_factory=lambda: np.zeros((0, 3)))
    """True landmarks (K, d)."""
    ids: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    segments: Vec = field(default_factory=lambda: np.zeros((0, 2, 3)))
    """Ends (M, 2, d) of the true line landmarks."""
    segment_ids: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    goals: Mapping[str, Vec] = field(default_factory=dict)
    """Where robots are heading (d,), by robot; those without a goal are left out."""
    bodies: Mapping[str, Mapping[str, Vec]] = field(default_factory=dict)
    """Position state of the further bodies of robots, by robot and hook."""

    def at(self, robot: str, body: str = "base") -> Vec | None:
        """Position state of a body of a robot; None where nobody knows."""
        return self.xp.get(robot) if body == "base" else self.bodies.get(robot, {}).get(body)


@dataclass(frozen=True)
class Frame:
    """All input between the last frame and this one."""

    index: int
    time: float
    """Seconds since the start."""
    dt: float
    """Seconds since the last frame; 0 for the first frame of a recording."""
    controls: Mapping[str, tuple[Control, ...]]
    """By robot, in order; a robot that got none is predicted over dt."""
    raw: Mapping[str, Raw]
    """By mount; only the mounts that fired."""
    internal: Mapping[str, Vec] = field(default_factory=dict)
    """By instrument."""
    truth: Truth | None = None


@dataclass(frozen=True)
class Query:
    """Search these features of one mount, each inside its own ellipse."""

    mount: str
    labels: tuple[int, ...]
    h: Vec
    """Predicted measurements (N, m)."""
    S: Mat
    """Innovation covariances (N, m, m)."""
    gate: float
    """Search where (z - h)' S^-1 (z - h) < gate."""
    appearance: tuple[Any, ...]
    warp: Mat
    """(N, m, m): local affine map from the first view to this one."""
    how: Literal["identity", "search"] = "search"
    """Points: by identity, or the nearest in the gate. Images are always searched."""
    shape: Shape = "point"
    """Of segments h (N, 2 m) are the expected ends."""


@dataclass(frozen=True)
class Match:
    """The best answer to a query for one feature."""

    mount: str
    label: int
    z: Vec | None
    """None: searched and not found."""
    score: float
    """In [-1, 1] for images (NCC), 1 for identities."""
    threshold: float
    """The score that was needed."""
    runner_up: float | None = None
    """Score of the second best separate peak."""
    positions: int = 0
    """How many positions were tried."""
    why: str = ""
    """Reason when not found."""
    R: Mat | None = None
    """The measurement's own covariance, when it brought one."""
    true_z: Vec | None = None
    """Where it really is, when the source knows (simulation): for counting wrong matches."""


@dataclass(frozen=True)
class Detection:
    """A new landmark candidate."""

    z: Vec
    """(m,), or both ends (2 m,) of a segment."""
    appearance: Any
    R: Mat | None = None
    shape: Shape = "point"


@dataclass(frozen=True)
class Occupied:
    """Where the map already has features, so that new ones are looked for elsewhere."""

    h: Vec
    """Predicted measurements (N, m) of all features that should be in view."""
    appearances: tuple[Any, ...]
    """Appearances of all mapped features, so that an identity is not mapped twice."""
    shape: Shape = "point"
    """What is looked for."""


class Source(Protocol):
    """A world the filter looks at. Pure: the same state and index give the same answer."""

    @property
    def frame_count(self) -> int | None:
        """None when it has no end."""
        ...

    @property
    def frame_rate(self) -> float:
        """Nominal frames per second."""
        ...

    def start(self) -> Any:
        """The state before frame 0 (immutable; None for a recording)."""
        ...

    def advance(self, state: Any, index: int) -> tuple[Frame, Any]:
        """Frame `index` and the state after it. Raises EndOfData past the last frame, SourceError
        with a clear sentence when the frame can not be read."""
        ...

    def search(self, frame: Frame, query: Query, vision: Vision) -> Sequence[Match]:
        """One answer per queried label, in order."""
        ...

    def detect(
        self, frame: Frame, mount: str, occupied: Occupied, count: int, vision: Vision
    ) -> Sequence[Detection]:
        """Up to `count` new landmarks of a mount, best first."""
        ...

    def appearance_at(self, frame: Frame, mount: str, z: Vec, vision: Vision) -> Detection | None:
        """A landmark at a place somebody pointed at; None when there is nothing to recognise."""
        ...


class EndOfData(Exception):
    """The recording is over."""


class SourceError(Exception):
    """The input can not be used: the message says what, where and what to do."""
