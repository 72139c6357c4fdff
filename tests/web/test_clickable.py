"""Clicks on pictures: what the page's listener sends, and nothing else, becomes a command."""

import json
import socket
import time
from collections.abc import Iterator

import numpy as np
import pytest
import viser

from scene_core.session.commands import InitialiseAt, Select
from tests.web.raw_client import raw_client
from tests.web.traces import MOUNT, cloister, published
from web_panels import clickable, gate
from web_panels.clickable import Click, ClickableImage, parse_click
from web_panels.drawing import shapes_of
from web_panels.marks import scene_of
from web_panels.panel import Page
from web_panels.sensor_image import SensorImage, image_chart


def test_a_click_is_understood():
    assert parse_click("[0.25,0.5,17,true,1234.5]") == Click(0.25, 0.5, 17, True)


@pytest.mark.parametrize(
    "text",
    [
        "", "x", "[]", "{}", "null", "5", "[0.1,0.2,3,true]", "[0.1,0.2,3,1,0]",
        "[NaN,0.2,3,true,0]", "[Infinity,0.2,3,true,0]", "[1.01,0.2,3,true,0]",
        "[-0.01,0.2,3,true,0]", '["0.1",0.2,3,true,0]', "[0.1,0.2,3.5,true,0]",
        "[0.1,0.2,1e300,true,0]", "[true,0.2,3,true,0]", "[[0.1],0.2,3,true,0]", None, 3,
    ],
)  # fmt: skip
def test_anything_else_is_dropped(text):
    assert parse_click(text) is None


def pane_showing_a_frame():
    """A pane as it is after a frame was drawn, and the commands it posts."""
    posted: list = []
    pane = SensorImage(Page(), MOUNT)
    pane.post = posted.append
    p = published(cloister())
    scene = scene_of(p, MOUNT)
    assert scene is not None
    chart = image_chart(cloister().world.mounts[MOUNT].sensor, scene)
    shapes = shapes_of(scene, chart)
    pane.shown[scene.frame] = (shapes, chart)
    return pane, posted, shapes, chart, scene.frame


def at(xy, chart, frame, shift=False) -> Click:
    width, height = chart.size
    return Click((xy[0] + 0.5) / width, (xy[1] + 0.5) / height, frame, shift)


def test_a_click_on_a_feature_selects_it_and_again_lets_go():
    pane, posted, shapes, chart, frame = pane_showing_a_frame()
    shape = next(s for s in shapes if s.mark.state == "accepted")
    pane.clicked(at(shape.centre, chart, frame))
    assert posted == [Select(shape.mark.label)]
    pane._selected = shape.mark.label
    pane.clicked(at(shape.centre, chart, frame))
    assert posted[-1] == Select(None)


def test_a_click_beside_all_features_starts_one_in_the_frame_that_was_shown():
    pane, posted, shapes, chart, frame = pane_showing_a_frame()
    z = np.array([601.5, 33.25])
    assert min(np.linalg.norm(s.centre - chart.place(z)) for s in shapes) > 60
    pane.clicked(at(chart.place(z), chart, frame))
    (command,) = posted
    assert isinstance(command, InitialiseAt)
    assert (command.mount, command.frame) == (MOUNT, frame)
    assert command.z == pytest.approx(tuple(z), abs=1e-6)


def test_a_shift_click_starts_one_even_on_a_feature():
    pane, posted, shapes, chart, frame = pane_showing_a_frame()
    pane.clicked(at(shapes[0].centre, chart, frame, shift=True))
    assert isinstance(posted[0], InitialiseAt)


def test_a_click_on_a_picture_that_was_never_shown_does_nothing():
    pane, posted, shapes, chart, frame = pane_showing_a_frame()
    pane.clicked(at(shapes[0].centre, chart, frame + 1))
    assert posted == []


def test_the_listener_answers_in_the_form_that_is_parsed():
    """The fields of the script and of the parser are the same, in the same order."""
    sent = clickable._LISTENER.split("JSON.stringify([")[1].split("])")[0].replace("\n", "")
    assert [part.strip() for part in sent.split(",")] == [
        "(e.clientX-r.left)/r.width",
        "(e.clientY-r.top)/r.height",
        "Number(m.dataset.frame)",
        "e.shiftKey",
        "performance.now()",
    ]
    assert parse_click(json.dumps([0.5, 0.5, 3, False, 17.25])) == Click(0.5, 0.5, 3, False)


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = int(s.getsockname()[1])
    server = gate.guarded_server("127.0.0.1", port, None)
    yield server
    server.stop()


def test_only_clicks_come_through_the_channel(server):
    """A program that writes rubbish into the hidden text widget is not heard."""
    heard: list[Click] = []
    picture = ClickableImage(server, np.zeros((4, 4, 3), np.uint8), heard.append)
    rubbish = ["", "[1,2]", "[0.5,0.5,1,false]", "[9,9,9,false,1]", 5, None, ["x"], "x" * 5000]
    with raw_client(server) as client:
        client.settle()
        for value in [*rubbish, "[0.5,0.25,7,false,1]", *rubbish, "[0.5,0.25,7,false,2]"]:
            client.set(picture.uuid, value)
        end = time.monotonic() + 5.0
        while len(heard) < 2 and time.monotonic() < end:
            time.sleep(0.01)
        client.settle()
    assert heard == [Click(0.5, 0.25, 7, False)] * 2


def test_a_picture_and_its_frame_reach_the_page(server):
    picture = ClickableImage(server, np.zeros((4, 4, 3), np.uint8), lambda click: None)
    with raw_client(server) as client:
        client.settle()
        picture.show(np.full((6, 8, 3), 200, np.uint8), 41)
        mark = client.until(lambda m: 'data-frame="41"' in str(m.get("updates", {})))
        assert picture.key in str(mark)
        image = client.until(lambda m: "_data" in m.get("updates", {}))
        assert bytes(image["updates"]["_data"])[:2] == b"\xff\xd8"
