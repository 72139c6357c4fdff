"""The map is light to draw: walls need no lighting, places without a copy are never drawn."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator

import numpy as np
import pytest
import viser

from scene_core.session.presets import build
from tests.web.test_gate import free_port
from web_panels import gate
from web_panels.instances import OUT_OF_SIGHT, Instances
from web_panels.map_pace import pace_html
from web_panels.map_world import UNLIT, textured, unlit


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = gate.guarded_server("127.0.0.1", free_port(), None)
    yield server
    server.stop()


def test_walls_show_their_own_colours() -> None:
    """Every material of the room is unlit and seen from its front alone."""
    surfaces = build("room").source.world.surfaces()  # type: ignore[attr-defined]
    glb = unlit([textured(s) for s in surfaces])
    (length,) = struct.unpack_from("<I", glb, 12)
    tree = json.loads(glb[20 : 20 + length])
    assert len(tree["meshes"]) == len(surfaces) == len(tree["images"])
    assert UNLIT in tree["extensionsUsed"]
    for material in tree["materials"]:
        assert UNLIT in material["extensions"] and not material.get("doubleSided", False)
        assert "baseColorTexture" in material["pbrMetallicRoughness"]


def test_places_without_a_copy_are_beyond_what_browsers_draw(server: viser.ViserServer) -> None:
    layer = Instances(server, lambda _: None)
    far = np.linalg.norm(layer.node.batched_positions, axis=1)
    assert (far >= OUT_OF_SIGHT).all() and (layer.node.batched_scales == 0).all()


def test_the_script_stays_inside_its_attribute() -> None:
    html = pace_html()
    assert html.count('"') == 6 and html.endswith('">')
