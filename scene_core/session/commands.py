"""What may be asked of a running session: small immutable values, posted from any thread."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from scene_core.models.plugins import UserFile


@dataclass(frozen=True)
class Transport:
    """Play, pause and single steps; acts between phases."""

    action: Literal["play", "pause", "toggle", "step frame", "step phase", "back", "redo", "reset"]


@dataclass(frozen=True)
class Seek:
    """Go to the end of a frame of the kept history."""

    frame: int


@dataclass(frozen=True)
class SetSpeed:
    """Target speed as a multiple of real time; inf: as fast as possible."""

    factor: float


@dataclass(frozen=True)
class SetParam:
    """Edit one parameter: a path below the experiment, e.g.
    estimator.robots.cam.motion.sd_accel or source.mounts.camera.sensor.sd_px."""

    path: str
    value: Any
    gesture: str = field(default="", compare=False)
    """Edits with the same name of a gesture, such as a press of keys with what follows until all
    are let go, are one step for undo, whatever else is done meanwhile."""


@dataclass(frozen=True)
class SetParams:
    """Edit several parameters in one step, e.g. both limits of a reach, which are refused when the
    lower one is above the upper one."""

    values: tuple[tuple[str, Any], ...]
    """Path and value of each."""


@dataclass(frozen=True)
class Undo:
    """Take back what was done last: an edit from the next frame on; a feature that was deleted or
    started by hand, and a move of the axes, as if it had never been."""


@dataclass(frozen=True)
class Redo:
    """Do again what was undone last: an edit from the next frame on, anything else where it was."""


@dataclass(frozen=True)
class ResetParams:
    """All parameters as the scenario has them."""


@dataclass(frozen=True)
class SwapModel:
    """Replace a model or a policy's kind: role is a path below the experiment that holds a model
    (estimator.robots.cam.motion, estimator.mounts.camera.sensor, estimator.policies.landmark),
    name one of the registry's names."""

    role: str
    name: str


@dataclass(frozen=True)
class LoadPreset:
    """Start another scenario."""

    name: str


@dataclass(frozen=True)
class Select:
    """Select a feature for the whole page; None clears the selection."""

    label: int | None


@dataclass(frozen=True)
class InitialiseAt:
    """Start a feature where somebody clicked; the click carries the frame it was made on."""

    mount: str
    z: tuple[float, ...]
    """The measurement's leading components: as many as the pane shows."""
    frame: int


@dataclass(frozen=True)
class DeleteFeature:
    """Forget a feature at the end of the present frame."""

    label: int


@dataclass(frozen=True)
class ZeroAxes:
    """Put the axes of the whole map where a robot is at the end of the present frame."""

    robot: str


@dataclass(frozen=True)
class ModelsSaved:
    """Files with models of the user's own were saved: what is in use and conforms is swapped to its
    new version."""

    files: tuple[UserFile, ...]
    """All of them, as they are now."""
    said: tuple[str, ...]
    """A sentence about every one that changed."""


@dataclass(frozen=True)
class Abandon:
    """Give up a call of a user's model that does not return: go on from the last good frame with
    the model before it."""


@dataclass(frozen=True)
class Refresh:
    """Show again how things stand."""


Command = (
    Transport
    | Seek
    | SetSpeed
    | SetParam
    | SetParams
    | Undo
    | Redo
    | ResetParams
    | SwapModel
    | LoadPreset
    | Select
    | InitialiseAt
    | DeleteFeature
    | ZeroAxes
    | ModelsSaved
    | Abandon
    | Refresh
)
