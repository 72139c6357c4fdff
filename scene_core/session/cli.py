"""The command line of the library: `scene run`, `presets`, `models` and `check`. `scene serve` is
the page's.

Input that does not fit ends with one sentence and exit code 2, a run that breaks off, or a model
that does not conform, with 1.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Annotated, NoReturn

import tyro
from threadpoolctl import threadpool_limits

from scene_core.filter.ports import SourceError
from scene_core.params import ParamError
from scene_core.session import presets, toml_io
from scene_core.session.cli_models import Check, Models, check_models, library_of, list_models
from scene_core.session.cli_run import Run, RunError, run
from scene_core.session.cli_source import SourceOptions, experiment_from


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
