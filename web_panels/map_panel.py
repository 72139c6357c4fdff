"""The map: everything the filter believes about where things are, and the truth beside it."""

from __future__ import annotations

import time

import numpy as np
import viser

from scene_core.filter.world import Label, World
from scene_core.session.commands import Select
from scene_core.session.published import Published
from scene_core.session.start import initial_world
from scene_core.session.tracks import body_name
from web_panels import map_geometry as geo
from web_panels import viser_hooks
from web_panels.cameras import CLOSE, FAR, Cameras
from web_panels.clouds import Cloud, Clouds
from web_panels.instances import Instances
from web_panels.map_layers import Lines, Particles, Rays, Selected, Sightings
from web_panels.map_pace import pace_html
from web_panels.map_places import Places
from web_panels.map_robots import Paths, Robots
from web_panels.map_waypoints import Flags, Floor
from web_panels.map_world import Ground, TrueLandmarks
from web_panels.panel import Look, Page, Post

IMAGE_HZ, SLOW_HZ, CORRELATION_HZ = 12.0, 10.0, 4.0
"""Pictures on frusta; paths, rings and labels; colours by correlation."""
FARTHEST = 5.0
"""Ends of lines and particles are drawn within so many radii of the map."""


class MapPanel:
    """Draws into the 3-D scene; a click on an ellipsoid selects its feature."""

    rate_hz = 30.0

    def __init__(self, page: Page) -> None:
        self.page = page
        self.run: int | None = None
        self.awaiting = False
        self.clouds = Clouds()

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.server, self.post = server, post
        self.cameras = self.page.views = Cameras(server)
        server.gui.add_html(pace_html())

    def _restart(self, p: Published, world: World, bounds: geo.Bounds) -> None:
        """Make every node anew: another run may have another world, up and robots."""
        scene = self.server.scene
        scene.remove_by_name("/map")
        self.bounds = self.seen = bounds
        size = bounds.radius
        self.simulated = len(geo.outline_of(p.experiment.source, world.up)) > 0
        # A browser shows what it was told so far: first where to stand, then what is there.
        self.cameras.margin = CLOSE if self.simulated else FAR
        self.cameras.place(geo.view_name(p), bounds, world.up)
        self.ground = Ground(scene, p, world, bounds)
        self.paths = Paths(scene, world)
        self.true_landmarks = TrueLandmarks(scene, size)
        self.rays = Rays(scene)
        self.sightings = Sightings(scene)
        self.ellipsoids = Instances(self.server, self._choose)
        self.lines = Lines(self.server, self._choose, size)
        self.particles = Particles(self.server, self._choose, size)
        self.robots = Robots(scene, world, size)
        self.places = Places(scene, world, size)
        self.flags = Flags(scene, world, size)
        self.floor = Floor(scene, p, world.up, bounds, self.post)
        self.selected = Selected(scene)
        viser_hooks.send_places(scene, "/map")
        self.axes = geo.axes_key(p)
        self.images_due = self.slow_due = self.correlation_due = 0.0
        self.chosen: int | None = None
        self.correlation: tuple[object, ...] = ()
        self.rgb = np.zeros((0, 3))

    def _fit(self, p: Published) -> World:
        """The world to draw, in a map made for it. A recording tells where its landmarks are only
        with its first frame: the map is then made again if it has to be larger. In other axes
        everything is somewhere else; a swapped motion model may have other parts."""
        fresh = p.run != self.run
        if fresh:
            self.start = initial_world(p.experiment)
            self.run, self.awaiting = p.run, True
            self._restart(p, self.start, geo.start_bounds(p, self.start))
        world = self.start if p.trace is None else p.trace.world
        if self.awaiting and p.trace is not None:
            self.awaiting = False
            bounds = geo.start_bounds(p, world)
            if bounds.radius > 1.05 * self.bounds.radius:
                self._restart(p, world, bounds)
        if geo.axes_key(p) != self.axes or geo.parts(world) != self.robots.parts:
            self._restart(p, world, geo.start_bounds(p, world))
        return world

    @property
    def restless(self) -> bool:
        """Cameras move although the session stands still."""
        return self.run is not None and self.cameras.moving

    def _choose(self, label: Label) -> None:
        self.post(Select(label))

    def render(self, p: Published) -> None:
        world = self._fit(p)
        look, trace, now = self.page.look, p.trace, time.monotonic()
        size = self.bounds.radius
        farthest = FARTHEST * size + float(np.linalg.norm(self.bounds.centre))
        cloud = self.clouds.of(world, look.confidence, 0.004 * size, farthest)
        states = geo.states(trace, world, cloud.labels)
        rgb = self._colours(p, world, cloud, states)
        self.followed = followed(world, look)
        robot = geo.robot_pose(world, *self.followed)
        still = p.mode != "playing"
        slow = still or now >= self.slow_due or p.selected != self.chosen
        images: dict[str, bytes] = {}
        if trace is not None and (still or now >= self.images_due):
            self.images_due = now + 1.0 / IMAGE_HZ
            images = self.robots.encoded(trace)
        # One wake-up of viser's thread for all messages: each costs a change of threads.
        with self.server.atomic():
            self.ellipsoids.render(cloud, rgb)
            self.lines.render(cloud, rgb)
            self.particles.render(cloud, rgb, look.rays)
            self.rays.render(cloud, look.rays)
            self.sightings.render(trace, world, cloud, look.rays)
            self.robots.render(p, world, look.truth)
            self.places.render(world, look.confidence)
            self.robots.show(images)
            self.ground.room.visible = look.room
            self.floor.render(p, look)
            if slow:
                self.slow_due, self.chosen = now + 1.0 / SLOW_HZ, p.selected
                self.true_landmarks.render(p, world, look.truth)
                self.selected.render(cloud, states, p.selected, robot[:3], look.labels)
                self.paths.render(p, look.trajectories, look.truth)
                self.flags.render(p, world)
        if slow:
            self.seen = self._seen(p, cloud)
        self._move_cameras(world, robot[:3], self.seen)

    def _move_cameras(self, world: World, robot: np.ndarray, bounds: geo.Bounds) -> None:
        """The sensor's eye is that of the first camera, on the followed robot if it has one;
        without a camera there is none."""
        if self.cameras.bounds is None or bounds.radius > 1.15 * self.cameras.bounds.radius:
            self.cameras.refit(bounds)
        eye = None
        cameras = [name for name, m in world.mounts.items() if m.sensor.pane == "image"]
        cameras.sort(key=lambda name: world.mounts[name].robot != self.followed[0])
        if cameras:
            eye = geo.mount_pose(world, cameras[0])
            self.cameras.eye_fov = self.robots.view_angle(world, cameras[0])[0]
        self.cameras.in_the_way = self.robots.frustum_names
        self.cameras.move(robot, eye, bounds)

    def _colours(self, p: Published, world: World, cloud: Cloud, states: list[str]) -> np.ndarray:
        """By verdict, or by correlation with the selected feature (a few times a second)."""
        chosen = p.selected
        if self.page.look.colour == "verdict" or chosen is None or chosen not in world.features:
            return geo.colours(states)
        now = time.monotonic()
        key = (chosen, cloud.labels)
        if key != self.correlation or now >= self.correlation_due:
            self.correlation_due = now + 1.0 / CORRELATION_HZ
            self.correlation = key
            self.rgb = geo.correlation_colours(world, chosen, cloud.labels)
        return self.rgb

    def _seen(self, p: Published, cloud: Cloud) -> geo.Bounds:
        """What the view buttons frame: a simulated world, else what was mapped and travelled."""
        if self.simulated or len(cloud.labels) < 8:
            return self.bounds
        parts = [np.percentile(cloud.positions, (10, 90), axis=0), [self.bounds.centre]]
        for r in p.series.robots.values():
            there = r.position[np.isfinite(r.position).all(axis=1)]
            if len(there):
                parts.append([there.min(axis=0), there.max(axis=0)])
        return geo.bounds_of(np.concatenate(parts))


def followed(world: World, look: Look) -> geo.Part:
    """The body the view goes with."""
    by_name = {body_name(*body): body for body in geo.bodies(world.robots)}
    return by_name.get(look.follow) or next(iter(by_name.values()))
