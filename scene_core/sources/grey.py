"""Image files as grey images of 8 bits."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from scene_core.filter.ports import SourceError


def read_grey(path: str | Path) -> np.ndarray:
    """The image file as uint8 (height, width), read-only.

    Raises SourceError naming the file when it is missing or no image.
    """
    try:
        data = np.fromfile(path, dtype=np.uint8)
    except OSError as e:
        raise SourceError(f"the image {path} can not be opened: {e.strerror or e}") from e
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    except cv2.error:
        pixels = None
    if pixels is None:
        raise SourceError(
            f"{path} ({data.size} bytes) is not an image that can be decoded: replace the file or "
            "take it out of the folder"
        )
    return to_grey(pixels, str(path))


def to_grey(pixels: np.ndarray, name: str) -> np.ndarray:
    """Any decoded image as uint8 (height, width), read-only: 16 bits lose the lower 8, colour
    becomes luminance, transparency is ignored."""
    if pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    if pixels.dtype != np.uint8:
        raise SourceError(
            f"{name} has pixels of type {pixels.dtype}: convert it to an image of 8 or 16 bits"
        )
    if pixels.ndim == 3:
        codes = {1: None, 3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}
        if pixels.shape[2] not in codes:
            raise SourceError(f"{name} has {pixels.shape[2]} channels: give grey or colour images")
        code = codes[pixels.shape[2]]
        pixels = pixels[:, :, 0] if code is None else cv2.cvtColor(pixels, code)
    out = np.ascontiguousarray(pixels)
    out.flags.writeable = False
    return out
