"""Units in the keys of a settings file: sd_accel in m/s² is written sd_accel_m_per_s2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scene_core.models.labels import quaternions
from scene_core.session.start import ROTATION

_PLAIN = str.maketrans({"²": "2", "³": "3", "⁴": "4", "⁶": "6", "√": "sqrt"})


def slug(unit: str) -> str:
    """A unit as a part of a key: m/s² -> m_per_s2, 1/px² -> per_px2."""
    above, *below = unit.translate(_PLAIN).split("/")
    above = "" if above == "1" else above
    return "_".join(part for part in (above, *(f"per_{one}" for one in below)) if part)


def key(name: str, unit: str) -> str:
    """The key of a parameter; the unit is not said twice (sd_px, dx_mm)."""
    tail = slug(unit)
    if not tail or name == tail or name.endswith(f"_{tail}"):
        return name
    return f"{name}_{tail}"


def label_units(owner: Any) -> Mapping[str, str]:
    """Units by label of whatever a mapping in a robot's or mount's settings can be about."""
    units: dict[str, str] = {}
    motion, sensor = getattr(owner, "motion", None), getattr(owner, "sensor", None)
    if motion is not None:
        units |= dict(zip(motion.state_labels, motion.state_units, strict=True))
        units |= dict(zip(motion.control_labels, motion.control_units, strict=True))
        units |= dict(zip(motion.calib_labels, motion.calib_units, strict=True))
        space = motion.space
    elif sensor is not None:
        units |= dict(zip(sensor.calib_labels, sensor.calib_units, strict=True))
        space = sensor.space
        units |= dict(zip(space.labels, space.units, strict=True))
    else:
        return units
    for prefix in quaternions(list(units)):
        units |= {prefix + label: "rad" for label in ROTATION}
    return units
