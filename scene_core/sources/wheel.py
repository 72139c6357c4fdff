"""Which driver can drive which robot."""

from __future__ import annotations

from collections.abc import Mapping

from scene_core.filter.ports import SourceError
from scene_core.models.base import MotionModel
from scene_core.sources.drivers import ConstantControls, Driver, Shuttle, Waypoints
from scene_core.sources.handheld import HandHeld
from scene_core.sources.manual import Manual
from scene_core.sources.truth import TrueRobot

DRIVERS: tuple[type[Driver], ...] = (ConstantControls, Waypoints, Shuttle, Manual, HandHeld)


def check_drivers(robots: Mapping[str, TrueRobot]) -> None:
    """Raises SourceError with the robot whose driver can not drive it, and the reason."""
    for name, robot in robots.items():
        try:
            check_driver(robot.driver, robot.motion)
        except SourceError as e:
            raise SourceError(f"source.robots.{name}.driver: {e}") from e


def check_driver(driver: Driver, motion: MotionModel) -> None:
    """Raises SourceError when a driver, as it is set, can not drive a motion model: with those that
    can, or with the setting that is wrong."""
    why = driver.unfit(motion)
    if why:
        fitting = ", ".join(cls.name for cls in DRIVERS if not cls().unfit(motion))
        raise SourceError(
            f"'{driver.name}' can not drive '{motion.name}': {why}; choose another driver "
            f"({fitting})"
        )
    driver.check(motion)
