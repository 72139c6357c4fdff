"""The command line of the library: `scene run`, `presets`, `models` and `check`. `scene serve` is
the page's.

Input that does not fit ends with one sentence and exit code 2, a run that breaks off, or a model
that does not conform, with 1.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from time import monotonic, perf_counter
from typing import Annotated, Any, NoReturn

import tyro
from threadpoolctl import threadpool_limits

from scene_core.filter.ports import EndOfData, SourceError
from scene_core.params import ParamError, get, rows_typed
from scene_core.session import presets, toml_io, units
from scene_core.session.alignment import Alignment
from scene_core.session.cli_models import Check, Models, check_models, library_of, list_models
from scene_core.session.config import Experiment
from scene_core.session.edits import set_params, with_seed
from scene_core.session.failures import explain
from scene_core.session.report import report, summary
from scene_core.session.session import Session
from scene_core.session.start import initial_world, resting

DEFAULT_FRAMES = 1000
"""Length of a run whose source has no end, when --frames is not given."""

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


@dataclass(frozen=True)
class Run:
    """Run an experiment without the page, as fast as possible."""

    source: Annotated[SourceOptions, tyro.conf.OmitArgPrefixes] = field(
        default_factory=SourceOptions
    )
    frames: int | None = None
    """Stop after this many frames; else at the scenario's or the recording's end, or after 1000."""
    json: str = ""
    """Write the figures to this file, or to standard output with -."""
    metrics_from: int = 0
    """Leave the frames before this one out of errors, NEES and NIS."""


@dataclass(frozen=True)
class Presets:
    """List the scenarios, or write one as a settings file."""

    name: tyro.conf.Positional[str] = ""
    """Which one; all when left out."""
    toml: bool = False
    """Write its settings, commented, to standard output."""
    files: Annotated[SourceOptions, tyro.conf.OmitArgPrefixes] = field(
        default_factory=SourceOptions
    )


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
            return int(text) if isinstance(old, int) and "." not in text else float(text)
        except ValueError:
            return text
    return text


def run(options: Run) -> None:
    """Run, then write or print the figures."""
    experiment = experiment_from(options.source)
    if options.frames is not None:
        if options.frames < 1:
            raise ParamError(f"--frames {options.frames}: give a whole number of at least 1")
        experiment = replace(experiment, frames=options.frames)
    elif experiment.frames is None and experiment.source.frame_count is None:
        experiment = replace(experiment, frames=DEFAULT_FRAMES)
    for why in resting(experiment.estimator).values():
        print(f"scene: {why}", file=sys.stderr)
    session = Session(experiment)
    count = session.frame_count
    if options.metrics_from < 0 or (count is not None and options.metrics_from >= count):
        raise ParamError(
            f"--metrics-from {options.metrics_from}: give a frame from 0 to {(count or 1) - 1}"
        )
    if options.json not in ("", "-") and not Path(options.json).parent.is_dir():
        raise ParamError(f"--json {options.json}: there is no folder {Path(options.json).parent}")
    seconds = _advance_to_the_end(session, count)
    figures = report(session, seconds, options.metrics_from)
    if not options.json:
        print(summary(figures, session.metrics.totals()), flush=True)
        return
    text = json.dumps(figures, indent=2, allow_nan=False)
    if options.json == "-":
        print(text, flush=True)
        return
    try:
        Path(options.json).write_text(text + "\n", encoding="utf-8")
    except OSError as e:
        raise ParamError(f"--json {options.json}: can not be written: {e.strerror}") from e


class RunError(Exception):
    """A run that broke off: the message is one sentence, `details` a traceback or nothing."""

    def __init__(self, text: str, details: str) -> None:
        super().__init__(text)
        self.details = details


def _advance_to_the_end(session: Session, count: int | None) -> float:
    """Run until the data end; returns the seconds it took."""
    bar = Progress(count)
    start = perf_counter()
    try:
        while True:
            session.advance()
            bar.show(session)
    except EndOfData:
        return perf_counter() - start
    except Exception as e:
        # Whatever a model raises becomes a sentence that says which frame it was.
        text, details = explain(e)
        raise RunError(f"frame {session.frame + 1}: {text}", details) from e
    finally:
        bar.clear()


class Progress:
    """One line on a terminal; nothing elsewhere."""

    WIDTH = 30

    def __init__(self, count: int | None) -> None:
        self._count = count
        self._is_on = sys.stderr.isatty()
        self._start = self._shown = monotonic()

    def show(self, session: Session) -> None:
        now = monotonic()
        if not self._is_on or now - self._shown < 0.1:
            return
        self._shown = now
        done = session.frame + 1
        bar = ""
        if self._count:
            filled = math.floor(self.WIDTH * done / self._count)
            bar = f"[{'#' * filled}{'.' * (self.WIDTH - filled)}] "
        of = f" of {self._count}" if self._count else ""
        rate, features = done / (now - self._start), len(session.world.features)
        line = f"{bar}frame {done}{of}, {rate:.0f} frames/s, {features} features"
        print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self._is_on:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def list_presets(options: Presets) -> None:
    """All scenarios with a sentence each, one of them, or its settings."""
    if not options.name:
        if options.toml:
            raise ParamError("--toml writes one scenario: give its name, e.g. scene presets room")
        group = ""
        for preset in presets.PRESETS.values():
            if preset.group != group:
                print(f"{preset.group}:")
                group = preset.group
            needs = f" (needs {preset.needs})" if preset.needs else ""
            print(f"  {preset.name:<20}{preset.about}{needs}")
        return
    preset = presets.named(options.name)
    if not options.toml:
        print(f"{preset.name}: {preset.about}")
        print(f"  scene run {preset.needs or f'--preset {preset.name}'}")
        return
    files = options.files
    if not any(getattr(files, name) for name in presets.NEEDS):
        files = replace(files, preset=options.name)
    base = presets.build(options.name) if preset.make else None
    print(toml_io.dumps(experiment_from(files), base), end="")


def main(args: Sequence[str] | None = None) -> None:
    """`scene run ...` and so on; leaves by SystemExit where something does not fit."""
    commands = (
        Annotated[Run, tyro.conf.subcommand("run")]
        | Annotated[Presets, tyro.conf.subcommand("presets")]
        | Annotated[Models, tyro.conf.subcommand("models")]
        | Annotated[Check, tyro.conf.subcommand("check")]
    )
    with reader_may_leave():
        options = tyro.cli(commands, args=args, prog="scene")  # type: ignore[arg-type]
        threadpool_limits(1)
        try:
            _obey(options)
        except (ParamError, SourceError) as e:
            _leave(f"scene: {e}", 2)
        except RunError as e:
            _leave(f"{e.details}scene: {e}", 1)
        except KeyboardInterrupt:
            _leave("scene: interrupted", 130)


def _obey(options: Run | Presets | Models | Check) -> None:
    match options:
        case Run():
            library_of(options.source.models)
            run(options)
        case Presets():
            library_of(options.files.models)
            list_presets(options)
        case Models():
            list_models(options)
        case Check():
            if not check_models(options):
                raise SystemExit(1)


@contextmanager
def reader_may_leave() -> Iterator[None]:
    """Leave without a traceback when whoever reads our output has gone (`| head`)."""
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # The interpreter flushes once more at its end: that must not fail either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None


def _leave(text: str, code: int) -> NoReturn:
    print(text, file=sys.stderr)
    raise SystemExit(code)
