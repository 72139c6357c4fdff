"""The scenarios: complete experiments, each with one sentence about what to look at.

The simulated ones are put together in the modules that SIMULATED names, those that play
somebody's files in `presets_recordings` and `presets_identified`. `images`, `mrclam`, NEEDS and
RECORDINGS can be taken from here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from scene_core.params import ParamError
from scene_core.session import (
    presets_calibration,
    presets_hand,
    presets_lines,
    presets_particles,
    presets_platforms,
    presets_recordings,
    presets_scene,
    presets_toolbox,
)
from scene_core.session.config import Experiment
from scene_core.session.presets_identified import RECORDINGS as RECORDINGS
from scene_core.session.presets_recordings import NEEDS as NEEDS
from scene_core.session.presets_recordings import images as images
from scene_core.session.presets_recordings import mrclam as mrclam

DEFAULT = "room"
EXAMPLE_EDIT = "estimator.policies.selection.budget=6"


@dataclass(frozen=True)
class Preset:
    """A scenario by name."""

    name: str
    about: str
    make: Callable[[], Experiment] | None
    """None: it needs files."""
    needs: str = ""
    """The flags that name the files."""
    group: str = ""
    """The heading it is listed under."""
    frames: int = 0
    """How long one run is when statistics are taken."""
    reason: str = ""
    """Why its NEES is outside its band; empty: it is inside."""


SIMULATED = (
    ("Scene's ladder", (presets_hand, presets_scene)),
    ("The toolbox's robots", (presets_toolbox, presets_lines)),
    ("Particles and markers", (presets_particles,)),
    ("Self-calibration", (presets_calibration,)),
    ("Other platforms", (presets_platforms,)),
)
"""Headings, and modules with SCENARIOS and ABOUT by name."""
FILES = "Recordings"

ABOUT: Mapping[str, str] = {
    name: about
    for module in (*(m for _, under in SIMULATED for m in under), presets_recordings)
    for name, about in module.ABOUT.items()
}

PRESETS: Mapping[str, Preset] = {
    **{
        name: Preset(name, ABOUT[name], one.make, "", group, one.frames, one.reason)
        for group, modules in SIMULATED
        for module in modules
        for name, one in module.SCENARIOS.items()
    },
    **{name: Preset(name, ABOUT[name], None, flags, FILES) for name, flags in NEEDS.items()},
}


def loadable() -> tuple[str, ...]:
    """Names of the scenarios that need no file."""
    return tuple(p.name for p in PRESETS.values() if p.make)


def named(name: str) -> Preset:
    """A scenario's entry; raises ParamError for an unknown one."""
    if name not in PRESETS:
        raise ParamError(f"no preset '{name}': choose one of {', '.join(PRESETS)}")
    return PRESETS[name]


def build(name: str) -> Experiment:
    """A scenario by name. Raises ParamError for an unknown one, or one that needs files."""
    preset = named(name)
    if preset.make is None:
        raise ParamError(f"preset '{name}' needs files: start with {preset.needs}")
    return preset.make()
