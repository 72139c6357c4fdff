"""SceneLib2's configuration file: camera, initial state and known features in `key = value;`."""

from __future__ import annotations

import math
import re
from pathlib import Path

from scene_core.filter.ports import SourceError
from scene_core.models.sensors.wide_angle import WideAngle
from scene_core.params import ParamError, replace
from scene_core.sources.calibration import Calibration, KnownPatch, find_patch

CAMERA = {
    "cam.width": "width",
    "cam.height": "height",
    "cam.fku": "f_u",
    "cam.fkv": "f_v",
    "cam.u0": "u0",
    "cam.v0": "v0",
    "cam.kd1": "kd1",
    "cam.sd": "sd_px",
}
STATE = {
    "state.rw_x": "x",
    "state.rw_y": "y",
    "state.rw_z": "z",
    "state.qwr_w": "qw",
    "state.qwr_x": "qx",
    "state.qwr_y": "qy",
    "state.qwr_z": "qz",
    "state.vw_x": "vx",
    "state.vw_y": "vy",
    "state.vw_z": "vz",
    "state.ww_x": "wx",
    "state.ww_y": "wy",
    "state.ww_z": "wz",
}
SETTINGS = {
    "params.number_of_features_to_select": "policies.selection.budget",
    "params.number_of_features_to_keep_visible": "policies.management.keep_visible",
    "params.max_features_to_init_at_once": "policies.management.max_new",
}
BORDER_PX = 20.0
"""SceneLib2 measures nothing nearer to the border of the image; the file does not say it."""


def read_cfg(path: Path, images: Path | None) -> Calibration:
    """SceneLib2's camera (Davison's wide-angle model), prior, known features and numbers.

    Off-diagonal entries of Pxx must be zero; the variance s^2 of a component qx, qy, qz of the
    quaternion is the variance (2 s)^2 of the angle about that axis. Depth particles have no meaning
    here and are not read.
    """
    keys = _keys(path)
    camera = WideAngle()
    try:
        for key, name in CAMERA.items():
            camera = replace(camera, name, _number(path, keys, key))
        camera = replace(camera, "border", BORDER_PX)
    except ParamError as e:
        raise SourceError(f"{path}: {e}") from e
    start = {label: _number(path, keys, key) for key, label in STATE.items() if key in keys}
    dt = _number(path, keys, "params.delta_t") if "params.delta_t" in keys else 0.0
    if "params.delta_t" in keys and dt <= 0.0:
        raise SourceError(f"{path}: params.delta_t = {dt:g} is no time: give seconds above 0")
    return Calibration(
        sensor=camera,
        frame_rate=1.0 / dt if dt else None,
        start=start,
        start_sd=_start_sd(path, keys),
        known=tuple(_known(path, images, keys)),
        settings={
            setting: int(_number(path, keys, key))
            for key, setting in SETTINGS.items()
            if key in keys
        },
    )


def _keys(path: Path) -> dict[str, tuple[str, int]]:
    """Values as text, with their line numbers."""
    out: dict[str, tuple[str, int]] = {}
    text = path.read_text(encoding="utf-8", errors="replace")
    for number, line in enumerate(text.splitlines(), start=1):
        statement = line.split("#", 1)[0].strip()
        if not statement:
            continue
        match = re.fullmatch(r"([\w.]+)\s*=\s*([^;]*?)\s*;?", statement)
        if match is None:
            raise SourceError(f"{path}, line {number}: '{statement}' is not 'key = value;'")
        out[match[1]] = (match[2], number)
    return out


def _number(path: Path, keys: dict[str, tuple[str, int]], key: str) -> float:
    if key not in keys:
        raise SourceError(f"{path} has no '{key}'")
    text, line = keys[key]
    try:
        value = float(text)
    except ValueError:
        raise SourceError(f"{path}, line {line}: {key} = '{text}' is not a number") from None
    if not math.isfinite(value):
        raise SourceError(f"{path}, line {line}: {key} = {text} is not finite")
    return value


def _start_sd(path: Path, keys: dict[str, tuple[str, int]]) -> dict[str, float]:
    labels = (
        *("x", "y", "z", "", "rx", "ry", "rz"),
        *("vx", "vy", "vz", "wx", "wy", "wz"),
    )
    out: dict[str, float] = {}
    for key in keys:
        index = re.fullmatch(r"state\.pxx(\d+)_(\d+)", key)
        if index is None:
            continue
        i, j, value = int(index[1]), int(index[2]), _number(path, keys, key)
        line = keys[key][1]
        if i != j and value != 0.0:
            raise SourceError(
                f"{path}, line {line}: {key} = {value:g}: only variances can be given, set it to 0"
            )
        if i == j and (value < 0.0 or i >= len(labels)):
            raise SourceError(f"{path}, line {line}: {key} = {value:g} is no variance of the state")
        if i == j and labels[i]:
            out[labels[i]] = math.sqrt(value) * (2.0 if labels[i].startswith("r") else 1.0)
    return out


def _known(path: Path, images: Path | None, keys: dict[str, tuple[str, int]]) -> list[KnownPatch]:
    out = []
    names = sorted({int(m[1]) for k in keys if (m := re.fullmatch(r"f(\d+)\.identifier", k))})
    for n in names:
        x, y, z = (_number(path, keys, f"f{n}.yi_{axis}") for axis in "xyz")
        file, line = keys[f"f{n}.identifier"]
        where = f"{path}, line {line}"
        try:
            patch = find_patch(file, path, images, where)
        except SourceError:
            # The paths in the file are relative to where its program was started.
            patch = find_patch(Path(file).name, path, images, where)
        out.append(KnownPatch((x, y, z), 0.0, patch))
    return out
