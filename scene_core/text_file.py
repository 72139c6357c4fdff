"""Text files that a user named."""

from __future__ import annotations

import stat
from pathlib import Path

LARGEST = 16_000_000
"""Bytes of a file that somebody wrote."""


def text_of(path: Path, expected: str) -> str:
    """The text of a file; `expected` names what it should be, e.g. "a settings file (TOML)".

    Raises ValueError with one sentence for what can not be opened, for devices and pipes (they may
    never end), for what is no text, and for what is larger than `LARGEST`.
    """
    try:
        about = path.stat()
    except OSError as e:
        raise ValueError(f"{path} can not be opened: {e.strerror or e}") from e
    except ValueError as e:
        raise ValueError(f"{str(path)!a} is no path of a file: {e}") from e
    if not (stat.S_ISREG(about.st_mode) or stat.S_ISDIR(about.st_mode)):
        raise ValueError(f"{path} is no file: give {expected}")
    if about.st_size > LARGEST:
        size, most = about.st_size / 1e6, LARGEST / 1e6
        raise ValueError(f"{path} has {size:.0f} MB: give {expected} of at most {most:.0f} MB")
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors write a mark at the start
    except OSError as e:
        raise ValueError(f"{path} can not be opened: {e.strerror or e}") from e
    except UnicodeDecodeError as e:
        raise ValueError(f"{path} is not a text file: give {expected}") from e
