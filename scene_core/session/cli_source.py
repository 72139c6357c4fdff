"""The flags that say which experiment is meant: a preset, a settings file, images, or a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Annotated, Any

import tyro

from scene_core.params import ParamError, get, rows_typed
from scene_core.session import presets, toml_io, units
from scene_core.session.alignment import Alignment
from scene_core.session.config import Experiment
from scene_core.session.edits import set_params, with_seed
from scene_core.session.start import initial_world

GOES_WITH = {
    "calib": "images",
    "reference": "images",
    "reference_time": "images",
    "robot": "mrclam",
}
"""Flags that mean nothing without another."""


@dataclass(frozen=True)
class SourceOptions:
    """Which experiment: a preset, a settings file, images, or a log."""

    preset: str = ""
    """Name of a scenario, see `scene presets`; room when nothing else is given."""
    config: str = ""
    """A settings file, as `scene presets NAME --toml` and the page's 'Save settings' write it."""
    images: str = ""
    """A folder of images or a video file; needs --calib."""
    calib: str = ""
    """The camera of --images: OpenCV's .yaml, SceneLib2's .cfg, or a .toml file."""
    reference: str = ""
    """True trajectory of --images: lines `frame x y z qx qy qz qw`."""
    reference_time: bool = False
    """The first column of --reference is a time in seconds, not a frame."""
    align: Alignment | None = None
    """Bring the estimate into the reference's axes before errors are taken."""
    mrclam: str = ""
    """Folder of a UTIAS MRCLAM data set."""
    robot: int | None = None
    """Which robot of --mrclam, 1 to 5; 2 when not given."""
    mrpt: str = ""
    """A log of MRPT's kf-slam demonstrations as text, or the folder of the planar one."""
    planar_mono: str = ""
    """Folder of the course project 'Planar Monocular SLAM'."""
    starry_night: str = ""
    """The file dataset3.mat of Starry Night."""
    tagbox: str = ""
    """Folder of a camera round a box of AprilTags."""
    seed: int | None = None
    """Another seed: other noise, or other places where corners are looked for."""
    models: str = ""
    """A folder with models of your own, .py files that may be saved while the page runs."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Change a parameter, as path=value, e.g. estimator.policies.selection.budget=6. May be
    repeated."""


def experiment_from(options: SourceOptions) -> Experiment:
    """The experiment that the flags describe. Raises ParamError or SourceError."""
    experiment = _chosen(options)
    if options.align is not None:
        experiment = replace(experiment, align=options.align)
    if options.seed is not None:
        if not 0 <= options.seed < 2**31:
            raise ParamError(f"--seed {options.seed}: give a whole number from 0 to 2147483647")
        experiment = with_seed(experiment, options.seed)
    return _edited(experiment, options.set)


def _chosen(options: SourceOptions) -> Experiment:
    given = {
        "--config": options.config,
        "--images": options.images,
        "--mrclam": options.mrclam,
        **{flag_of(name): getattr(options, name) for name in presets.RECORDINGS},
        "--preset": options.preset,
    }
    flags = [flag for flag, value in given.items() if value]
    if flags[-1:] == ["--preset"] and flag_of(options.preset) in flags:
        flags.remove("--preset")
    if len(flags) > 1:
        raise ParamError(f"{flags[0]} and {flags[1]} both choose the experiment: give one of them")
    for flag, owner in GOES_WITH.items():
        if getattr(options, flag) not in ("", False, None) and not getattr(options, owner):
            raise ParamError(f"{flag_of(flag)} goes with {flag_of(owner)}: give both")
    if options.config:
        return _from_file(options.config)
    if options.images:
        if not options.calib:
            raise ParamError("--images needs the camera: add --calib FILE (.yaml, .cfg or .toml)")
        return presets.images(
            options.images,
            options.calib,
            options.reference,
            options.reference_time,
            options.align or "none",
        )
    if options.mrclam:
        return presets.mrclam(options.mrclam, 2 if options.robot is None else options.robot)
    for name, make in presets.RECORDINGS.items():
        if getattr(options, name):
            return make(getattr(options, name))
    return presets.build(options.preset or presets.DEFAULT)


def flag_of(name: str) -> str:
    """The flag of an option or a scenario: --planar-mono of planar_mono."""
    return f"--{name.replace('_', '-')}"


def _from_file(path: str) -> Experiment:
    """A settings file whose parts also fit together."""
    experiment = toml_io.load(path)
    try:
        initial_world(experiment)
    except ParamError as e:
        raise ParamError(f"{path}: {e}") from e
    return experiment


def _edited(experiment: Experiment, edits: Sequence[str]) -> Experiment:
    """The experiment with all edits path=value, which take effect together."""
    values: dict[str, Any] = {}
    for edit in edits:
        path, sign, text = edit.partition("=")
        if not sign:
            raise ParamError(f"--set {edit}: write path=value, e.g. {presets.EXAMPLE_EDIT}")
        try:
            path = _without_unit(experiment, path.strip())
            values[path] = parsed(text.strip(), get(experiment, path))
        except ParamError as e:
            raise ParamError(f"--set {edit}: {e}") from e
    try:
        return set_params(experiment, values)
    except ParamError as e:
        meant = [edit for edit in edits if edit.partition("=")[0].rpartition(".")[2] in str(e)]
        raise ParamError(f"{' '.join(f'--set {edit}' for edit in meant or edits)}: {e}") from e


def _without_unit(experiment: Experiment, path: str) -> str:
    """The path to a parameter that may be named as in a settings file, where keys carry units."""
    parent, _, name = path.rpartition(".")
    owner = get(experiment, parent) if parent else experiment
    if is_dataclass(owner):
        for f in fields(owner):
            if "param" in f.metadata and units.key(f.name, f.metadata["param"]["unit"]) == name:
                return f"{parent}.{f.name}" if parent else f.name
    return path


def parsed(text: str, old: Any) -> Any:
    """A value typed on the command line, read as the kind of value `old` is; text that is no such
    value stays text, for the parameter's own check to refuse."""
    if isinstance(old, bool):
        return {"true": True, "false": False}.get(text.lower(), text)
    if isinstance(old, tuple) and (";" in text or any(isinstance(row, tuple) for row in old)):
        return rows_typed(text)
    if isinstance(old, tuple):
        return [parsed(part.strip(), 0.0) for part in text.strip("()[]").split(",")]
    if isinstance(old, (int, float)):
        try:
            return int(text) if text.lstrip("+-").isdigit() else float(text)
        except ValueError:
            return text
    return text
