"""The layers of the map. Each owns its scene nodes and brings them up to date on `render`."""

from __future__ import annotations

import io
from collections.abc import Callable, Coroutine
from typing import Any

import cv2
import numpy as np
import trimesh
import viser
from PIL import Image as Picture
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from scene_core.arrays import Vec
from scene_core.filter.ports import Image
from scene_core.filter.records import Trace
from scene_core.filter.world import Label, World
from scene_core.models.base import Sensor
from scene_core.session.published import Published
from web_panels import map_geometry as geo
from web_panels import viser_hooks
from web_panels.map_geometry import Bounds, Cloud
from web_panels.style import STATE_OF_VERDICT, C, linear
from web_panels.verdicts import outcomes

BALL = trimesh.creation.icosphere(2)

Clicked = Callable[[viser.SceneNodePointerEvent], Coroutine[Any, Any, None]]


class Ground:
    """Grid, lights and sky; the room's surfaces, seen from inside only."""

    def __init__(self, scene: viser.SceneApi, p: Published, world: World, bounds: Bounds) -> None:
        up = "xyz".index(world.up)
        scene.set_up_direction("+y" if world.up == "y" else "+z")
        scene.configure_default_lights(False)
        scene.add_light_ambient("/map/light/all", intensity=0.9)
        sun = bounds.centre - 3.0 * bounds.radius * np.array([0.4, 0.7, 0.0])
        sun[up] = bounds.hi[up] + 4.0 * bounds.radius
        scene.add_light_directional("/map/light/sun", intensity=1.6, position=tuple(sun))
        scene.configure_environment_map("studio", environment_intensity=0.12)
        sky = np.linspace((26, 33, 43), (9, 12, 17), 256)[:, None].repeat(8, 1)
        scene.set_background_image(sky.astype(np.uint8), format="png")
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
        self.room = scene.add_frame("/map/room", show_axes=False)
        self._add_outline(scene, p, world)
        surfaces = getattr(getattr(p.experiment.source, "world", None), "surfaces", None)
        for i, surface in enumerate(surfaces() if surfaces is not None else ()):
            scene.add_mesh_trimesh(f"/map/room/{i}", textured(surface))

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
    material = PBRMaterial(
        emissiveTexture=Picture.open(encoded),
        emissiveFactor=[1.0, 1.0, 1.0],
        baseColorFactor=[0, 0, 0, 255],
        roughnessFactor=1.0,
        metallicFactor=0.0,
        doubleSided=False,
    )
    uv = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    visual = TextureVisuals(uv=uv, material=material)
    return trimesh.Trimesh(vertices, faces, visual=visual, process=False)


