"""A folder of images or a video file as a source: what MonoSLAM looks at."""

from __future__ import annotations

import re
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import cv2
import numpy as np

from scene_core.arrays import Vec
from scene_core.filter.policies import Vision
from scene_core.filter.ports import (
    Detection,
    EndOfData,
    Frame,
    Image,
    Match,
    Occupied,
    Query,
    SourceError,
    Truth,
)
from scene_core.params import param
from scene_core.sources.corners import detect_corners
from scene_core.sources.grey import read_grey, to_grey
from scene_core.sources.reference import load_reference
from scene_core.sources.vision import extract, load_patch, search_patches

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".pgm", ".ppm", ".bmp", ".tif", ".tiff", ".webp")
KEPT = 64
"""Decoded images that are kept, so that stepping back need not decode a video again."""


@dataclass(frozen=True)
class ImageSequence:
    """A recording of one camera. Frame k is the k-th image by natural order of the file names (2
    before 10), or the k-th frame of a video; nothing but images comes in, so the robot has no
    controls and its truth is the reference trajectory, where one is given."""

    path: str
    """A folder of images, or a video file."""
    width: int
    """Pixels every image must have across: those of the calibration."""
    height: int
    """Pixels every image must have down."""
    frame_rate: float = param(30.0, unit="Hz", lo=0.1, hi=1000.0, effect="on reset")
    """Images per second; the time between two images is 1 / this."""
    mount: str = "camera"
    """The camera's name."""
    robot: str = "camera"
    """The name of what carries it."""
    reference: str = ""
    """A file with the true trajectory: frame x y z qx qy qz qw; empty: the truth is not known."""
    reference_time: bool = False
    """The first column of the reference is a time in seconds since frame 0, not a frame."""
    seed: int = param(0, lo=0, hi=2**31 - 1, effect="on reset")
    """Decides where new corners are looked for first; everything else is in the recording."""

    @property
    def frame_count(self) -> int | None:
        """Images there are; for a video, what its header says."""
        return len(_reader(self.path))

    def start(self) -> None:
        """Nothing moves but the images. Raises SourceError when there is nothing to read."""
        if self.reference:
            load_reference(self.reference)
        _reader(self.path)

    def advance(self, state: None, index: int) -> tuple[Frame, None]:
        """Image `index`; EndOfData past the last, SourceError when it can not be read."""
        pixels, name = _reader(self.path).image(index)
        height, width = pixels.shape
        if (width, height) != (self.width, self.height):
            raise SourceError(
                f"{name} is {width} x {height} pixels, the calibration is for "
                f"{self.width} x {self.height}: use the images the camera was calibrated with, "
                "or scale them to this size"
            )
        dt = 0.0 if index == 0 else 1.0 / self.frame_rate
        raw = {self.mount: Image(pixels)}
        return Frame(index, index / self.frame_rate, dt, {}, raw, truth=self._truth(index)), None

    def search(self, frame: Frame, query: Query, vision: Vision) -> Sequence[Match]:
        """Patches by correlation inside their ellipses."""
        return search_patches(_pixels(frame, query.mount), query, vision)

    def detect(
        self, frame: Frame, mount: str, occupied: Occupied, count: int, vision: Vision
    ) -> Sequence[Detection]:
        """Shi-Tomasi corners, away from what is mapped."""
        key = (self.seed, frame.index)
        return detect_corners(_pixels(frame, mount), occupied.h, count, vision, key)

    def appearance_at(self, frame: Frame, mount: str, z: Vec, vision: Vision) -> Detection | None:
        """The patch around the pixel somebody pointed at."""
        return extract(_pixels(frame, mount), z, vision)

    def appearance_of(self, known: Any) -> Any:
        """The patch a known feature names by the path of its image file."""
        return load_patch(known) if isinstance(known, str) else known

    def _truth(self, index: int) -> Truth | None:
        if not self.reference:
            return None
        reference = load_reference(self.reference)
        if self.reference_time:
            pose = reference.near(index / self.frame_rate, 0.5 / self.frame_rate)
        else:
            pose = reference.near(index, 0.5)
        return None if pose is None else Truth({self.robot: pose})


def image_files(folder: Path) -> list[Path]:
    """The images of a folder in natural order: runs of digits compare as numbers."""
    found = [p for p in folder.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES and p.is_file()]
    return sorted(found, key=_natural)


