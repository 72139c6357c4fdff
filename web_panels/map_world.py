"""The place on the map: ground, walls, true landmarks."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import trimesh
import viser
from PIL import Image as Picture
from trimesh.exchange.gltf import export_glb
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from scene_core.filter.world import World
from scene_core.session.published import Published
from web_panels import map_geometry as geo
from web_panels.map_geometry import Bounds
from web_panels.style import C

GROUND = (40, 52, 58)
"""Of undulating ground."""
UNLIT = "KHR_materials_unlit"
"""glTF's name for a material that no light changes."""


def _add_light(scene: viser.SceneApi, world: World, bounds: Bounds) -> None:
    up = "xyz".index(world.up)
    scene.set_up_direction("+y" if world.up == "y" else "+z")
    scene.configure_default_lights(False)
    scene.add_light_ambient("/map/light/all", intensity=1.0)
    sun = bounds.centre - 3.0 * bounds.radius * np.array([0.4, 0.7, 0.0])
    sun[up] = bounds.hi[up] + 4.0 * bounds.radius
    scene.add_light_directional("/map/light/sun", intensity=1.6, position=tuple(sun))
    # Reflections of surroundings are two thirds of a picture's cost where no card draws it.
    scene.configure_environment_map(None)
    sky = np.linspace((26, 33, 43), (9, 12, 17), 256)[:, None].repeat(8, 1)
    scene.set_background_image(sky.astype(np.uint8), format="png")


def _add_grid(scene: viser.SceneApi, world: World, bounds: Bounds) -> None:
    up = "xyz".index(world.up)
    cell = geo.nice(bounds.radius / 6.0)
    at = bounds.centre.copy()
    at[up] = bounds.lo[up] - 0.005 * bounds.radius
    at = np.round(at / cell) * cell * (np.arange(3) != up) + at * (np.arange(3) == up)
    size = 2.0 * cell * np.ceil(1.6 * bounds.radius / cell)
    scene.add_grid(
        "/map/ground",
        size,
        size,
        plane="xy" if world.up == "z" else "xz",
        position=at,
        cell_size=cell,
        section_size=2.0 * cell,
        cell_color=(30, 37, 47),
        section_color=(48, 58, 72),
    )


class Ground:
    """Grid, lights and sky; the room's surfaces, seen from inside only."""

    def __init__(self, scene: viser.SceneApi, p: Published, world: World, bounds: Bounds) -> None:
        _add_light(scene, world, bounds)
        _add_grid(scene, world, bounds)
        place = geo.place_of_world(p)
        self.room = scene.add_frame(
            "/map/room", show_axes=False, position=place[:3], wxyz=place[3:]
        )
        self._add_outline(scene, p, world)
        self._add_surfaces(scene, p)

    @staticmethod
    def _add_surfaces(scene: viser.SceneApi, p: Published) -> None:
        ground = geo.ground_mesh(p.experiment.source)
        if ground is not None:
            scene.add_mesh_simple(
                "/map/room/ground",
                *ground,
                color=GROUND,
                opacity=0.6,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
        surfaces = getattr(p.experiment.source, "surfaces", tuple)()
        if surfaces:
            walls = [textured(surface) for surface in surfaces]
            scene.add_glb(
                "/map/room/surfaces", unlit(walls), cast_shadow=False, receive_shadow=False
            )

    @staticmethod
    def _add_outline(scene: viser.SceneApi, p: Published, world: World) -> None:
        edges = geo.outline_of(p.experiment.source, world.up)
        if len(edges):
            scene.add_line_segments(
                "/map/room/edges",
                edges.astype(np.float32),
                (62, 74, 92),
                thickness=1.2,
                thickness_units="screen",
            )


def textured(surface: Any) -> trimesh.Trimesh:
    """A rectangle that shines in its own colours and is invisible from behind: one looks into a
    room over its walls, as into a doll's house."""
    a = surface.corner
    right, down = surface.width * surface.right, surface.height * surface.down
    vertices = np.array([a, a + right, a + right + down, a + down])
    faces = [[0, 3, 2], [0, 2, 1]]
    texture = surface.texture if surface.texture.ndim == 3 else surface.texture[..., None]
    dimmed = np.broadcast_to(0.62 * texture, (*texture.shape[:2], 3)).astype(np.uint8)
    encoded = io.BytesIO(cv2.imencode(".jpg", dimmed[..., ::-1])[1].tobytes())
    material = PBRMaterial(baseColorTexture=Picture.open(encoded), doubleSided=False)
    uv = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    visual = TextureVisuals(uv=uv, material=material)
    return trimesh.Trimesh(vertices, faces, visual=visual, process=False)


def unlit(meshes: Sequence[trimesh.Trimesh]) -> bytes:
    """One GLB of meshes that show their textures as they are, whatever shines on them."""

    def mark(tree: dict[str, Any]) -> None:
        tree["extensionsUsed"] = [UNLIT]
        for material in tree["materials"]:
            material["extensions"] = {UNLIT: {}}

    return export_glb(trimesh.Scene(list(meshes)), tree_postprocessor=mark)


class TrueLandmarks:
    """Where the landmarks really are: small yellow points and thin yellow lines."""

    def __init__(self, scene: viser.SceneApi, size: float) -> None:
        self.scene, self.size = scene, size
        self.node: viser.PointCloudHandle | None = None
        self.segments = scene.add_line_segments(
            "/map/truth/segments",
            np.zeros((0, 2, 3), np.float32),
            C["truth"],
            thickness=1.2,
            thickness_units="screen",
        )

    def render(self, p: Published, world: World, visible: bool) -> None:
        at = geo.true_points(p, world.up).astype(np.float32)
        if self.node is None and len(at):
            self.node = self.scene.add_point_cloud(
                "/map/truth/points",
                at,
                C["truth"],
                point_size=0.005 * self.size,
                point_shape="circle",
                precision="float32",
            )
        if self.node is not None:
            self.node.visible = visible and len(at) > 0
            self.node.points = at
        ends = geo.true_segments(p, world.up).astype(np.float32)
        self.segments.visible = visible and len(ends) > 0
        if self.segments.visible:
            self.segments.points = ends
