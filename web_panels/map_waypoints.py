"""Waypoints on the map: numbered flags, the present goal larger, and a floor to put new ones on."""

from __future__ import annotations

import numpy as np
import viser

from scene_core.arrays import Vec
from scene_core.filter.world import World
from scene_core.geometry.spaces import THREE_D
from scene_core.session.published import Published
from web_panels import map_geometry as geo
from web_panels.map_geometry import Bounds
from web_panels.panel import Look, Post
from web_panels.style import RGB, C, linear, robot_colour
from web_panels.waypoints import (
    as_point,
    on_map,
    space_of,
    waypoints_of,
    where_it_meets,
    with_points,
)

SPACING = 0.25
"""Height of a flag at most, in distances between waypoints: an arm's are closer than a car's."""
FLAG = np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 1.0], [0.42, 0.86], [0.42, 0.86], [0.0, 0.72]])
"""A pole and a pennant: pairs of points, sideways and up."""


def flag_height(feet: Vec, most: float) -> float:
    """How high flags at places (N, 3) are: at most so high, less where they would crowd."""
    way = np.linalg.norm(np.diff(feet[np.isfinite(feet).all(axis=1)], axis=0), axis=1)
    apart = way[way > 1e-3 * most]
    return min(most, SPACING * float(apart.min())) if len(apart) else most


class _Lines:
    """Segments of flags; of several ends the browser takes the colours as linear light."""

    def __init__(self) -> None:
        self.points: list[Vec] = []
        self.colours: list[Vec] = []

    def add(self, flag: Vec, colour: RGB) -> None:
        self.points.append(flag)
        self.colours.append(np.broadcast_to(linear(colour), flag.shape))


class Flags:
    """One flag for every waypoint of every simulated robot; of several each has its colour."""

    def __init__(self, scene: viser.SceneApi, world: World, size: float) -> None:
        self.scene, self.height = scene, 0.09 * size
        self.frame = scene.add_frame("/map/waypoints", show_axes=False)
        self.flags = self._lines("/map/waypoints/all", 1.6)
        self.goals = self._lines("/map/waypoints/goals", 3.5)
        self.labels: dict[str, viser.LabelHandle] = {}
        bodies = geo.bodies(world.robots)
        self.colours = {name: (C["ink"], C["truth"]) for name in world.robots}
        """Of each robot's flags, and of that of its present goal."""
        if len(world.robots) > 1:
            own = {name: robot_colour(bodies.index((name, "base"))) for name in world.robots}
            self.colours = {name: (colour, colour) for name, colour in own.items()}

    def _lines(self, name: str, thickness: float) -> viser.LineSegmentsHandle:
        none = np.zeros((0, 2, 3))
        return self.scene.add_line_segments(
            name,
            none.astype(np.float32),
            none.astype(np.uint8),
            thickness=thickness,
            thickness_units="screen",
        )

    def render(self, p: Published, world: World) -> None:
        up = np.eye(3)["xyz".index(world.up)]
        side = np.roll(up, 1)
        place = geo.place_of_world(p)
        self.frame.position, self.frame.wxyz = place[:3], place[3:]
        flags, goals, texts = _Lines(), _Lines(), {}
        for robot in world.robots:
            points = waypoints_of(p, robot)
            if not points:
                continue
            space = space_of(p, robot)
            truth = None if p.trace is None else p.trace.frame.truth
            goal = None if truth is None else truth.goals.get(robot)
            feet = on_map(points, space, world.up)
            height = flag_height(feet, self.height)
            for i, foot in enumerate(feet):
                if not np.isfinite(foot).all():
                    continue
                here = goal is not None and np.allclose(goal, points[i])
                size = height * (1.5 if here else 1.0)
                flag = foot + size * (FLAG[:, :1] * side + FLAG[:, 1:] * up)
                (goals if here else flags).add(flag, self.colours[robot][here])
                texts[f"{robot}:{i}"] = (str(i + 1), foot + size * up)
        for node, lines in ((self.flags, flags), (self.goals, goals)):
            node.points = np.array(lines.points, dtype=np.float32).reshape(-1, 2, 3)
            node.colors = np.array(lines.colours, dtype=np.uint8).reshape(-1, 2, 3)
        self._write(texts)

    def _write(self, texts: dict[str, tuple[str, Vec]]) -> None:
        for key in [key for key in self.labels if key not in texts]:
            self.labels.pop(key).remove()
        for key, (text, at) in texts.items():
            label = self.labels.get(key)
            if label is None:
                self.labels[key] = self.scene.add_label(
                    f"/map/waypoints/names/{key}",
                    text,
                    position=at,
                    anchor="bottom-center",
                    font_screen_scale=0.8,
                )
            else:
                label.text, label.position = text, at


class Floor:
    """What is clicked to add a waypoint; there only while somebody wants to."""

    def __init__(
        self, scene: viser.SceneApi, p: Published, up: str, bounds: Bounds, post: Post
    ) -> None:
        self.up, self.bounds, self.post, self.latest = up, bounds, post, p
        self.robot = ""
        self.level = float(bounds.lo["xyz".index(up)])
        self.node = scene.add_mesh_simple(
            "/map/waypoints/floor",
            *self._mesh(p),
            color=C["truth"],
            opacity=0.1,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self.node.on_click(self._clicked)

    def _mesh(self, p: Published) -> tuple[Vec, np.ndarray]:
        ground = geo.ground_mesh(p.experiment.source)
        if ground is not None:
            return ground[0] + 0.004 * self.bounds.radius * self._upwards, ground[1]
        side, other = np.roll(self._upwards, 1), np.roll(self._upwards, 2)
        far = 1.6 * self.bounds.radius
        middle = self.bounds.centre * (1.0 - self._upwards) + self.level * self._upwards
        corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        vertices = np.array([middle + far * (a * side + b * other) for a, b in corners])
        return vertices, np.array([[0, 1, 2], [0, 2, 3]])

    @property
    def _upwards(self) -> Vec:
        return np.eye(3)["xyz".index(self.up)]

    def render(self, p: Published, look: Look) -> None:
        self.latest = p
        self.robot = look.placing if waypoints_of(p, look.placing) is not None else ""
        self.node.visible = bool(self.robot)

    async def _clicked(self, event: viser.SceneNodePointerEvent) -> None:
        self.put(np.array(event.ray_origin), np.array(event.ray_direction))

    def put(self, origin: Vec, direction: Vec) -> None:
        """Add a waypoint where a ray of the map meets the floor."""
        p, robot = self.latest, self.robot
        points = waypoints_of(p, robot)
        source, place = p.experiment.source, geo.place_of_world(p)
        origin = THREE_D.to_local(place, np.append(origin, 1.0)).X[:3]
        direction = THREE_D.to_local(place, np.append(direction, 0.0)).X[:3]
        at = where_it_meets(source, self.up, self.bounds, self.level, origin, direction)
        if points is not None and at is not None:
            point = as_point(at, space_of(p, robot), self.up)
            self.post(with_points(robot, (*points, point)))
