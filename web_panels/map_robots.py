"""Robots on the map: bodies, headings, cameras and trajectories, each robot in its own colour."""

from __future__ import annotations

import cv2
import numpy as np
import viser

from scene_core.arrays import Vec
from scene_core.filter.ports import Image
from scene_core.filter.records import Trace
from scene_core.filter.world import World
from scene_core.models.base import Sensor
from scene_core.session.published import Published
from scene_core.session.tracks import body_name
from web_panels import map_geometry as geo
from web_panels import viser_hooks
from web_panels.style import RGB, C, robot_colour


class Robots:
    """Estimated robots with their cameras' frusta, true ones in yellow: every body in a colour of
    its own, every other hook of a robot that moves by itself smaller."""

    def __init__(self, scene: viser.SceneApi, world: World, size: float) -> None:
        self.scene, self.size = scene, size
        self.own = geo.bodies(world.robots)
        self.colours = {body: robot_colour(i) for i, body in enumerate(self.own)}
        self.parts = geo.parts(world)
        self.bodies = {
            part: self._body(f"/map/robot/{i}", part, 0.013, self._colour(part))
            for i, part in enumerate(self.parts)
        }
        self.true_bodies = {
            part: self._body(f"/map/truth/robot/{i}", part, 0.010, C["truth"])
            for i, part in enumerate(self.parts)
        }
        self.headings = {
            part: scene.add_line_segments(
                f"/map/heading/{i}",
                np.zeros((0, 2, 3), np.float32),
                self._colour(part),
                thickness=3.0,
                thickness_units="screen",
            )
            for i, part in enumerate(self.parts)
        }
        self.names = {
            part: scene.add_label(
                f"/map/names/{i}", body_name(*part), anchor="top-center", font_screen_scale=0.8
            )
            for i, part in enumerate(self.parts)
            if len(self.parts) > 1 and self._named(*part)
        }
        self.frusta: dict[str, viser.CameraFrustumHandle] = {}
        self.shown: dict[str, np.ndarray] = {}
        self.angles: dict[str, tuple[Sensor, Vec, tuple[float, float]]] = {}

    def _named(self, robot: str, hook: str) -> bool:
        """Joints are too close together for names."""
        return (robot, hook) in self.own or sum(name == robot for name, _ in self.parts) == 2

    def _colour(self, part: geo.Part) -> RGB:
        """A body's own; other parts have that of their robot's base."""
        return self.colours.get(part) or self.colours[part[0], "base"]

    def _body(self, name: str, part: geo.Part, share: float, colour: RGB) -> viser.IcosphereHandle:
        radius = share * self.size * (1.0 if part in self.own else 0.6)
        return self.scene.add_icosphere(name, radius, color=colour, cast_shadow=False)

    def render(self, p: Published, world: World, truth: bool) -> None:
        for part in self.parts:
            pose = geo.robot_pose(world, *part)
            self.bodies[part].position = pose[:3]
            self._render_heading(world, part, pose)
            if part in self.names:
                self.names[part].position = pose[:3]
            body = self.true_bodies[part]
            at = geo.true_position(p, *part, up=world.up) if truth else None
            body.visible = at is not None
            if at is not None:
                body.position = at
        for mount in world.mounts:
            if world.mounts[mount].sensor.pane == "image":
                self._render_camera(world, mount)

    def _render_heading(self, world: World, part: geo.Part, pose: Vec) -> None:
        space = world.robots[part[0]].motion.space
        if space.d == 3:
            return
        ahead = np.zeros(space.d + 1)
        ahead[0], ahead[-1] = 0.09 * self.size, 1.0
        tip = space.to_world(world.xp(*part), ahead).X[: space.d]
        tip = geo.embed_points(tip, space, world.up)
        self.headings[part].points = np.array([[pose[:3], tip]], dtype=np.float32)

    def _render_camera(self, world: World, mount: str) -> None:
        fov, aspect = self.view_angle(world, mount)
        pose = geo.mount_pose(world, mount)
        node, m = self.frusta.get(mount), world.mounts[mount]
        if node is None:
            self.frusta[mount] = self.scene.add_camera_frustum(
                f"/map/camera/{len(self.frusta)}",
                fov,
                aspect,
                scale=0.1 * self.size,
                color=self._colour((m.robot, m.hook)),
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
    """Trajectories so far: estimate thick and in the body's colour, truth thin and yellow."""

    def __init__(self, scene: viser.SceneApi, world: World) -> None:
        self.nodes = {
            (body_name(*body), kind): scene.add_line_segments(
                f"/map/path/{kind}/{i}",
                np.zeros((0, 2, 3), np.float32),
                robot_colour(i) if kind == "estimate" else C["truth"],
                thickness=3.5 if kind == "estimate" else 1.8,
                thickness_units="screen",
            )
            for i, body in enumerate(geo.bodies(world.robots))
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
