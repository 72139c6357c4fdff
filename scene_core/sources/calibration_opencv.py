"""Cameras calibrated with OpenCV: YAML or XML files of cv::FileStorage."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np

from scene_core.filter.ports import SourceError
from scene_core.models.sensors.pinhole import Pinhole
from scene_core.params import ParamError, replace
from scene_core.sources.calibration import Calibration

MATRIX = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K")
DISTORTION = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "D")
WIDTH = ("image_width", "image_Width", "width")
HEIGHT = ("image_height", "image_Height", "height")
RATE = ("fps", "frame_rate")


def read_opencv(path: Path, images: Path | None) -> Calibration:
    """The camera of an OpenCV calibration file: a pinhole with d2, d4, d6 = k1, k2, k3.

    The principal point and focal lengths are those of the camera matrix. Tangential (p1, p2),
    rational and thin prism coefficients must be zero.
    """
    storage = _opened(path)
    K = _matrix(storage, MATRIX, path)
    if K.shape != (3, 3):
        raise SourceError(f"{path}: the camera matrix is {K.shape[0]} x {K.shape[1]}, expected 3x3")
    if K[0, 1] != 0.0:
        raise SourceError(f"{path}: the camera matrix has a skew of {K[0, 1]:g}, expected 0")
    camera = Pinhole()
    values = {
        "width": _number(storage, WIDTH, path),
        "height": _number(storage, HEIGHT, path),
        "f_u": K[0, 0],
        "f_v": K[1, 1],
        "u0": K[0, 2],
        "v0": K[1, 2],
    }
    try:
        for name, value in values.items():
            camera = replace(camera, name, float(value))
    except ParamError as e:
        raise SourceError(f"{path}: {e}") from e
    d = _radial(_matrix(storage, DISTORTION, path, required=False).ravel(), path)
    rate = _number(storage, RATE, path, required=False)
    return Calibration(
        sensor=type(camera)(**{**vars(camera), "distortion": d}),
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


def _radial(d: np.ndarray, path: Path) -> tuple[float, ...]:
    """d2, d4, d6 from k1, k2, p1, p2, k3, ...; trailing zeros dropped."""
    refused = {"p1": 2, "p2": 3} | {f"coefficient {i + 1}": i for i in range(5, len(d))}
    for name, i in refused.items():
        if i < len(d) and d[i] != 0.0:
            raise SourceError(
                f"{path}: the distortion has {name} = {d[i]:g}, but only radial distortion is "
                "supported (k1, k2, k3): calibrate with CALIB_ZERO_TANGENT_DIST"
            )
    radial = [float(d[i]) for i in (0, 1, 4) if i < len(d)]
    while radial and radial[-1] == 0.0:
        radial.pop()
    return tuple(radial)
