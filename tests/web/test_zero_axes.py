"""The button that moves the axes, and the map in the new ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import viser

from scene_core.geometry.embedding import embed_points
from scene_core.geometry.spaces import THREE_D
from scene_core.session.commands import Seek, ZeroAxes
from scene_core.session.presets import build
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from tests.web.fakes import FakeSession
from tests.web.raw_client import raw_client
from tests.web.test_gate import free_port, wait
from web_panels import gate
from web_panels import map_geometry as geo
from web_panels.view_loop import ViewLoop
from web_panels.zero_axes import axes_words


def zeroed(preset: str, frames: int = 12) -> tuple[Published, Published]:
    """A run before and after its axes were moved."""
    session = Session(build(preset))
    for _ in range(frames):
        session.advance()
    before = Runner(session).latest
    session.apply(ZeroAxes(next(iter(session.world.robots))))
    return before, Runner(session).latest


def distances(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None] - points[None], axis=-1)


@pytest.mark.parametrize("preset", ["line", "nomad", "cloister"])
def test_truth_is_drawn_from_where_the_robot_truly_is(preset: str) -> None:
    before, after = zeroed(preset)
    assert before.trace is not None and after.trace is not None
    world = after.trace.world
    robot, up = next(iter(world.robots)), world.up
    at = geo.true_position(after, robot, up=up)
    assert at is not None and np.abs(at).max() < 1e-12
    assert np.abs(geo.robot_pose(world, robot)[:3]).max() < 1e-12
    old, new = geo.true_points(before, up), geo.true_points(after, up)
    assert len(new) > 1 and np.allclose(distances(new), distances(old), atol=1e-9)
    # The place the simulation is in moves as its landmarks do.
    place = geo.place_of_world(after)
    moved = THREE_D.to_world(place, np.concatenate([old, np.ones((len(old), 1))], axis=1)).X
    assert np.allclose(moved[:, :3], new, atol=1e-9)


def test_without_new_axes_nothing_is_moved() -> None:
    before, _ = zeroed("cloister", 3)
    assert before.trace is not None and before.trace.frame.truth is not None
    truth = before.trace.frame.truth
    assert np.array_equal(geo.true_points(before, "z"), embed_points(truth.points, THREE_D, "z"))
    assert np.array_equal(geo.place_of_world(before), THREE_D.identity())
    assert geo.view_name(before) == "cloister"


def test_every_view_belongs_to_its_axes() -> None:
    _, after = zeroed("cloister", 3)
    assert geo.view_name(after) == "cloister from robot in frame 2"


def test_the_words_say_where_the_axes_are_or_why_not() -> None:
    before, after = zeroed("line", 3)
    assert axes_words(before) == "The axes are those the run began in."
    assert axes_words(after) == "The axes are where robot 'robot' was at the end of frame 2."
    why = "the axes can not be put at robot 'cam': the motion model 'inertial' ..."
    assert axes_words(replace(after, message=why)) == why


def room_at(server: viser.ViserServer) -> np.ndarray:
    """Where the place is drawn; while the map is made anew it is nowhere."""
    node = server.scene._handle_from_node_name.get("/map/room")
    return np.full(3, np.nan) if node is None else np.asarray(node.position)


def test_the_button_asks_and_the_place_is_drawn_in_the_new_axes() -> None:
    session = Session(build("cloister"))
    for _ in range(8):
        session.advance()
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    fake = FakeSession(Runner(session).latest)
    view = ViewLoop(server, fake)
    view.start()
    try:
        assert view.built.wait(20.0)
        assert np.array_equal(room_at(server), np.zeros(3))
        with raw_client(server) as me:
            me.set(me.input("Zero axes here")["uuid"], True)
            assert wait(lambda: fake.posted == [ZeroAxes("robot")])
            session.apply(ZeroAxes("robot"))
            fake.latest = after = replace(Runner(session).latest, seq=10)
            place = geo.place_of_world(after)
            assert np.linalg.norm(place[:3]) > 0.1
            assert wait(lambda: np.allclose(room_at(server), place[:3]))
            session.apply(Seek(3))
            fake.latest = replace(Runner(session).latest, seq=11)
            assert wait(lambda: np.allclose(room_at(server), np.zeros(3)))
        assert view.page.problems == {}
    finally:
        view.stop()
        server.stop()
