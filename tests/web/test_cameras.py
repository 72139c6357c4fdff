"""Browsers see all of the map, and keep a view of their own, however late their reports come."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator

import numpy as np
import pytest
import viser

from scene_core.session.presets import build
from scene_core.session.runner import Runner
from scene_core.session.session import Session
from tests.web.raw_client import CAMERA, RawClient, raw_client
from tests.web.test_gate import free_port, wait
from web_panels import gate, map_geometry
from web_panels.cameras import Cameras, read_camera
from web_panels.map_panel import MapPanel
from web_panels.panel import Page
from web_panels.viewpoints import FOV


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    yield server
    server.stop()


@pytest.mark.parametrize(
    "text",
    [
        None,
        "",
        "[]",
        "{}",
        '{"run": "room", "position": [0, 0], "look_at": [1, 1, 1]}',
        '{"run": "room", "position": [1, 1, 1], "look_at": [1, 1, 1]}',
        '{"run": "room", "position": ["a", 0, 0], "look_at": [1, 1, 1]}',
        '{"run": "room", "position": [NaN, 0, 0], "look_at": [1, 1, 1]}',
        '{"run": "line", "position": [0, 0, 0], "look_at": [1, 1, 1]}',
    ],
)
def test_a_kept_camera_that_does_not_fit_is_forgotten(text: str | None) -> None:
    assert read_camera(text, "room") is None


def test_a_kept_camera_is_read() -> None:
    text = json.dumps({"run": "room", "position": [0, 1, 2], "look_at": [3, 4, 5]})
    kept = read_camera(text, "room")
    assert kept is not None
    assert kept[0].tolist() == [0, 1, 2] and kept[1].tolist() == [3, 4, 5]


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("aspect", [0.5, 0.73, 1.0, 1.6])
def test_every_view_shows_all_of_the_map_and_hardly_more(
    server: viser.ViserServer, up: str, aspect: float
) -> None:
    cameras = Cameras(server)
    cameras.up = up
    axis = np.eye(3)["xyz".index(up)]
    lo, hi = np.array([-1.0, -2.0, 0.0]), np.array([3.0, 2.0, 1.0])
    corners = np.array(np.meshgrid(*np.stack([lo, hi], 1))).reshape(3, -1).T
    for view in ("perspective", "top", "side"):
        at, target = cameras._standing(view, map_geometry.Bounds(lo, hi), aspect)
        np.testing.assert_array_equal(target, 0.5 * (lo + hi))
        ahead = (target - at) / np.linalg.norm(target - at)
        right = np.cross(ahead, axis) / np.linalg.norm(np.cross(ahead, axis))
        away = corners - at
        depth = away @ ahead
        x, y = away @ right / depth, away @ np.cross(right, ahead) / depth
        half = math.tan(0.5 * FOV)
        most = max(np.abs(x).max() / (aspect * half), np.abs(y).max() / half)
        assert (depth > 0).all() and 0.8 < most < 1.0


def stand(server: viser.ViserServer, client: RawClient, at: np.ndarray, width: int) -> None:
    """The browser reports its camera and its canvas."""
    (handle,) = server.get_clients().values()
    place = tuple(float(v) for v in at)
    client.send("ViewerCameraMessage", **{**CAMERA, "position": place, "image_width": width})
    assert wait(lambda: handle.camera.image_width == width)
    assert np.allclose(handle.camera.position, at)


def test_a_view_that_was_never_moved_grows_with_the_map_although_reports_come_late(
    server: viser.ViserServer,
) -> None:
    cameras = Cameras(server)
    lo, hi = np.array([-1.0, -2.0, 0.0]), np.array([3.0, 2.0, 1.0])
    bounds = [map_geometry.Bounds(k * lo, k * hi) for k in (1.0, 2.0, 3.0, 4.0)]
    with raw_client(server) as client:
        assert wait(lambda: len(server.get_clients()) == 1)
        (handle,) = server.get_clients().values()
        cameras.place("a run", bounds[0], "z")
        first = handle.camera.position.copy()
        cameras.refit(bounds[1])
        stand(server, client, first, 640)  # sent before the browser heard of the second place
        cameras.refit(bounds[2])
        wanted, _ = cameras._standing("perspective", bounds[2], 640 / 600)
        assert np.allclose(handle.camera.position, wanted)
        by_hand = wanted + np.array([0.5, 0.0, 0.0])
        stand(server, client, by_hand, 641)
        cameras.refit(bounds[3])
        assert np.allclose(handle.camera.position, by_hand)


def test_a_browser_that_hears_of_the_start_after_its_own_place_is_put_there_again(
    server: viser.ViserServer,
) -> None:
    cameras = Cameras(server)
    bounds = map_geometry.Bounds(np.array([-1.0, -2.0, 0.0]), np.array([3.0, 2.0, 1.0]))
    with raw_client(server) as client:
        assert wait(lambda: len(server.get_clients()) == 1)
        (handle,) = server.get_clients().values()
        handle.camera.on_update(cameras._remember)
        cameras.place("another run", bounds, "z")
        wanted, _ = cameras._standing("perspective", bounds, 400 / 600)
        stand(server, client, server.initial_camera.position, 400)
        assert wait(lambda: cameras.moving)
        cameras.move(np.zeros(3), None, bounds)
        assert np.allclose(handle.camera.position, wanted) and not cameras.moving
        stand(server, client, wanted, 401)
        stand(server, client, server.initial_camera.position, 400)
        assert wait(lambda: cameras.moving)


def test_a_browser_hears_where_to_stand_before_what_is_there_and_all_of_it_at_once(
    server: viser.ViserServer,
) -> None:
    panel = MapPanel(Page())
    panel.build(server, lambda _: None)
    panel.render(Runner(Session(build("terrain"))).latest)
    word = re.compile("SetCamera(Position|LookAt|UpDirection|Fov)Message")
    for fresh in (True, False):
        with raw_client(server) as client:
            client.until(lambda m: m.get("name", "").startswith("/map/"))
            client.settle()
            told = [m.get("name", "") if "name" in m else m["type"] for m in client.seen]
        words = [i for i, what in enumerate(told) if word.fullmatch(what)]
        assert told[words[0]] == "SetCameraPositionMessage"
        assert words == list(range(words[0], words[0] + 4))
        drawn = [i for i, what in enumerate(told) if what.startswith("/map/")]
        assert words[0] < drawn[0] or not fresh
        larger = map_geometry.Bounds(2.0 * panel.bounds.lo, 2.0 * panel.bounds.hi)
        panel.cameras.refit(larger)


def test_a_browser_that_was_not_told_in_time_is_put_where_it_sees_all(
    server: viser.ViserServer,
) -> None:
    cameras = Cameras(server)
    bounds = map_geometry.Bounds(np.array([-1.0, -2.0, 0.0]), np.array([3.0, 2.0, 1.0]))
    cameras.place("a run", bounds, "z")
    with raw_client(server):
        assert wait(lambda: len(server.get_clients()) == 1)
        (handle,) = server.get_clients().values()
        assert np.allclose(handle.camera.position, CAMERA["position"])
        cameras._refit(handle, bounds)
        wanted, _ = cameras._standing("perspective", bounds, 800 / 600)
        assert np.allclose(handle.camera.position, wanted)


def test_a_browser_that_hears_of_the_start_after_its_own_kept_view_is_given_that_again(
    server: viser.ViserServer,
) -> None:
    cameras = Cameras(server)
    bounds = map_geometry.Bounds(np.array([-1.0, -2.0, 0.0]), np.array([3.0, 2.0, 1.0]))
    own = np.array([5.0, 5.0, 2.0])
    with raw_client(server) as client:
        assert wait(lambda: len(server.get_clients()) == 1)
        (handle,) = server.get_clients().values()
        handle.camera.on_update(cameras._remember)
        cameras.place("a run", bounds, "z")
        cameras._own[handle.client_id] = (own, bounds.centre)
        stand(server, client, server.initial_camera.position, 400)
        assert wait(lambda: cameras.moving)
        cameras.move(np.zeros(3), None, bounds)
        assert np.allclose(handle.camera.position, own)
        cameras.ask(handle, "perspective")
        cameras.move(np.zeros(3), None, bounds)
        wanted, _ = cameras._standing("perspective", bounds, 400 / 600)
        assert np.allclose(handle.camera.position, wanted)
        cameras.refit(bounds)
        assert np.allclose(handle.camera.position, wanted)
