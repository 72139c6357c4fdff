"""What a swap of the motion model kept, took from the pose, restarted and dropped."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from scene_core.models.base import MotionModel
from scene_core.models.labels import bare
from scene_core.models.lifting import Taken, common

WORDS: Mapping[tuple[str, ...], str] = {
    ("vx", "vy", "vz"): "velocity",
    ("wx", "wy", "wz"): "turn rate",
    ("ax", "ay", "az"): "acceleration",
    ("alphax", "alphay", "alphaz"): "angular acceleration",
    ("bax", "bay", "baz"): "accelerometer bias",
    ("bgx", "bgy", "bgz"): "gyro bias",
    ("x", "y", "z", "qw", "qx", "qy", "qz"): "pose",
    ("z", "x", "phi"): "pose",
    ("z", "x"): "position",
    ("phi",): "heading",
    ("v",): "speed",
    ("delta",): "steering angle",
    ("S",): "wheel direction S",
    ("T",): "turret direction T",
}
"""How groups of state components are called."""
JOINT = re.compile(r"q\d+$")


def swap_words(old: MotionModel, new: MotionModel, taken: Taken) -> str:
    """E.g. pose and map kept; velocity restarted at 0 ± 1 m/s."""
    kept = {i for i, _ in common(old, new)}
    known = np.asarray(taken.by_xv.any(axis=1))
    out = ["pose and map kept" if new.space.d > 1 else "position and map kept"]
    followed = [
        label
        for i, label in enumerate(new.state_labels)
        if i not in kept and known[i] and label not in new.space.labels
    ]
    if followed:
        out.append(f"{_listed(followed)} taken from the pose")
    out += _restarted(new, taken, kept | set(np.flatnonzero(known).tolist()))
    used = np.asarray(taken.by_xv.any(axis=0))
    dropped = [label for j, label in enumerate(old.state_labels) if not used[j]]
    if dropped:
        out.append(f"{_listed(dropped)} dropped")
    return "; ".join(out)


def _restarted(new: MotionModel, taken: Taken, had: set[int]) -> list[str]:
    """Groups of components that begin with the same value."""
    groups: dict[tuple[str, float, float], list[str]] = {}
    for i, (label, unit) in enumerate(zip(new.state_labels, new.state_units, strict=True)):
        if i not in had:
            key = (unit, round(float(taken.xv[i]), 6), math.sqrt(taken.P_rest[i, i]))
            groups.setdefault(key, []).append(label)
    out = []
    for (unit, mean, sd), labels in groups.items():
        value = f"{mean:g} ± {sd:g} {unit}"
        if unit.startswith("rad"):
            value = f"{math.degrees(mean):g} ± {math.degrees(sd):.3g} {unit.replace('rad', 'deg')}"
        out.append(f"{_listed(labels)} restarted at {value.rstrip()}")
    return out


def _listed(labels: Sequence[str]) -> str:
    """Names of groups of labels, those of each body of a model made of several by themselves."""
    out: list[str] = []
    for prefix in dict.fromkeys(_prefix(label) for label in labels):
        own = [bare(label) for label in labels if _prefix(label) == prefix]
        of = f" of {prefix.rstrip(':')}" if prefix else ""
        out += [word + of for word in _words(own)]
    *most, last = out
    return f"{', '.join(most)} and {last}" if most else last


def _words(labels: Sequence[str]) -> list[str]:
    out, at = [], 0
    while at < len(labels):
        fits = [group for group in WORDS if tuple(labels[at : at + len(group)]) == group]
        joints = 0
        while at + joints < len(labels) and JOINT.match(labels[at + joints]):
            joints += 1
        if fits:
            group = max(fits, key=len)
            out.append(WORDS[group])
            at += len(group)
        elif joints:
            out.append("joint angles" if joints > 1 else "joint angle")
            at += joints
        else:
            out.append(labels[at])
            at += 1
    return out


def _prefix(label: str) -> str:
    return label[: len(label) - len(bare(label))]
