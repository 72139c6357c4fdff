"""Driving by keys, and the list of waypoints in the page and on the map."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, TypeVar

import numpy as np
import pytest
import viser

from scene_core.geometry.spaces import ONE_D, THREE_D, TWO_D
from scene_core.session.commands import SetParam
from scene_core.session.config import Experiment
from scene_core.session.presets import build
from scene_core.session.published import Published
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from scene_core.sources.manual import Manual
from scene_core.sources.simulated import Simulation
from scene_core.sources.terrain import Terrain
from tests.web.fakes import FakeSession
from tests.web.raw_client import RawClient, raw_client
from tests.web.test_gate import free_port, wait
from web_panels import gate
from web_panels.drive import Drive, asked
from web_panels.keys import KEYS, parse_keys
from web_panels.layout import Layout
from web_panels.map_geometry import Bounds
from web_panels.map_panel import MapPanel
from web_panels.view_loop import ViewLoop
from web_panels.waypoint_list import WaypointList
from web_panels.waypoints import as_point, moved, on_map, waypoints_of, where_it_meets, without

POINTS = "source.robots.nomad.driver.points"
HAND = "source.robots.nomad.driver"
_times = count()
Kind = TypeVar("Kind")


def driven(by_hand: bool) -> Experiment:
    e = build("nomad")
    if not by_hand:
        return e
    source = e.source
    assert isinstance(source, Simulation)
    robots = {name: replace(r, driver=Manual()) for name, r in source.robots.items()}
    return replace(e, source=replace(source, robots=robots))


def after(e: Experiment, frames: int = 5) -> Published:
    session = Session(e)
    for _ in range(frames):
        session.advance()
    return Runner(session).latest


@dataclass
class Site:
    server: viser.ViserServer
    fake: FakeSession
    layout: Layout
    view: ViewLoop

    def panel(self, kind: type[Kind]) -> Kind:
        return next(p for p in self.layout.panels if isinstance(p, kind))


def site_of(published: Published) -> Iterator[Site]:
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    fake = FakeSession(published)
    view = ViewLoop(server, fake)
    view.start()
    assert view.built.wait(20.0) and view.layout is not None
    yield Site(server, fake, view.layout, view)
    assert view.page.problems == {}
    view.stop()
    server.stop()


@pytest.fixture(scope="module")
def by_hand() -> Iterator[Site]:
    yield from site_of(after(driven(by_hand=True)))


@pytest.fixture(scope="module")
def by_list() -> Iterator[Site]:
    yield from site_of(after(driven(by_hand=False)))


def hold(me: RawClient, uuid: str, *keys: str) -> None:
    me.set(uuid, json.dumps([list(keys), next(_times)]))


@pytest.mark.parametrize(
    "text", ["", "[]", "[[]]", '[["KeyX"],1]', "[[1],1]", '["KeyW",1]', "{}", None, 7, "[[],1,2]"]
)
def test_only_lists_of_driving_keys_are_heard(text: object) -> None:
    assert parse_keys(text) is None


def test_keys_ask_for_speeds() -> None:
    speeds = {"speed": 0.5, "rate": 0.6}
    assert parse_keys('[["KeyW","ArrowLeft"],3.5]') == {"KeyW", "ArrowLeft"}
    assert asked(frozenset({"KeyW", "ArrowLeft"}), speeds) == {
        "forward": 0.5, "turn": 0.6, "left": 0.0, "up": 0.0,
    }  # fmt: skip
    assert asked(frozenset({"KeyW", "ArrowUp", "KeyS"}), speeds)["forward"] == 0.0
    assert not any(asked(frozenset(), speeds).values())
    assert all(any(asked(frozenset({key}), speeds).values()) for key in KEYS)


def test_held_keys_drive_and_let_go_stop(by_hand: Site) -> None:
    posted, uuid = by_hand.fake.posted, by_hand.panel(Drive).keys.uuid
    with raw_client(by_hand.server) as me:
        me.settle()
        posted.clear()
        hold(me, uuid, "KeyW")
        hold(me, uuid, "KeyW", "KeyD")
        hold(me, uuid, "KeyD")
        hold(me, uuid)
        assert wait(lambda: len(posted) == 4)
    assert posted == [
        SetParam(f"{HAND}.forward", 0.5),
        SetParam(f"{HAND}.turn", -0.6),
        SetParam(f"{HAND}.forward", 0.0),
        SetParam(f"{HAND}.turn", 0.0),
    ]


def test_one_press_of_keys_until_all_are_let_go_is_one_gesture(by_hand: Site) -> None:
    posted, uuid = by_hand.fake.posted, by_hand.panel(Drive).keys.uuid
    with raw_client(by_hand.server) as me:
        me.settle()
        posted.clear()
        hold(me, uuid, "KeyW")
        hold(me, uuid, "KeyW", "KeyD")
        hold(me, uuid)
        hold(me, uuid, "KeyW")
        hold(me, uuid)
        assert wait(lambda: len(posted) == 6)
    first, second = posted[0], posted[4]
    assert isinstance(first, SetParam) and isinstance(second, SetParam)
    gestures = [c.gesture for c in posted if isinstance(c, SetParam)]
    assert gestures == 4 * [first.gesture] + 2 * [second.gesture]
    assert first.gesture and second.gesture not in ("", first.gesture)


def test_who_leaves_lets_go(by_hand: Site) -> None:
    posted, uuid = by_hand.fake.posted, by_hand.panel(Drive).keys.uuid
    with raw_client(by_hand.server) as me:
        me.settle()
        posted.clear()
        hold(me, uuid, "ArrowUp")
        assert wait(lambda: posted == [SetParam(f"{HAND}.forward", 0.5)])
    assert wait(lambda: len(posted) == 2)
    assert posted[1] == SetParam(f"{HAND}.forward", 0.0)


def test_the_keys_are_the_cameras_while_nobody_drives_by_hand(by_list: Site) -> None:
    drive = by_list.panel(Drive)
    assert not drive.box.visible and 'data-on="0"' in drive.keys.marker.content
    with raw_client(by_list.server) as me:
        me.settle()
        by_list.fake.posted.clear()
        hold(me, drive.keys.uuid, "KeyW")
        me.settle()
    assert by_list.fake.posted == []


def test_driving_is_a_part_of_the_command_log() -> None:
    """The robot goes where the keys say, and a run with the same edits goes there too."""
    places = []
    for _ in range(2):
        session = Session(driven(by_hand=True))
        session.advance()
        for name, value in asked(frozenset({"KeyW", "KeyA"}), {"speed": 0.5, "rate": 0.6}).items():
            session.apply(SetParam(f"{HAND}.{name}", value))
        for _ in range(10):
            session.advance()
        assert session.trace is not None and session.trace.frame.truth is not None
        places.append(session.trace.frame.truth.xp["nomad"])
        assert len(session.log) == 2
    np.testing.assert_array_equal(*places)
    assert np.linalg.norm(places[0][:2]) > 0.2


def test_waypoints_are_edited_as_a_list(by_list: Site) -> None:
    p = by_list.fake.latest
    assert p is not None
    points = waypoints_of(p, "nomad")
    assert points is not None and len(points) == 4
    posted = by_list.fake.posted
    with raw_client(by_list.server) as me:
        row = me.input("2")
        buttons = [m for m in me.seen if m.get("props", {}).get("options") == ["↑", "↓", "✕"]]
        me.settle()
        posted.clear()
        me.set(row["uuid"], (1.5, -2.0))
        assert wait(lambda: len(posted) == 1)
        me.set(buttons[1]["uuid"], "✕")
        assert wait(lambda: len(posted) == 2)
        me.set(buttons[1]["uuid"], "↓")
        assert wait(lambda: len(posted) == 3)
        me.set(me.input("Add here")["uuid"], True)
        assert wait(lambda: len(posted) == 4)
    edited = (points[0], (1.5, -2.0), *points[2:])
    assert posted[0] == SetParam(POINTS, edited)
    assert posted[1] == SetParam(POINTS, without(points, 1))
    assert posted[2] == SetParam(POINTS, moved(points, 1, 1))
    added = posted[3]
    assert isinstance(added, SetParam) and added.value[:-1] == points and p.trace is not None
    assert p.trace.frame.truth is not None
    np.testing.assert_allclose(added.value[-1], p.trace.frame.truth.xp["nomad"][:2], atol=0.01)


def test_a_click_on_the_ground_adds_a_waypoint_only_when_asked(by_list: Site) -> None:
    panel, page = by_list.panel(MapPanel), by_list.view.page
    points = waypoints_of(panel.floor.latest, "nomad")
    assert points is not None and not panel.floor.node.visible
    click: dict[str, Any] = dict(
        name="/map/waypoints/floor", instance_index=None, ray_origin=(0.0, 5.0, 0.0),
        ray_direction=(-0.2, -1.0, 0.1), screen_pos=(0.5, 0.5), modifier=None,
    )  # fmt: skip
    with raw_client(by_list.server) as me:
        me.settle()
        by_list.fake.posted.clear()
        me.send("SceneNodeClickMessage", **click)
        me.settle()
        assert by_list.fake.posted == []
        me.set(me.input("Click to add")["uuid"], True)
        assert wait(lambda: panel.floor.node.visible)
        me.send("SceneNodeClickMessage", **click)
        assert wait(lambda: len(by_list.fake.posted) == 1)
        page.change(placing="")
        assert wait(lambda: not panel.floor.node.visible)
    (added,) = by_list.fake.posted
    assert isinstance(added, SetParam) and added.value[:-1] == points
    fallen = 5.0 - panel.floor.level
    assert panel.floor.up == "y"
    np.testing.assert_allclose(added.value[-1], (0.1 * fallen, -0.2 * fallen), atol=0.01)


def test_flags_stand_at_the_waypoints_and_the_goal_is_marked(by_list: Site) -> None:
    flags = by_list.panel(MapPanel).flags
    p = by_list.fake.latest
    assert p is not None and p.trace is not None and p.trace.frame.truth is not None
    points = waypoints_of(p, "nomad")
    assert points is not None
    assert len(flags.flags.points) == 3 * 3 and len(flags.goals.points) == 3
    feet = on_map(points, TWO_D, "y")
    goal = p.trace.frame.truth.goals["nomad"]
    k = points.index((float(goal[0]), float(goal[1])))
    np.testing.assert_allclose(flags.goals.points[0, 0], feet[k], atol=1e-5)
    assert sorted(label.text for label in flags.labels.values()) == ["1", "2", "3", "4"]


def test_lists_are_moved_and_shortened() -> None:
    points = ((0.0,), (1.0,), (2.0,))
    assert moved(points, 0, -1) == points and moved(points, 2, 1) == points
    assert moved(points, 0, 1) == ((1.0,), (0.0,), (2.0,))
    assert without(points, 1) == ((0.0,), (2.0,))
    assert np.isnan(on_map(((1.0, 2.0),), ONE_D, "z")).all()


@pytest.mark.parametrize("space", [ONE_D, TWO_D, THREE_D], ids=lambda s: s.name)
@pytest.mark.parametrize("up", ["y", "z"])
def test_places_on_the_map_and_waypoints_are_the_same(space, up) -> None:
    point = (1.25, -2.5, 3.75)[: space.d]
    (place,) = on_map((point,), space, up)
    assert as_point(place, space, up) == point


@pytest.mark.parametrize("up", ["y", "z"])
def test_rays_meet_undulating_ground(up: str) -> None:
    e = build("nomad")
    assert isinstance(e.source, Simulation)
    source = replace(e.source, world=Terrain(relief=0.4), up=up)
    axis = "xyz".index(up)
    bounds = Bounds(np.full(3, -8.0), np.full(3, 8.0))
    origin = np.roll(np.array([1.0, 2.0, 6.0]), axis - 2)
    down = np.roll(np.array([0.2, -0.3, -1.0]), axis - 2)
    at = where_it_meets(source, up, bounds, 0.0, origin, down)
    assert at is not None and np.linalg.norm(np.cross(at - origin, down)) < 1e-9
    flat = np.roll(at, 2 - axis)
    ground = Terrain(relief=0.4).ground(flat[:2])
    assert ground is not None and abs(float(ground.height) - flat[2]) < 0.01
    assert where_it_meets(source, up, bounds, 0.0, origin, -down) is None


def test_every_list_has_its_card(by_list: Site) -> None:
    card = by_list.panel(WaypointList)
    assert card.box.visible and card.robot == "nomad" and not card.chooser.handle.visible