def _natural(path: Path) -> list[tuple[int, int, str]]:
    parts = re.split(r"(\d+)", path.name)
    return [(0, int(p), p) if p.isdigit() else (1, 0, p) for p in parts]


def _pixels(frame: Frame, mount: str) -> np.ndarray:
    raw = frame.raw[mount]
    assert isinstance(raw, Image), f"{mount} has no image in frame {frame.index}"
    return raw.pixels


class _Folder:
    """The images of a folder, read one by one."""

    def __init__(self, folder: Path) -> None:
        self.files = image_files(folder)
        if not self.files:
            raise SourceError(
                f"the folder {folder} holds no images: expected files ending in "
                + ", ".join(IMAGE_SUFFIXES)
            )
        self.lock = Lock()
        self.kept: OrderedDict[int, np.ndarray] = OrderedDict()

    def __len__(self) -> int:
        return len(self.files)

    def image(self, index: int) -> tuple[np.ndarray, str]:
        if not 0 <= index < len(self.files):
            raise EndOfData
        name = str(self.files[index])
        with self.lock:
            if index not in self.kept:
                _keep(self.kept, index, read_grey(name))
            return self.kept[index], name


class _Video:
    """A video file, decoded in order; going back beyond the kept images decodes it anew."""

    def __init__(self, path: Path) -> None:
        self.path = str(path)
        self.capture = cv2.VideoCapture(self.path)
        self.count = int(self.capture.get(cv2.CAP_PROP_FRAME_COUNT))
        self.next = 0
        self.end: int | None = None
        self.lock = Lock()
        self.kept: OrderedDict[int, np.ndarray] = OrderedDict()
        if not self.capture.isOpened():
            raise SourceError(
                f"{path} can not be opened as a video: give a video file or a folder of images"
            )
        try:
            self.image(0)
        except EndOfData:
            raise SourceError(f"the video {path} has no frame that can be decoded") from None

    def __len__(self) -> int:
        return self.count if self.end is None else self.end

    def image(self, index: int) -> tuple[np.ndarray, str]:
        name = f"frame {index} of {self.path}"
        with self.lock:
            if index not in self.kept:
                self._decode(index, name)
            self.kept.move_to_end(index)
            return self.kept[index], name

    def _decode(self, index: int, name: str) -> None:
        if self.end is not None and index >= self.end:
            raise self._no_more()
        if index < self.next:
            self.capture = cv2.VideoCapture(self.path)
            self.next = 0
        while self.next <= index:
            if not self.capture.grab():
                self.end = self.next
                raise self._no_more()
            self.next += 1
        ok, pixels = self.capture.retrieve()
        if not ok:
            raise SourceError(f"{name} can not be decoded: convert the video or cut it before")
        _keep(self.kept, index, to_grey(pixels, name))

    def _no_more(self) -> Exception:
        """The end; or a damaged file, when its header promised many more frames."""
        assert self.end is not None
        if self.count - self.end <= max(2, self.count // 50):
            return EndOfData()
        return SourceError(
            f"frame {self.end} of {self.path} can not be decoded although the file announces "
            f"{self.count} frames: it is damaged or cut off; convert it, or stop before this frame"
        )


def _keep(kept: OrderedDict[int, np.ndarray], index: int, pixels: np.ndarray) -> None:
    kept[index] = pixels
    while len(kept) > KEPT:
        kept.popitem(last=False)


def _reader(path: str) -> _Folder | _Video:
    p = Path(path)
    try:
        return _open(str(p.resolve()), p.stat().st_mtime_ns)
    except OSError as e:
        raise SourceError(
            f"{path} can not be read: {e.strerror or e}; give a folder of images or a video file"
        ) from e


@lru_cache(maxsize=4)
def _open(path: str, _: int) -> _Folder | _Video:
    return _Folder(Path(path)) if Path(path).is_dir() else _Video(Path(path))


def video_frame_rate(path: str) -> float | None:
    """Frames per second a video file states; None for a folder or a file that does not say."""
    reader = _reader(path)
    rate = reader.capture.get(cv2.CAP_PROP_FPS) if isinstance(reader, _Video) else 0.0
    return float(rate) if 0.1 <= rate <= 1000.0 else None


def image_size(path: str) -> tuple[int, int]:
    """Width and height of the first image."""
    height, width = _reader(path).image(0)[0].shape
    return width, height
