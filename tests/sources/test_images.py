"""Images come in order, grey and of one size; what can not be used is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from scene_core.filter.policies import Vision
from scene_core.filter.ports import EndOfData, Image, Occupied, Query, SourceError
from scene_core.sources.images import ImageSequence, image_size, video_frame_rate
from scene_core.sources.vision import Patch
from tests.sources.pictures import Picture


def pixels(source: ImageSequence, index: int) -> np.ndarray:
    raw = source.advance(None, index)[0].raw["camera"]
    assert isinstance(raw, Image)
    return raw.pixels


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Twelve images numbered without leading zeros; image k has grey level 10 k at the origin."""
    for k in range(12):
        image = np.full((24, 32), 100, np.uint8)
        image[0, 0] = 10 * k
        cv2.imwrite(str(tmp_path / f"frame{k}.png"), image)
    (tmp_path / "notes.txt").write_text("no image")
    return tmp_path


def sequence(folder: Path) -> ImageSequence:
    return ImageSequence(str(folder), 32, 24, frame_rate=20.0)


def test_images_come_in_natural_order(folder: Path) -> None:
    source = sequence(folder)
    assert source.frame_count == 12
    assert [pixels(source, k)[0, 0] for k in range(12)] == [10 * k for k in range(12)]


def test_a_frame_is_the_same_whenever_it_is_asked_for(folder: Path) -> None:
    source = sequence(folder)
    first = [source.advance(None, k)[0] for k in range(12)]
    for k in (7, 0, 11, 3):
        frame = source.advance(None, k)[0]
        assert np.array_equal(pixels(source, k), first[k].raw["camera"].pixels)  # type: ignore[union-attr]
        assert (frame.index, frame.time, frame.dt) == (k, k / 20.0, 0.0 if k == 0 else 0.05)
    assert not pixels(source, 0).flags.writeable


def test_the_end_is_the_end(folder: Path) -> None:
    with pytest.raises(EndOfData):
        sequence(folder).advance(None, 12)


@pytest.mark.parametrize("kind", ["colour", "alpha", "16 bit"])
def test_any_image_becomes_grey_with_8_bits(tmp_path: Path, kind: str) -> None:
    grey = Picture(0, 32, 24).seen(np.zeros(2))
    made = {
        "colour": cv2.merge([grey] * 3),
        "alpha": cv2.merge([grey] * 3 + [np.full_like(grey, 50)]),
        "16 bit": grey.astype(np.uint16) * 256 + 77,
    }[kind]
    cv2.imwrite(str(tmp_path / "a.png"), made)
    got = pixels(sequence(tmp_path), 0)
    assert got.dtype == np.uint8 and np.abs(got.astype(int) - grey).max() <= 1


def broken(folder: Path, what: str) -> tuple[str, list[str]]:
    """The path to give, and words the complaint must have."""
    if what == "odd size":
        cv2.imwrite(str(folder / "frame3.png"), np.zeros((10, 20), np.uint8))
        return str(folder), ["frame3.png", "20 x 10", "32 x 24", "calibrat"]
    if what == "not an image":
        (folder / "frame3.png").write_bytes(b"hello")
        return str(folder), ["frame3.png", "5 bytes"]
    if what == "empty image":
        (folder / "frame3.png").write_bytes(b"")
        return str(folder), ["frame3.png", "0 bytes"]
    if what == "empty folder":
        for file in folder.iterdir():
            file.unlink()
        return str(folder), ["no images", ".png"]
    if what == "missing folder":
        return str(folder / "nowhere"), ["nowhere", "folder of images"]
    (folder / "notes.mp4").write_text("no video")
    return str(folder / "notes.mp4"), ["notes.mp4", "video"]


@pytest.mark.parametrize(
    "what",
    ["odd size", "not an image", "empty image", "empty folder", "missing folder", "no video"],
)
def test_what_can_not_be_read_is_named(folder: Path, what: str) -> None:
    path, words = broken(folder, what)
    source = ImageSequence(path, 32, 24)
    with pytest.raises(SourceError) as error:
        source.start()
        for k in range(12):
            source.advance(None, k)
    assert all(word in str(error.value) for word in words), error.value


def test_the_images_before_a_broken_one_are_fine(folder: Path) -> None:
    path, _ = broken(folder, "not an image")
    source = ImageSequence(path, 32, 24)
    for k in (0, 1, 2, 4):
        assert pixels(source, k)[0, 0] == 10 * k


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """Eighty frames with a bar that grows."""
    path = tmp_path / "bar.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (96, 64))
    if not writer.isOpened():
        pytest.skip("OpenCV can not write videos here")
    for k in range(80):
        image = np.full((64, 96, 3), 30, np.uint8)
        image[:, : k + 8] = 220
        writer.write(image)
    writer.release()
    return path


def bar(image: np.ndarray) -> int:
    return int(np.count_nonzero(image[32] > 125)) - 8


