"""Make the filter believe too much in its odometry, and watch the NEES leave its band.

Estimate and truth share no object: the robot goes on slipping as before, only the filter no longer
knows. Run it with `.venv/bin/python examples/02_wrong_on_purpose.py [FRAMES]`.
"""

from __future__ import annotations

import sys

import numpy as np

from scene_core import params
from scene_core.session.config import Experiment
from scene_core.session.presets import build
from scene_core.session.session import Session


def mean_nees(experiment: Experiment, frames: int) -> float:
    session = Session(experiment)
    for _ in range(frames):
        session.advance()
    nees = session.metrics.series().robots["robot"].nees
    assert nees is not None
    return float(np.nanmean(nees))


def main(frames: int = 150) -> None:
    right = build("cloister")
    # Settings are one tree of frozen values: an edit is a copy with one value replaced.
    motion = "estimator.robots.robot.motion"
    wrong = right
    for name in ("sd_position", "sd_angle"):
        sd = params.get(right, f"{motion}.{name}")
        wrong = params.replace(wrong, f"{motion}.{name}", 0.2 * sd)

    print(f"NEES of a 6-DoF pose, averaged over {frames} frames; a consistent filter has about 6")
    print(f"  noise as it is        {mean_nees(right, frames):8.2f}")
    print(f"  a fifth of the noise  {mean_nees(wrong, frames):8.2f}")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
