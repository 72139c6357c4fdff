"""Cameras calibrated with OpenCV: YAML or XML files of cv::FileStorage."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np

from scene_core.filter.ports import SourceError
from scene_core.models.camera import Camera
from scene_core.models.sensors.fisheye import Fisheye
from scene_core.models.sensors.opencv import OpenCV
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.params import ParamError, replace
from scene_core.sources.calibration import Calibration

MATRIX = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K")
DISTORTION = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "D")
WIDTH = ("image_width", "image_Width", "width")
HEIGHT = ("image_height", "image_Height", "height")
RATE = ("fps", "frame_rate")
MODEL = ("distortion_model", "camera_model", "model")
"""What kind of lens the coefficients are of, in words."""
FISHEYE_FLAG = ("fisheye_model",)
"""The same as OpenCV's calibration example writes it."""
PLANAR = ("plumb_bob", "pinhole", "radtan", "brown", "brown_conrady", "opencv")
FISHEYE = ("fisheye", "equidistant", "equi", "kannala_brandt", "kannala_brandt4")


def read_opencv(path: Path, images: Path | None) -> Calibration:
    """The camera of an OpenCV calibration file: "opencv" with k1, k2, p1, p2, k3, "fisheye" with
    k1 to k4 where the file says so, and an ideal pinhole where there is no distortion.

    The principal point and focal lengths are those of the camera matrix. Rational and thin prism
    coefficients must be zero.
    """
    storage = _opened(path)
    K = _matrix(storage, MATRIX, path)
    if K.shape != (3, 3):
        raise SourceError(f"{path}: the camera matrix is {K.shape[0]} x {K.shape[1]}, expected 3x3")
    if K[0, 1] != 0.0:
        raise SourceError(f"{path}: the camera matrix has a skew of {K[0, 1]:g}, expected 0")
    camera, coefficients = _lens(storage, path)
    values = {
        "width": _number(storage, WIDTH, path),
        "height": _number(storage, HEIGHT, path),
        "f_u": K[0, 0],
        "f_v": K[1, 1],
        "u0": K[0, 2],
        "v0": K[1, 2],
        **coefficients,
    }
    try:
        for name, value in values.items():
            camera = replace(camera, name, float(value))
    except ParamError as e:
        raise SourceError(f"{path}: {e}") from e
    rate = _number(storage, RATE, path, required=False)
    return Calibration(
        sensor=camera,
        frame_rate=rate if math.isfinite(rate) else None,
    )


def _opened(path: Path) -> cv2.FileStorage:
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (cv2.error, SystemError, OSError) as e:
        detail = getattr(e, "err", "") or ""
        raise SourceError(
            f"{path} can not be read as an OpenCV calibration{detail and ': ' + detail}; it starts "
            "with %YAML:1.0 and holds camera_matrix, distortion_coefficients, image_width and "
            "image_height"
        ) from e
    if not storage.isOpened():
        raise SourceError(
            f"{path} is not an OpenCV calibration: it starts with %YAML:1.0 and holds "
            "camera_matrix, distortion_coefficients, image_width and image_height"
        )
    return storage


def _node(storage: cv2.FileStorage, names: tuple[str, ...]) -> cv2.FileNode | None:
    for name in names:
        node = storage.getNode(name)
        if not node.empty():
            return node
    return None


def _matrix(
    storage: cv2.FileStorage, names: tuple[str, ...], path: Path, required: bool = True
) -> np.ndarray:
    node = _node(storage, names)
    if node is None:
        if required:
            raise SourceError(f"{path} has no {names[0]} (also known as {', '.join(names[1:])})")
        return np.zeros(0)
    matrix = node.mat()
    if matrix is None or not np.all(np.isfinite(matrix)):
        raise SourceError(f"{path}: {node.name()} is not a matrix of finite numbers")
    return np.asarray(matrix, dtype=np.float64)


def _number(
    storage: cv2.FileStorage, names: tuple[str, ...], path: Path, required: bool = True
) -> float:
    node = _node(storage, names)
    if node is None:
        if required:
            raise SourceError(f"{path} has no {names[0]} (also known as {', '.join(names[1:])})")
        return math.nan
    if not (node.isInt() or node.isReal()):
        raise SourceError(f"{path}: {node.name()} is not a number")
    return float(node.real())


def _lens(storage: cv2.FileStorage, path: Path) -> tuple[Camera, dict[str, float]]:
    """A camera of the file's kind, and its coefficients by name."""
    d = _matrix(storage, DISTORTION, path, required=False).ravel()
    fisheye = _is_fisheye(storage, path)
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    for i in range(len(names), len(d)):
        if d[i] != 0.0:
            raise SourceError(
                f"{path}: distortion coefficient {i + 1} is {d[i]:g}, but only {', '.join(names)} "
                "are supported: calibrate without the rational and the thin prism model"
            )
    if fisheye:
        return Fisheye(), dict(zip(names, [*d, 0.0, 0.0, 0.0, 0.0], strict=False))
    if not d.any():
        return Pinhole(), {}
    return OpenCV(), dict(zip(names, [*d, 0.0, 0.0, 0.0, 0.0, 0.0], strict=False))


def _is_fisheye(storage: cv2.FileStorage, path: Path) -> bool:
    flag = _number(storage, FISHEYE_FLAG, path, required=False)
    node = _node(storage, MODEL)
    if node is None or not node.isString():
        return math.isfinite(flag) and flag != 0.0
    word = node.string().strip().lower().replace(" ", "_").replace("-", "_")
    if word not in PLANAR + FISHEYE:
        raise SourceError(
            f"{path}: {node.name()} = '{node.string()}': known are {', '.join(PLANAR + FISHEYE)}"
        )
    return word in FISHEYE
