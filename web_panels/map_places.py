"""What the filter knows of the places of the robots themselves, as ellipsoids on the map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import viser

from scene_core.arrays import Vec
from scene_core.filter.world import World
from scene_core.geometry.ellipses import ellipsoids, sigma
from scene_core.geometry.embedding import embed_covariances, embed_points
from scene_core.session.tracks import pose_estimate
from web_panels import map_geometry as geo
from web_panels.instances import BALL
from web_panels.style import linear, robot_colour

OPACITY = 0.22


def place_ellipsoids(
    world: World, bodies: Sequence[geo.Part], confidence: float, thinnest: float
) -> tuple[Vec, Vec, Vec]:
    """Positions (N, 3), half-axes (N, 3) at the stated confidence, and axes wxyz (N, 4) of bodies
    in 3-D world axes, in m; none is thinner than `thinnest`, as in `Clouds.of`."""
    at, scales, axes = [], [], []
    for body in bodies:
        space, estimate = world.robots[body[0]].motion.space, pose_estimate(world, *body)
        d = space.d
        sd, wxyz = ellipsoids(embed_covariances(estimate.P[None, :d, :d], space, world.up))
        at.append(embed_points(estimate.xp[:d], space, world.up))
        scales.append(np.maximum(sigma(d, confidence) * sd[0], thinnest))
        axes.append(wxyz[0])
    return np.array(at), np.array(scales), np.array(axes)


class Places:
    """Clear ellipsoids with rings in the colours of their bodies. A body hides one that is smaller
    than itself."""

    def __init__(self, scene: viser.SceneApi, world: World, size: float) -> None:
        self.bodies, self.thinnest = geo.bodies(world.robots), 0.002 * size
        n = len(self.bodies)
        colours = [robot_colour(i) for i in range(n)]
        self.node = scene.add_batched_meshes_simple(
            "/map/places",
            np.asarray(BALL.vertices),
            np.asarray(BALL.faces),
            np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (n, 1)),
            np.zeros((n, 3), np.float32),
            batched_scales=np.zeros((n, 3), np.float32),
            batched_colors=linear(np.array(colours)),
            opacity=OPACITY,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        self.rings = [
            scene.add_line_segments(
                f"/map/places/{i}",
                np.zeros((0, 2, 3), np.float32),
                colour,
                thickness=1.5,
                thickness_units="screen",
            )
            for i, colour in enumerate(colours)
        ]

    def render(self, world: World, confidence: float) -> None:
        """Inside `server.atomic()`."""
        at, scales, wxyz = place_ellipsoids(world, self.bodies, confidence, self.thinnest)
        self.node.batched_positions = at.astype(np.float32)
        self.node.batched_scales = scales.astype(np.float32)
        self.node.batched_wxyzs = wxyz.astype(np.float32)
        for node, *ellipsoid in zip(self.rings, at, scales, wxyz, strict=True):
            node.points = geo.rings(*ellipsoid, larger=1.0).astype(np.float32)