class Ellipsoids:
    """All features in one node. Every feature keeps its instance for as long as it lives."""

    def __init__(self, server: viser.ViserServer, clicked: Clicked) -> None:
        self.server, self.clicked = server, clicked
        self.slots: dict[Label, int] = {}
        self.label_at: dict[int, Label] = {}
        self._hold(256)

    def _hold(self, capacity: int) -> None:
        """Make the node for so many features. It never changes its size: browsers report GL errors
        while the attributes of a growing instanced mesh disagree."""
        self.capacity = capacity
        self.free = [i for i in range(capacity - 1, -1, -1) if i not in self.label_at]
        wxyz, positions, scales, colors = self._blank()
        self.node = self.server.scene.add_batched_meshes_simple(
            "/map/features",
            np.asarray(BALL.vertices),
            np.asarray(BALL.faces),
            wxyz,
            positions,
            batched_scales=scales,
            batched_colors=colors,
            opacity=0.78,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        self.node.on_click(self.clicked)

    def _blank(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        wxyz = np.zeros((self.capacity, 4), dtype=np.float32)
        wxyz[:, 0] = 1.0
        zeros = np.zeros((self.capacity, 3), dtype=np.float32)
        return wxyz, zeros, zeros.copy(), np.zeros((self.capacity, 3), dtype=np.uint8)

    def _place(self, labels: tuple[Label, ...]) -> np.ndarray:
        """The instances of labels, new ones in free places."""
        here = set(labels)
        for label in [x for x in self.slots if x not in here]:
            slot = self.slots.pop(label)
            del self.label_at[slot]
            self.free.append(slot)
        while self.capacity < len(here):
            self._hold(2 * self.capacity)
        for label in labels:
            if label not in self.slots:
                slot = self.free.pop()
                self.slots[label] = slot
                self.label_at[slot] = label
        return np.array([self.slots[label] for label in labels], dtype=int)

    def render(self, cloud: Cloud, rgb: np.ndarray) -> None:
        """Inside `server.atomic()`: the four arrays belong together."""
        slots = self._place(cloud.labels)
        wxyz, positions, scales, colors = self._blank()
        wxyz[slots], positions[slots], scales[slots] = cloud.wxyz, cloud.positions, cloud.scales
        colors[slots] = linear(rgb)
        self.node.batched_positions = positions
        self.node.batched_wxyzs = wxyz
        self.node.batched_scales = scales
        self.node.batched_colors = colors


class Rays:
    """Where a feature may be whose depth is still open: from its near to its far end."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self.node = scene.add_line_segments(
            "/map/rays",
            np.zeros((0, 2, 3), np.float32),
            C["partial"],
            thickness=1.3,
            thickness_units="screen",
        )

    def render(self, cloud: Cloud, visible: bool) -> None:
        self.node.visible = visible
        if visible:
            known = np.isfinite(cloud.ends).all(axis=(1, 2))
            self.node.points = cloud.ends[known].astype(np.float32)


class Selected:
    """White rings and a label around the selected feature; labels of those nearby."""

    NEAR = 6

    def __init__(self, scene: viser.SceneApi) -> None:
        self.scene = scene
        self.rings = scene.add_line_segments(
            "/map/selected",
            np.zeros((0, 2, 3), np.float32),
            C["white"],
            thickness=2.0,
            thickness_units="screen",
        )
        self.labels: dict[str, viser.LabelHandle] = {}

    def render(
        self, cloud: Cloud, states: list[str], selected: Label | None, eye: Vec, near: bool
    ) -> None:
        texts: dict[str, tuple[str, Vec]] = {}
        i = cloud.labels.index(selected) if selected in cloud.labels else None
        if i is None:
            self.rings.visible = False
        else:
            at, scales = cloud.positions[i], cloud.scales[i]
            self.rings.points = geo.rings(at, scales, cloud.wxyz[i]).astype(np.float32)
            self.rings.visible = True
            words = {"nomatch": "no match", "unselected": "not selected", "out": "out of view"}
            texts["selected"] = (f"{selected} {words.get(states[i], states[i])}", at)
        if near:
            away = np.linalg.norm(cloud.positions - eye, axis=1)
            seen = [k for k in np.argsort(away) if states[k] != "out" and k != i]
            for n, k in enumerate(seen[: self.NEAR]):
                texts[f"near{n}"] = (str(cloud.labels[k]), cloud.positions[k])
        self._write(texts)

    def _write(self, texts: dict[str, tuple[str, Vec]]) -> None:
        for name in [n for n in self.labels if n not in texts]:
            self.labels.pop(name).remove()
        for name, (text, at) in texts.items():
            label = self.labels.get(name)
            if label is None:
                self.labels[name] = self.scene.add_label(
                    f"/map/labels/{name}",
                    text,
                    position=at,
                    anchor="bottom-center",
                    font_screen_scale=0.95 if name == "selected" else 0.75,
                )
            else:
                label.text = text
                label.position = at


class Robots:
    """Estimated robots in green with their cameras' frusta, true ones in yellow."""

    def __init__(self, scene: viser.SceneApi, world: World, size: float) -> None:
        self.scene, self.size = scene, size
        self.bodies = {
            name: scene.add_icosphere(
                f"/map/robot/{i}", 0.022 * size, color=C["estimate"], cast_shadow=False
            )
            for i, name in enumerate(world.robots)
        }
        self.true_bodies = {
            name: scene.add_icosphere(
                f"/map/truth/robot/{i}", 0.016 * size, color=C["truth"], cast_shadow=False
            )
            for i, name in enumerate(world.robots)
        }
        self.headings = {
            name: scene.add_line_segments(
                f"/map/heading/{i}",
                np.zeros((0, 2, 3), np.float32),
                C["estimate"],
                thickness=3.0,
                thickness_units="screen",
            )
            for i, name in enumerate(world.robots)
        }
        self.frusta: dict[str, viser.CameraFrustumHandle] = {}
        self.shown: dict[str, np.ndarray] = {}
        self.angles: dict[str, tuple[Sensor, Vec, tuple[float, float]]] = {}

    def render(self, p: Published, world: World, truth: bool) -> None:
        for name, body in self.bodies.items():
            pose = geo.robot_pose(world, name)
            body.position = pose[:3]
            self._render_heading(world, name, pose)
        for name, body in self.true_bodies.items():
            at = geo.true_position(p, name, world.up) if truth else None
            body.visible = at is not None
            if at is not None:
                body.position = at
        for mount in world.mounts:
            if world.mounts[mount].sensor.pane == "image":
                self._render_camera(world, mount)

    def _render_heading(self, world: World, name: str, pose: Vec) -> None:
        space = world.robots[name].motion.space
        if space.d == 3:
            return
        ahead = np.zeros(space.d + 1)
        ahead[0], ahead[-1] = 0.09 * self.size, 1.0
        tip = space.to_world(world.xp(name), ahead).X[: space.d]
        tip = geo.embed_points(tip, space, world.up)
        self.headings[name].points = np.array([[pose[:3], tip]], dtype=np.float32)

    def _render_camera(self, world: World, mount: str) -> None:
        fov, aspect = self.view_angle(world, mount)
        pose = geo.mount_pose(world, mount)
        node = self.frusta.get(mount)
        if node is None:
            self.frusta[mount] = self.scene.add_camera_frustum(
                f"/map/camera/{len(self.frusta)}",
                fov,
                aspect,
                scale=0.1 * self.size,
                color=C["estimate"],
                thickness=2.5,
                thickness_units="screen",
                position=pose[:3],
                wxyz=pose[3:],
                cast_shadow=False,
            )
            return
        node.fov, node.aspect = fov, aspect
        node.position, node.wxyz = pose[:3], pose[3:]

    def view_angle(self, world: World, mount: str) -> tuple[float, float]:
        """Field of view and aspect of a camera, worked out when its calibration has moved."""
        sensor, k = world.mounts[mount].sensor, world.mount_calib(mount)
        known = self.angles.get(mount)
        if known is None or known[0] is not sensor or not np.array_equal(known[1], k):
            known = self.angles[mount] = (sensor, k, geo.view_angle(sensor, k))
        return known[2]

    @property
    def frustum_names(self) -> tuple[str, ...]:
        """Scene nodes of the cameras."""
        return tuple(node.name for node in self.frusta.values())

    def encoded(self, trace: Trace) -> dict[str, bytes]:
        """JPEGs of the images that are not on their camera's frustum yet."""
        out: dict[str, bytes] = {}
        for mount in self.frusta:
            raw = trace.frame.raw.get(mount)
            if isinstance(raw, Image) and self.shown.get(mount) is not raw.pixels:
                self.shown[mount] = raw.pixels
                ok, data = cv2.imencode(".jpg", raw.pixels, [cv2.IMWRITE_JPEG_QUALITY, 80])
                assert ok, "a grey uint8 image can always be encoded"
                out[mount] = data.tobytes()
        return out

    def show(self, images: dict[str, bytes]) -> None:
        """Put images on the frusta."""
        for mount, data in images.items():
            viser_hooks.show_jpeg(self.frusta[mount], data)


class Paths:
    """Trajectories so far: estimate thick and green, truth thin and yellow; true landmarks."""

    def __init__(self, scene: viser.SceneApi, p: Published) -> None:
        self.nodes = {
            (name, kind): scene.add_line_segments(
                f"/map/path/{kind}/{i}",
                np.zeros((0, 2, 3), np.float32),
                C[kind],
                thickness=3.5 if kind == "estimate" else 1.8,
                thickness_units="screen",
            )
            for i, name in enumerate(p.experiment.estimator.robots)
            for kind in ("truth", "estimate")
        }

    def render(self, p: Published, trajectories: bool, truth: bool) -> None:
        for (name, kind), node in self.nodes.items():
            r = p.series.robots.get(name)
            path = None
            if r is not None:
                path = r.position if kind == "estimate" else r.true_position
            node.visible = trajectories and path is not None and (truth or kind == "estimate")
            if node.visible and path is not None:
                node.points = geo.thinned(path).astype(np.float32)


class Sightings:
    """For sensors without an image: a line from the sensor to every feature it measured."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self.node = scene.add_line_segments(
            "/map/sightings",
            np.zeros((0, 2, 3), np.float32),
            np.zeros((0, 2, 3), np.uint8),
            thickness=1.2,
            thickness_units="screen",
        )

    def render(self, trace: Trace | None, world: World, cloud: Cloud, visible: bool) -> None:
        self.node.visible = visible
        if not visible or trace is None:
            return
        row = {label: i for i, label in enumerate(cloud.labels)}
        segments, colors, judged = [], [], outcomes(trace)
        for mount, m in world.mounts.items():
            if m.sensor.pane == "image":
                continue
            start = geo.mount_pose(world, mount)[:3]
            for (where, label), a in judged.items():
                if where == mount and label in row and a.verdict in ("accepted", "rejected"):
                    segments.append((start, cloud.positions[row[label]]))
                    colors.append((C[STATE_OF_VERDICT[a.verdict]],) * 2)
        with_any = len(segments) > 0
        self.node.points = np.array(segments if with_any else np.zeros((0, 2, 3)), dtype=np.float32)
        self.node.colors = np.array(colors if with_any else np.zeros((0, 2, 3)), dtype=np.uint8)


class TrueLandmarks:
    """Small yellow points where the landmarks really are."""

    def __init__(self, scene: viser.SceneApi, size: float) -> None:
        self.scene, self.size = scene, size
        self.node: viser.PointCloudHandle | None = None

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
