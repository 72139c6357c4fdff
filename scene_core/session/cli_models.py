"""`scene check` and `scene models`: does a model keep its promises, and which ones are there."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

from scene_core import params
from scene_core.filter.policies import Policies
from scene_core.models import registry
from scene_core.models.check import check
from scene_core.models.library import Library
from scene_core.models.pairs import markdown
from scene_core.models.pairs import pairs as every_pair
from scene_core.models.plugins import UserFile, in_time, load_file
from scene_core.params import ParamError
from scene_core.session import presets
from scene_core.session.roles import CHOICES


@dataclass(frozen=True)
class Check:
    """Say whether models keep the promises of their kind: shapes, units, Jacobians, noise."""

    files: tyro.conf.Positional[tuple[str, ...]] = ()
    """Files with models of your own."""
    all: bool = False
    """Every built-in model too."""


@dataclass(frozen=True)
class Models:
    """List every model, and which sensor goes with which landmark."""

    json: bool = False
    """As JSON, with the keys motion, sensors, landmarks, internal, policies, presets and pairs."""
    markdown: bool = False
    """The tables of what goes with what, as a page of the documentation."""
    models: str = ""
    """A folder with models of your own, to be listed too."""


def library_of(folder: str) -> Library | None:
    """The user's models: those of a folder and those of installed packages. What is wrong with them
    is written to standard error, a sentence each; None when there are none at all."""
    # What a file prints is not part of a list for programs.
    with redirect_stdout(sys.stderr):
        library = Library(folder or None)
    for problem in problems(library.files):
        print(f"scene: {problem}", file=sys.stderr)
    if library.others:
        print(f"scene: {passed_over(folder, library.others)}", file=sys.stderr)
    return library if library.files or folder else None


def passed_over(folder: str, names: Sequence[str]) -> str:
    """One short line about the files of a folder that declare no model."""
    shown = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
    files = "1 file declares" if len(names) == 1 else f"{len(names)} files declare"
    was = "was" if len(names) == 1 else "were"
    return f"--models {folder}: {files} no model and {was} not run ({shown})"


def problems(files: Sequence[UserFile]) -> list[str]:
    """Everything that is wrong with the user's files."""
    out = [f.problem for f in files if f.problem]
    return out + [m.problem for f in files for m in f.models if m.problem]


def check_models(options: Check) -> bool:
    """Print a report per model; whether all of them conform. Raises ParamError without a model."""
    if not options.files and not options.all:
        raise ParamError("check what? give a file with a model of your own, or --all")
    fine = True
    for name in options.files:
        if Path(name).is_dir():
            raise ParamError(f"{name}: that is a folder; give a file in it")
        if not Path(name).exists():
            raise ParamError(f"{name}: there is no such file")
        file = in_time(name, lambda n=name: load_file(n))
        if file.problem:
            print(f"{file.problem}\n")
        for model in file.models:
            # The report names every law; there is only the sentence where all are kept.
            if model.report is not None:
                print(model.report, end="\n\n")
            if model.problem and (model.report is None or model.report.ok):
                print(model.problem, end="\n\n")
        fine &= not problems([file])
    if options.all:
        for kind in registry.KINDS:
            for cls in registry.built_in(kind).values():
                report = check(cls)
                print(report, end="\n\n")
                fine &= report.ok
    print("All conform." if fine else "Not all conform.")
    return fine


def list_models(options: Models) -> None:
    """Print every model by name, as a table or as JSON."""
    library_of(options.models)
    if options.markdown:
        print(markdown(), end="")
        return
    there = table()
    if options.json:
        print(json.dumps(there, indent=2))
        return
    for kind in ("motion", "sensors", "landmarks", "internal"):
        print(f"{kind}\n" + "".join(f"  {name}\n" for name in there[kind]))
    print("policies\n" + "".join(f"  {k}: {', '.join(v)}\n" for k, v in there["policies"].items()))
    print("presets\n  " + ", ".join(there["presets"]) + "\n")
    print("sensor and landmark: what does not go together, and why")
    for pair in there["pairs"]:
        if pair["reason"]:
            print(f"  {pair['sensor']} + {pair['landmark']}: {pair['reason']}")


def table() -> dict[str, Any]:
    """Every model by name, and every pair of a sensor and a landmark."""
    landmark = next(iter(registry.models("features").values()))()
    specs = {s.path: s for s in params.schema(Policies(landmark), "estimator.policies")}
    return {
        "motion": list(registry.models("motion")),
        "sensors": list(registry.models("sensors")),
        "landmarks": list(registry.models("features")),
        "internal": list(registry.models("internal")),
        "policies": {
            title.lower(): list(specs[path].choices or ()) for path, title in CHOICES.items()
        },
        "presets": list(presets.PRESETS),
        "pairs": pairs(),
    }


def pairs() -> list[dict[str, Any]]:
    """Every sensor with every landmark. Supported: the sensor can measure it; the reason then says
    why it can not start one, if it can not."""
    return [
        {
            "sensor": pair.sensor,
            "landmark": pair.landmark,
            "supported": pair.verdict != "refused",
            "reason": f"observing only: {pair.reason}"
            if pair.verdict == "observes"
            else pair.reason,
        }
        for pair in every_pair()
    ]
