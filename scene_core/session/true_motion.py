"""Another motion model for a robot of a simulation itself: how it really moves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scene_core import params
from scene_core.filter.ports import SourceError
from scene_core.models.base import MotionModel
from scene_core.models.labels import bare
from scene_core.models.lifting import lifted
from scene_core.models.registry import runs_on
from scene_core.params import ParamError
from scene_core.session.config import Experiment
from scene_core.session.start import sd_labels
from scene_core.session.swap_words import swap_words
from scene_core.sources.simulated import Simulation
from scene_core.sources.truth import TrueRobot
from scene_core.sources.wheel import check_driver

PLACES = ("x", "y", "z", "qw", "qx", "qy", "qz")


def with_true_motion(
    experiment: Experiment, base: Experiment, robot: str, motion: MotionModel
) -> tuple[Experiment, str]:
    """The experiment whose simulator moves a robot by another model from now on, and a sentence
    about its state. The scenario's own comes back with the scenario's start. Raises ParamError with
    what does not fit it."""
    source = experiment.source
    assert isinstance(source, Simulation)
    path = f"source.robots.{robot}"
    now: TrueRobot = source.robots[robot]
    _check(source, robot, motion)
    original: Any = params.get(base, path)
    xv = _start(now)
    taken = lifted(now.motion, motion, xv)
    said = swap_words(now.motion, motion, taken._replace(P_rest=np.zeros_like(taken.P_rest)))
    note = "the truth: " + said.replace("and map ", "").replace(" ± 0", "")
    if original.motion is motion:
        # The driver is the one at the wheel now.
        return params.put(experiment, path, replace(original, driver=now.driver)), note
    start = dict(zip(motion.state_labels, taken.xv.tolist(), strict=True))
    kept = {*motion.state_labels, *sd_labels(motion.state_labels)}
    after = replace(
        now,
        motion=motion,
        start=start,
        start_sd={s: sd for s, sd in now.start_sd.items() if s in kept},
        calib={s: k for s, k in now.calib.items() if s in motion.calib_labels},
        calib_sd={s: sd for s, sd in now.calib_sd.items() if s in motion.calib_labels},
    )
    return params.put(experiment, path, after), note


def _start(robot: TrueRobot) -> Any:
    labels = robot.motion.state_labels
    xv = np.array([robot.start.get(s, 1.0 if bare(s) == "qw" else 0.0) for s in labels])
    return robot.motion.normalise(xv).value


def _check(source: Simulation, robot: str, motion: MotionModel) -> None:
    now = source.robots[robot]
    try:
        check_driver(now.driver, motion)
    except SourceError as e:
        raise ParamError(f"the truth goes on as it is: {e}") from e
    if now.on_ground and not set(PLACES) <= set(motion.state_labels):
        raise ParamError(
            f"'{motion.name}' can not be kept on the ground: turn 'on the ground' of "
            f"'{robot}' off first"
        )
    for name, mount in source.mounts.items():
        if mount.robot == robot and mount.hook not in motion.hooks:
            raise ParamError(
                f"the true sensor '{name}' is mounted at the hook '{mount.hook}', which "
                f"'{motion.name}' does not have: it has {', '.join(motion.hooks)}"
            )
    for name, marker in source.markers.items():
        if marker.robot == robot and marker.hook not in motion.hooks:
            raise ParamError(
                f"the true marker '{name}' is at the hook '{marker.hook}', which "
                f"'{motion.name}' does not have: it has {', '.join(motion.hooks)}"
            )
    for name, one in source.instruments.items():
        reason = runs_on(one.model, motion) if one.robot == robot else None
        if reason:
            raise ParamError(f"instrument '{name}' would have nothing to measure: {reason}")
