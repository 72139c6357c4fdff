"""Calibration files: the camera of a recording, and what else is known before its first image.

Three formats are read: OpenCV's YAML, SceneLib2's `.cfg`, and the project's own TOML.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scene_core.filter.ports import SourceError
from scene_core.models.camera import CentralCamera

LEFT_UP = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""x_RS of a camera on a robot with x left, y up, z forward: turned by pi about z."""
RIGHT_DOWN = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""x_RS of a camera on a robot with the camera's own axes."""
AXES = {"x left, y up, z forward": LEFT_UP, "x right, y down, z forward": RIGHT_DOWN}


@dataclass(frozen=True)
class KnownPatch:
    """A landmark given at the start by its place and its picture."""

    position: tuple[float, float, float]
    """World, m."""
    sd: float
    """Standard deviation of every coordinate, m."""
    patch: str
    """Path of an image file, see `vision.load_patch`."""


@dataclass(frozen=True)
class Calibration:
    """What a calibration file says; what it does not say is at its default."""

    sensor: CentralCamera
    frame_rate: float | None = None
    """Hz."""
    pose: tuple[float, ...] = LEFT_UP
    """x_RS of the camera on its robot."""
    up: str = "y"
    start: Mapping[str, float] = field(default_factory=dict)
    """Initial mean by state label (x, y, z, qw, ..., vx, ..., wx, ...)."""
    start_sd: Mapping[str, float] = field(default_factory=dict)
    """Initial standard deviation by state label, orientation as rx, ry, rz; empty: not said."""
    known: tuple[KnownPatch, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Estimator parameters to replace, by path below the experiment's estimator, e.g.
    `policies.selection.budget` or `robots.camera.motion.sd_accel`."""


def load_calibration(path: str | Path, images: str | Path = "") -> Calibration:
    """Read a calibration file; `images` helps to find patch files.

    The patch of a known feature is looked for relative to the calibration file, then to the folder
    of images, then to its parent. Raises SourceError saying what is wrong where, and what to do.
    """
    # The readers import this module for the types above.
    from scene_core.sources.calibration_cfg import read_cfg
    from scene_core.sources.calibration_opencv import read_opencv
    from scene_core.sources.calibration_toml import read_toml

    path = Path(path)
    readers = {
        ".toml": read_toml,
        ".cfg": read_cfg,
        ".yaml": read_opencv,
        ".yml": read_opencv,
        ".xml": read_opencv,
    }
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise SourceError(
            f"{path}: a calibration is an OpenCV .yaml, a SceneLib2 .cfg or a .toml file"
        )
    if not path.is_file():
        raise SourceError(f"there is no calibration file {path}: correct the path after --calib")
    return reader(path, Path(images) if str(images) else None)


def find_patch(name: str, calibration: Path, images: Path | None, where: str) -> str:
    """Path of a patch file that the calibration names; SourceError when it is nowhere."""
    folders = [calibration.parent]
    if images is not None:
        folders += [images, images.parent]
    tried = [folder / name for folder in folders]
    for candidate in tried:
        if candidate.is_file():
            return str(candidate)
    listed = ", ".join(str(t) for t in tried)
    raise SourceError(f"{where}: there is no patch '{name}' (looked for {listed})")
