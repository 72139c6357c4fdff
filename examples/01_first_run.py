"""Run a scenario without the page, and hold its error against the filter's own opinion of it.

Run it with `.venv/bin/python examples/01_first_run.py [FRAMES]`.
"""

from __future__ import annotations

import sys

from scene_core.session.presets import build
from scene_core.session.session import Session


def main(frames: int = 100) -> None:
    session = Session(build("cloister"))
    for _ in range(frames):
        session.advance()

    # One row per frame, errors on the tangent: position [m] and rotation vector [rad].
    robot = session.metrics.series().robots["robot"]
    assert robot.error is not None and robot.nees is not None
    print(f"frame {session.frame}: {len(session.world.features)} landmarks in the map")
    for label, unit, error, sd in zip(
        robot.labels, robot.units, robot.error[-1], robot.sd[-1], strict=True
    ):
        inside = "inside" if abs(error) <= 3 * sd else "OUTSIDE"
        print(f"  {label:<3}error {error:+.5f} {unit:<4}3 sigma {3 * sd:.5f} {unit:<4}{inside}")
    low, high = robot.nees_band
    print(f"  NEES {robot.nees[-1]:.2f}, 95 % of values lie within {low:.2f} to {high:.2f}")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
