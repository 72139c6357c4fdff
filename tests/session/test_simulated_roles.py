"""Another world waits for a reset, another driver takes the wheel at once; both can be undone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scene_core import params
from scene_core.filter.ports import Truth
from scene_core.params import ParamError
from scene_core.session import toml_io
from scene_core.session.commands import ResetParams, SetParam, SwapModel, Transport, Undo
from scene_core.session.presets import build
from scene_core.session.roles import role_options
from scene_core.session.session import Session
from scene_core.sources.world_file import WorldFile

DRIVER = "source.robots.nomad.driver"
WORLD = "source.world"


def truth_of(session: Session) -> Truth:
    assert session.trace is not None and session.trace.frame.truth is not None
    return session.trace.frame.truth


def test_a_simulation_offers_worlds_of_its_dimension_and_drivers() -> None:
    roles = {r.role: r for r in role_options(build("nomad"))}
    assert roles[WORLD].current == "field"
    assert set(roles[WORLD].options) == {"field", "random plane", "corridor plan", "world file"}
    assert {"waypoints", "manual", "constant"} <= set(roles[DRIVER].options)
    room = {r.role for r in role_options(build("room"))}
    assert WORLD not in room and "source.robots.hand.driver" in room


def test_a_world_that_may_be_of_any_dimension_is_left_for_one_that_can_be_measured() -> None:
    session = Session(build("nomad"))
    session.apply(SwapModel(WORLD, "world file"))
    roles = {r.role: r for r in role_options(session.settings.experiment, session.base)}
    assert set(roles[WORLD].options) == {"field", "random plane", "corridor plan", "world file"}
    with pytest.raises(ParamError, match=r"no .cloister. for source\.world"):
        session.apply(SwapModel(WORLD, "cloister"))


def test_a_robot_is_driven_by_hand_from_the_next_frame_on() -> None:
    session = Session(build("nomad"))
    for _ in range(3):
        session.advance()
    session.apply(SwapModel(DRIVER, "manual"))
    session.advance()
    here = truth_of(session).xp["nomad"]
    session.advance()
    np.testing.assert_array_equal(truth_of(session).xp["nomad"], here)
    session.apply(SetParam(f"{DRIVER}.forward", 0.5))
    session.advance()
    moved = truth_of(session).xp["nomad"]
    assert np.linalg.norm(moved[:2] - here[:2]) > 0.02
    # The command log replays it, and undo gives the wheel back.
    session.apply(Transport("back"))
    session.advance()
    np.testing.assert_array_equal(truth_of(session).xp["nomad"], moved)
    session.apply(Undo())
    session.apply(Undo())
    session.advance()
    assert session.running.source == build("nomad").source


def test_a_driver_says_when_it_takes_over() -> None:
    session = Session(build("nomad"))
    session.apply(SwapModel(DRIVER, "manual"))
    assert session.message == "'manual' drives 'nomad' from the next frame on"


def test_waypoints_are_edited_live() -> None:
    session = Session(build("nomad"))
    session.apply(SetParam(f"{DRIVER}.points", [[0.0, 0.0]]))
    for _ in range(250):
        session.advance()
    assert np.linalg.norm(truth_of(session).xp["nomad"][:2]) < 0.5
    text = toml_io.dumps(session.settings.experiment)
    assert "points_m = [[0.0, 0.0]]" in text


def test_another_world_begins_with_a_reset() -> None:
    session = Session(build("nomad"))
    session.advance()
    before = truth_of(session).points
    session.apply(SwapModel(WORLD, "random plane"))
    session.apply(SetParam(f"{WORLD}.count", 17))
    session.advance()
    np.testing.assert_array_equal(truth_of(session).points, before)
    session.apply(Transport("reset"))
    session.advance()
    assert truth_of(session).points.shape == (17, 2)
    session.apply(ResetParams())
    session.apply(Transport("reset"))
    session.advance()
    np.testing.assert_array_equal(truth_of(session).points, before)


def test_a_world_from_a_file_and_a_file_that_is_wrong(tmp_path: Path) -> None:
    session = Session(build("nomad"))
    session.advance()
    session.apply(SwapModel(WORLD, "world file"))
    assert session.message == "takes effect on reset; before that give the path of its file"
    with pytest.raises(ParamError, match=r"nowhere\.toml can not be opened"):
        session.apply(SetParam(f"{WORLD}.path", "nowhere.toml"))
    file = tmp_path / "my.toml"
    file.write_text("points = [[3.0, 0.5], [2.0, -1.0]]")
    session.apply(SetParam(f"{WORLD}.path", str(file)))
    session.advance()
    session.apply(Transport("reset"))
    session.advance()
    np.testing.assert_array_equal(truth_of(session).points, [[3.0, 0.5], [2.0, -1.0]])
    read = toml_io.loads(toml_io.dumps(session.settings.experiment))
    assert read == session.settings.experiment
    file.unlink()
    with pytest.raises(ParamError, match=r"my\.toml can not be opened"):
        toml_io.loads(toml_io.dumps(read))


def test_landmarks_a_file_calls_known_are_given_to_the_estimator(tmp_path: Path) -> None:
    file = tmp_path / "my.toml"
    file.write_text(
        "points = [[4.0, 1.0], [2.0, 4.0], [4.0, 3.0]]\nids = [5, 8, 9]\nknown = [8, 9]\nsd = 0.02"
    )
    base = build("nomad")
    session = Session(params.put(base, WORLD, WorldFile(str(file))))
    features = session.world.features
    assert [f.appearance for f in features.values()] == [8, 9]
    assert all(f.known for f in features.values())
    np.testing.assert_array_equal(session.world.gauss.mean("feature:2"), [4.0, 3.0])
    np.testing.assert_allclose(session.world.gauss.cov("feature:1"), 0.02**2 * np.eye(2))
    for _ in range(40):
        session.advance()
    labels = {f.appearance: f for f in session.world.features.values()}
    assert labels[8].updates + labels[9].updates > 10 and len(labels) == 3


@pytest.mark.parametrize(
    ("preset", "role", "name", "words"),
    [
        ("nomad", DRIVER, "hand held", "'hand held' can not drive 'planar nomad': .*'vx'"),
        ("cloister", "source.robots.robot.driver", "shuttle", "sets the speed v"),
        (
            "nomad",
            DRIVER,
            "shuttle",
            "'shuttle' can not drive 'planar nomad': it goes to and fro on a line, and this is a "
            r"robot in 2-D; choose another driver \(constant, waypoints, manual\)$",
        ),
        (
            "gyro",
            "source.robots.hand.driver",
            "waypoints",
            "'waypoints' can not drive 'impulse': it has no controls to steer by; choose another "
            r"driver \(constant, manual, hand held\)$",
        ),
        (
            "inertial",
            "source.robots.body.driver",
            "constant",
            r"stays where it is needs az = 9.81 m/s²; choose another driver \(waypoints, manual\)$",
        ),
        ("gyro", WORLD, "house", "given landmarks of the world 'cloister' at the start"),
        ("nomad", WORLD, "house", "no 'house' for source.world: choose .*field"),
        ("terrain", WORLD, "cloister", "the world 'cloister' has no ground to drive on"),
    ],
)
def test_what_makes_no_sense_is_refused(preset: str, role: str, name: str, words: str) -> None:
    session = Session(build(preset))
    with pytest.raises(ParamError, match=words):
        session.apply(SwapModel(role, name))
    assert params.get(session.settings.experiment, role) == params.get(build(preset), role)


def test_a_waypoint_of_another_dimension_is_refused_when_it_is_given() -> None:
    session = Session(build("nomad"))
    session.advance()
    points = params.get(session.settings.experiment, f"{DRIVER}.points")
    for value in ([[1.0]], [[1.0, 2.0, 3.0]], "1; 2"):
        with pytest.raises(ParamError, match=r"nomad\.driver: waypoint 1 is .*2-D needs 2 numbers"):
            session.apply(SetParam(f"{DRIVER}.points", value))
    assert params.get(session.settings.experiment, f"{DRIVER}.points") == points
    session.advance()


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("source.robots.nomad.on_ground", True, "'planar nomad' can not be kept on the ground"),
        ("source.mounts.scanner.calib_sd.fu", 1.0, "mounts.scanner: there is no calibration 'fu'"),
        ("source.robots.nomad.calib_sd.k", 1.0, "no calibration 'k': it has speed scale"),
    ],
)
def test_what_the_truth_does_not_have_is_refused_when_it_is_set(
    path: str, value: object, words: str
) -> None:
    session = Session(build("nomad"))
    session.advance()
    before = session.settings.experiment
    with pytest.raises(ParamError, match=words):
        session.apply(SetParam(path, value))
    assert session.settings.experiment == before
    session.apply(SetParam("source.robots.nomad.calib_sd.speed scale", 0.1))
    session.advance()


def test_waypoints_may_be_given_as_they_are_typed() -> None:
    session = Session(build("nomad"))
    session.apply(SetParam(f"{DRIVER}.points", "2, 0; 0, 2.5"))
    assert params.get(session.settings.experiment, f"{DRIVER}.points") == ((2.0, 0.0), (0.0, 2.5))


def test_another_truth_that_the_driver_can_not_drive_is_refused_in_one_sentence() -> None:
    session = Session(build("cloister"))
    with pytest.raises(ParamError) as refused:
        session.apply(SwapModel("source.robots.robot.motion", "arm"))
    said = str(refused.value)
    assert "'constant' can not drive 'arm': it sets dx, az, and the controls are u1, u2" in said
    assert said.count("choose") == 1 and said.endswith("(constant, waypoints, manual)")


@pytest.mark.parametrize(("preset", "robot"), [("cloister", "robot"), ("inertial", "body")])
def test_bodies_in_space_go_from_waypoint_to_waypoint(preset: str, robot: str) -> None:
    session = Session(build(preset))
    session.advance()
    start = truth_of(session).xp[robot][:3]
    there = start + np.array([1.0, 1.0, 0.5])
    session.apply(SwapModel(f"source.robots.{robot}.driver", "waypoints"))
    session.apply(SetParam(f"source.robots.{robot}.driver.points", [list(there), list(start)]))
    gone = []
    for _ in range(round(15.0 * session.running.source.frame_rate)):
        session.advance()
        gone.append(truth_of(session).xp[robot][:3])
    to, back = (np.linalg.norm(np.array(gone) - place, axis=1) for place in (there, start))
    assert to.min() < 0.3 and back.max() < 2.5
    assert back[int(to.argmin()) :].min() < 0.3


def test_a_scene_with_y_up_is_driven_along_its_own_axes() -> None:
    session = Session(build("nomad"))
    session.apply(SwapModel(DRIVER, "manual"))
    driver = params.get(session.settings.experiment, DRIVER)
    assert driver.axes == "z forward, x left, y up"
