"""One clear sentence about whatever went wrong in a frame; a traceback only for a user's model."""

from __future__ import annotations

import traceback
from pathlib import Path

import numpy as np

import scene_core
from scene_core.filter.gaussian import FilterError
from scene_core.filter.ports import SourceError
from scene_core.models.guard import ModelError
from scene_core.params import ParamError
from scene_core.session.published import Failure

PACKAGE = str(Path(scene_core.__file__).parent)


def explain(error: BaseException) -> tuple[str, str]:
    """A sentence without a full stop, and the traceback when a file of the user's raised it."""
    if isinstance(error, (SourceError, FilterError, ParamError)):
        return str(error).rstrip("."), ""
    if isinstance(error, ModelError):
        details = "".join(traceback.format_exception(error))
        return f"{error}; correct its file, or go back to another model with Undo", details
    user = user_file(error)
    if user:
        details = "".join(traceback.format_exception(error))
        return f"{user} raised {type(error).__name__}: {error}; correct it and redo", details
    if isinstance(error, (np.linalg.LinAlgError, ArithmeticError)):
        return f"the numbers broke down ({error}); undo the last edit and redo the frame", ""
    if isinstance(error, MemoryError):
        return "there is not enough memory; lower 'Map size, max' and reset", ""
    text = f"{type(error).__name__}: {error}"
    return f"{text}; undo the last edit and redo the frame, or reset", ""


def failure(error: Exception, frame: int | None) -> Failure:
    """What the page shows about a frame, or a command (None), that could not be carried out."""
    text, details = explain(error)
    where = "Nothing was changed, the run is paused"
    if frame is not None:
        where = f"Frame {frame} was dropped, the run is paused at the last good one"
    return Failure(f"{where}: {text}.", details)


def user_file(error: BaseException) -> str:
    """The innermost file outside this package and the installed libraries that the error went
    through below the package's own code; empty when there is none."""
    files = [f.filename for f in traceback.extract_tb(error.__traceback__)]
    inside = [i for i, f in enumerate(files) if f.startswith(PACKAGE)]
    below = files[inside[0] :] if inside else []
    own = [f for f in below if not f.startswith(PACKAGE) and not _is_library(f)]
    return own[-1] if own else ""


def _is_library(file: str) -> bool:
    return file.startswith("<") or "site-packages" in file or "/lib/python" in file