def test_a_video_is_read_forwards_and_backwards(video: Path) -> None:
    source = ImageSequence(str(video), 96, 64, frame_rate=25.0)
    assert source.frame_count == 80
    assert video_frame_rate(str(video)) == 25.0
    assert image_size(str(video)) == (96, 64)
    for k in (0, 1, 2, 60, 79, 3, 79, 0):
        assert abs(bar(pixels(source, k)) - k) <= 1
    with pytest.raises(EndOfData):
        source.advance(None, 80)
    assert abs(bar(pixels(source, 40)) - 40) <= 1


def test_a_video_cut_off_in_the_middle_says_where(video: Path) -> None:
    data = video.read_bytes()
    video.write_bytes(data[: len(data) * 2 // 3])
    source = ImageSequence(str(video), 96, 64)
    with pytest.raises((SourceError, EndOfData)) as error:
        for k in range(80):
            source.advance(None, k)
    assert k > 10  # pyright: ignore[reportPossiblyUnboundVariable]
    with pytest.raises(type(error.value)):
        source.advance(None, 79)


REFERENCE = "# frame x y z qx qy qz qw\n0 1 2 3 0 0 0 1\n4 2 2 3 0 0 1 0  # turned\n"


def test_the_reference_is_the_truth_where_it_says_something(folder: Path) -> None:
    (folder / "reference.txt").write_text(REFERENCE)
    source = replace(sequence(folder), reference=str(folder / "reference.txt"))
    truths = [source.advance(None, k)[0].truth for k in range(12)]
    assert [k for k, t in enumerate(truths) if t is not None] == [0, 4]
    assert truths[4] is not None
    assert np.array_equal(truths[4].xp["camera"], [2, 2, 3, 0, 0, 0, 1])


def test_a_reference_may_count_seconds(folder: Path) -> None:
    (folder / "reference.txt").write_text(REFERENCE.replace("4 2", "0.21 2"))
    source = replace(sequence(folder), reference=str(folder / "reference.txt"), reference_time=True)
    known = [k for k in range(12) if source.advance(None, k)[0].truth is not None]
    assert known == [0, 4]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("5 1 2 3 0 0 0", ["line 4", "7 fields", "expected 8"]),
        ("5 1 2 3 0 0 zero 1", ["line 4", "'zero'"]),
        ("5 1 nan 3 0 0 0 1", ["line 4", "'nan'", "finite"]),
        ("5 1 2 3 0 0 0 7", ["line 4", "length 7"]),
        ("3 1 2 3 0 0 0 1", ["line 4", "does not come after"]),
    ],
)
def test_a_broken_reference_is_refused_with_its_line(
    folder: Path, line: str, words: list[str]
) -> None:
    path = folder / "reference.txt"
    path.write_text(REFERENCE + line + "\n")
    with pytest.raises(SourceError) as error:
        replace(sequence(folder), reference=str(path)).start()
    assert all(word in str(error.value) for word in [str(path), *words]), error.value
    with pytest.raises(SourceError, match="can not be opened"):
        replace(sequence(folder), reference=str(folder / "none.txt")).start()


def test_what_was_detected_is_found_again(tmp_path: Path) -> None:
    picture = Picture(0)
    for k in range(2):
        cv2.imwrite(str(tmp_path / f"{k}.png"), picture.seen(np.array([1.5 * k, 0.0])))
    source = ImageSequence(str(tmp_path), 320, 240)
    first, second = (source.advance(None, k)[0] for k in range(2))
    nothing = Occupied(np.zeros((0, 2)), ())
    found = source.detect(first, "camera", nothing, 8, Vision())
    z = np.array([d.z for d in found])
    n = len(found)
    request = Query(
        "camera", tuple(range(n)), z, np.tile(2.0 * np.eye(2), (n, 1, 1)), 9.0,
        tuple(d.appearance for d in found), np.tile(np.eye(2), (n, 1, 1)),
    )  # fmt: skip
    again = np.array([m.z for m in source.search(second, request, Vision())], dtype=float)
    assert n == 8
    assert np.abs(again - z - [1.5, 0.0]).max() < 0.35
    other = replace(source, seed=1).detect(first, "camera", nothing, 8, Vision())
    assert not np.array_equal([d.z for d in other], z)


def test_a_known_feature_may_name_a_patch_file(tmp_path: Path) -> None:
    source = ImageSequence(str(tmp_path), 320, 240)
    path = tmp_path / "patch.png"
    cv2.imwrite(str(path), Picture(0, 40, 40).seen(np.zeros(2))[:11, :11])
    assert isinstance(source.appearance_of(str(path)), Patch)
    cv2.imwrite(str(path), np.zeros((10, 12), np.uint8))
    with pytest.raises(SourceError, match="12 x 10"):
        source.appearance_of(str(path))
