"""The layers of the map that show features. Each owns its scene nodes and brings them up to date on
`render`."""

from __future__ import annotations

import numpy as np
import viser

from scene_core.arrays import Vec
from scene_core.filter.records import Trace
from scene_core.filter.world import Label, World
from web_panels import map_geometry as geo
from web_panels.clouds import Cloud
from web_panels.instances import GRAIN, ROD, Choose, Instances
from web_panels.style import STATE_OF_VERDICT, C
from web_panels.verdicts import outcomes


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
        places = label_places(cloud)
        i = cloud.labels.index(selected) if selected in cloud.labels else None
        if i is None:
            self.rings.visible = False
        else:
            self.rings.points = outline(cloud, i).astype(np.float32)
            self.rings.visible = True
            words = {"nomatch": "no match", "unselected": "not selected", "out": "out of view"}
            texts["selected"] = (f"{selected} {words.get(states[i], states[i])}", places[i])
        if near:
            away = np.linalg.norm(places - eye, axis=1)
            seen = [k for k in np.argsort(away) if states[k] != "out" and k != i]
            for n, k in enumerate(seen[: self.NEAR]):
                texts[f"near{n}"] = (str(cloud.labels[k]), places[k])
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


def label_places(cloud: Cloud) -> Vec:
    """(N, 3) where to write labels: on the heaviest particle, the first of several, as nothing need
    be at the mean of particles: that of a ring is its middle."""
    at, swarm = cloud.positions.copy(), cloud.swarm
    heaviest = np.flatnonzero(swarm.weights == 1.0)
    rows, first = np.unique(swarm.rows[heaviest], return_index=True)
    at[rows] = swarm.positions[heaviest[first]]
    return at


def outline(cloud: Cloud, i: int) -> Vec:
    """White lines (M, 2, 3) about a feature: rings around its ellipsoid, around both ends of a
    segment and along it, or along the particles of what is still open."""
    lines, swarm = cloud.lines, cloud.swarm
    own = lines.balls.rows == i
    if own.any():
        balls = lines.balls
        around = zip(balls.positions[own], balls.scales[own], balls.wxyz[own], strict=True)
        return np.concatenate([*(geo.rings(*ball) for ball in around), lines.ends[lines.rows == i]])
    grains = swarm.positions[swarm.rows == i]
    if len(grains):
        return geo.thinned(grains)
    return geo.rings(cloud.positions[i], cloud.scales[i], cloud.wxyz[i])


class Sightings:
    """For sensors without an image: a line from the sensor to every feature it measured,
    unless particles still say that it may be in many places."""

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
        open_rows = set(cloud.swarm.rows.tolist())
        row = {label: i for i, label in enumerate(cloud.labels) if i not in open_rows}
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


class Lines:
    """Line landmarks: rods between ends that carry their ellipsoids; a click on either selects."""

    def __init__(self, server: viser.ViserServer, choose: Choose, size: float) -> None:
        self.radius = 0.0035 * size
        self.rods = Instances(server, choose, "/map/lines/rods", ROD, opacity=0.95)
        self.balls = Instances(server, choose, "/map/lines/ends", opacity=0.5)

    def render(self, cloud: Cloud, rgb: np.ndarray) -> None:
        lines = cloud.lines
        if not len(lines.rows) and not self.rods.slots:
            return
        self.rods.render(lines.rods(cloud.labels, self.radius), rgb[lines.rows])
        self.balls.render(lines.balls, rgb[lines.balls.rows])


class Particles:
    """What is not known yet of partial features: grains, the larger the more probable."""

    def __init__(self, server: viser.ViserServer, choose: Choose, size: float) -> None:
        self.radius = 0.006 * size
        self.grains = Instances(server, choose, "/map/particles", GRAIN, opacity=0.9)

    def render(self, cloud: Cloud, rgb: np.ndarray, visible: bool) -> None:
        self.grains.node.visible = visible
        swarm = cloud.swarm
        if not len(swarm.rows) and not self.grains.slots:
            return
        self.grains.render(swarm.grains(self.radius), rgb[swarm.rows])
