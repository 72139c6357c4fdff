"""The project's own description of a recording: camera, start, known features, estimator.

[camera]                  model = "wide-angle" | "pinhole" | "Civera" | "opencv" | "fisheye" |
                          "omnidirectional", frame_rate_hz, and the model's parameters by name:
                          width, height, u0, v0, f_u, f_v, ...
[mount]                   axes = "x left, y up, z forward": axes of the robot that carries the
                          camera; or those of the camera itself: "x right, y down, z forward"
[world]                   up = "y" or "z"
[start]                   position_m, quaternion_wxyz, velocity_m_per_s,
                          angular_velocity_rad_per_s
[start_sd]                position_m, rotation_rad, velocity_m_per_s,
                          angular_velocity_rad_per_s: one number, or one per axis
[[known_feature]]         position_m, sd_m, patch (an image file)
[estimator.policies...]   any parameter of the estimator by its path
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scene_core.filter.ports import SourceError
from scene_core.models.camera import CentralCamera
from scene_core.models.registry import models
from scene_core.params import ParamError, replace
from scene_core.sources.calibration import AXES, Calibration, KnownPatch, find_patch
from scene_core.sources.toml_text import parsed

START = {
    "position_m": ("x", "y", "z"),
    "quaternion_wxyz": ("qw", "qx", "qy", "qz"),
    "velocity_m_per_s": ("vx", "vy", "vz"),
    "angular_velocity_rad_per_s": ("wx", "wy", "wz"),
}
START_SD = {
    "position_m": ("x", "y", "z"),
    "rotation_rad": ("rx", "ry", "rz"),
    "velocity_m_per_s": ("vx", "vy", "vz"),
    "angular_velocity_rad_per_s": ("wx", "wy", "wz"),
}
NEEDED = ("width", "height", "f_u", "f_v", "u0", "v0", "polynomial")
"""Of a camera, those it has: there is no default that a recording could be made with."""
TABLES = ("about", "camera", "mount", "world", "start", "start_sd", "known_feature", "estimator")


def read_toml(path: Path, images: Path | None) -> Calibration:
    """The recording described by a TOML file; raises SourceError naming file, table and key."""
    try:
        content = parsed(path.read_text(encoding="utf-8"))
    except ValueError as e:
        raise SourceError(f"{path} is not valid TOML: {e}") from e
    _only(path, "", content, TABLES)
    camera = dict(_table(path, content, "camera"))
    rate = camera.pop("frame_rate_hz", None)
    if rate is not None:
        rate = _numbers(path, "camera", "frame_rate_hz", rate, 1)[0]
        if not 0.1 <= rate <= 1000.0:
            raise SourceError(f"{path}, [camera] frame_rate_hz = {rate:g} is outside [0.1, 1000]")
    mount = _table(path, content, "mount")
    world = _table(path, content, "world")
    _only(path, "mount", mount, ("axes",))
    _only(path, "world", world, ("up",))
    known = content.get("known_feature", [])
    if not isinstance(known, list):
        raise SourceError(f"{path}: write known features as [[known_feature]]")
    return Calibration(
        sensor=_camera(path, camera),
        frame_rate=rate,
        pose=AXES[_choice(path, "mount", "axes", mount, tuple(AXES))],
        up=_choice(path, "world", "up", world, ("y", "z")),
        start=_state(path, "start", _table(path, content, "start"), START),
        start_sd=_state(path, "start_sd", _table(path, content, "start_sd"), START_SD),
        known=tuple(_known(path, images, i, k) for i, k in enumerate(known, start=1)),
        settings=_flat(_table(path, content, "estimator")),
    )


def _camera(path: Path, table: dict[str, Any]) -> CentralCamera:
    model = table.pop("model", None)
    # Of images alone: a camera that measures more than pixels finds nothing else in them.
    found = models("sensors").items()
    cameras = {n: c for n, c in found if issubclass(c, CentralCamera) and c.labels == ("u", "v")}
    if not isinstance(model, str) or model not in cameras:
        raise SourceError(f"{path}, [camera] model = {model!r}: choose one of {', '.join(cameras)}")
    camera = cameras[model]()
    for name in NEEDED:
        if hasattr(camera, name) and name not in table:
            raise SourceError(f"{path}, [camera] has no {name}")
    try:
        for name, value in table.items():
            camera = _with(camera, name, value)
    except ParamError as e:
        raise SourceError(f"{path}, [camera] {e}") from e
    return camera


def _with(camera: CentralCamera, name: str, value: Any) -> CentralCamera:
    """A copy with one parameter replaced; the number of distortion coefficients is free."""
    old = getattr(camera, name, None)
    if isinstance(value, list) and isinstance(old, tuple):
        as_many = (*old, *(0.0,) * len(value))[: len(value)]
        camera = type(camera)(**{**vars(camera), name: as_many})
    return replace(camera, name, value)


def _state(
    path: Path, name: str, table: Mapping[str, Any], labels: Mapping[str, tuple[str, ...]]
) -> dict[str, float]:
    _only(path, name, table, tuple(labels))
    out: dict[str, float] = {}
    for key, value in table.items():
        axes = labels[key]
        given = value if isinstance(value, list) or name == "start" else [value] * len(axes)
        numbers = _numbers(path, name, key, given, len(axes))
        if name == "start_sd" and min(numbers) < 0.0:
            raise SourceError(f"{path}, [{name}] {key} = {value}: a standard deviation is >= 0")
        out.update(zip(axes, numbers, strict=True))
    return out


def _known(path: Path, images: Path | None, i: int, table: Mapping[str, Any]) -> KnownPatch:
    name = f"known_feature {i}"
    _only(path, name, table, ("position_m", "sd_m", "patch"))
    x, y, z = _numbers(path, name, "position_m", table.get("position_m"), 3)
    (sd,) = _numbers(path, name, "sd_m", table.get("sd_m", 0.0), 1)
    if sd < 0.0:
        raise SourceError(f"{path}, [{name}] sd_m = {sd:g}: a standard deviation is >= 0")
    patch = table.get("patch")
    if not isinstance(patch, str):
        raise SourceError(f"{path}, [{name}] patch: give the name of an image file")
    return KnownPatch((x, y, z), sd, find_patch(patch, path, images, f"{path}, [{name}]"))


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested tables as dotted paths."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            out |= _flat(value, f"{prefix}{key}.")
        else:
            out[prefix + key] = value
    return out


def _table(path: Path, content: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, Mapping):
        raise SourceError(f"{path}: write [{name}] as a table")
    return table


def _only(path: Path, name: str, table: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key in table:
        if key not in known:
            where = f"[{name}] has" if name else "there is"
            raise SourceError(f"{path}: {where} no key '{key}'; known are {', '.join(known)}")


def _choice(
    path: Path, name: str, key: str, table: Mapping[str, Any], choices: tuple[str, ...]
) -> str:
    value = table.get(key, choices[0])
    if value not in choices:
        raise SourceError(f"{path}, [{name}] {key} = {value!r}: choose one of {'; '.join(choices)}")
    return value


def _numbers(path: Path, name: str, key: str, value: Any, count: int) -> list[float]:
    given = value if isinstance(value, list) else [value]
    good = len(given) == count and all(
        isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v) for v in given
    )
    if not good:
        what = "a finite number" if count == 1 else f"{count} finite numbers"
        raise SourceError(f"{path}, [{name}] {key} = {value!r}: give {what}")
    return [float(v) for v in given]
