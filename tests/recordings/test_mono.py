"""The camera recordings through the whole pipeline: a stretch of each that is soon over."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from scene_core.filter.records import Trace
from scene_core.session.presets import images
from scene_core.session.session import Session
from scene_core.session.tracks import pose_error, pose_estimate

HERE = Path(__file__).resolve().parent


def accepted(trace: Trace) -> int:
    return sum(a.verdict == "accepted" for a in trace.associations())


def test_testseq_finds_its_place_from_a_prior_that_is_wrong(
    recordings: Callable[[str], Path],
) -> None:
    """The prior is 10 cm off; from frame 30 on the camera is known to 3 cm and 2 degrees."""
    folder = recordings("mono_scenelib_testseq")
    experiment = images(
        str(folder / "frames"), str(HERE / "testseq.toml"), str(folder / "reference_sfm.txt")
    )
    session = Session(experiment)
    found, errors = [], []
    for _ in range(90):
        trace = session.advance()
        found.append(accepted(trace))
        if trace.frame.truth is not None and trace.frame.index >= 30:
            robot = trace.world.robots["camera"]
            estimate = pose_estimate(trace.world, "camera")
            truth = trace.frame.truth.xp["camera"]
            errors.append(pose_error(robot.motion.space, estimate.xp, truth))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert found[0] == 4, "the four known corners are found in the first image"
    assert min(found) >= 4
    assert np.linalg.norm(rms[:3]) < 0.03
    assert np.degrees(np.linalg.norm(rms[3:])) < 2.0
    converted = [f for f in session.world.features.values() if f.model.successor() is None]
    assert len(converted) >= 4 + 8


def test_the_desk_is_never_lost(recordings: Callable[[str], Path]) -> None:
    """No known features: the phone's slide to the side is seen as one, with little rotation."""
    video = recordings("mono_desk_translation") / "escritorio_traslacion.mp4"
    session = Session(images(str(video), str(HERE / "desk.toml")))
    found = [accepted(session.advance()) for _ in range(90)]
    assert min(found[1:]) >= 8
    x, y, z = session.world.xp("camera")[:3]
    assert abs(x) > 4.0 * max(abs(y), abs(z))
    feature_counts = [f.updates for f in session.world.features.values()]
    assert np.median(feature_counts) > 30
