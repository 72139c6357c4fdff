"""Many copies of one mesh in the map, each belonging to a feature and clickable as one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import trimesh
import viser

from scene_core.arrays import Vec
from scene_core.filter.world import Label
from web_panels.style import linear

BALL = trimesh.creation.icosphere(2)
GRAIN = trimesh.creation.icosphere(1)
ROD = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=8)
"""Along z, its middle at the origin."""
OUT_OF_SIGHT = 1e6
"""Where places wait that no copy has taken, m: browsers do not draw what is as far away as that."""

Key = Label | tuple[Label, int]
"""A feature, or one of several copies that belong to it."""
Choose = Callable[[Label], None]
"""Somebody clicked a feature."""


class Placed(Protocol):
    """Where the copies are; a label is there once."""

    @property
    def labels(self) -> tuple[Key, ...]: ...
    @property
    def positions(self) -> Vec: ...
    @property
    def scales(self) -> Vec: ...
    @property
    def wxyz(self) -> Vec: ...


class Instances:
    """All copies in one node. Each keeps its instance for as long as its label lives."""

    def __init__(
        self,
        server: viser.ViserServer,
        choose: Choose,
        name: str = "/map/features",
        mesh: trimesh.Trimesh = BALL,
        opacity: float = 0.78,
    ) -> None:
        self.server, self.choose = server, choose
        self.name, self.mesh, self.opacity = name, mesh, opacity
        self.slots: dict[Key, int] = {}
        self.label_at: dict[int, Key] = {}
        self._hold(256)

    def _hold(self, capacity: int) -> None:
        """Make the node for so many. It never changes its size: browsers report GL errors while the
        attributes of a growing instanced mesh disagree."""
        self.capacity = capacity
        self.free = [i for i in range(capacity - 1, -1, -1) if i not in self.label_at]
        wxyz, positions, scales, colors = self._blank()
        self.node = self.server.scene.add_batched_meshes_simple(
            self.name,
            np.asarray(self.mesh.vertices),
            np.asarray(self.mesh.faces),
            wxyz,
            positions,
            batched_scales=scales,
            batched_colors=colors,
            opacity=self.opacity,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        self.node.on_click(self._clicked)

    async def _clicked(self, event: viser.SceneNodePointerEvent) -> None:
        key = self.label_at.get(-1 if event.instance_index is None else event.instance_index)
        if key is not None:
            self.choose(key[0] if isinstance(key, tuple) else key)

    def _blank(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        wxyz = np.zeros((self.capacity, 4), dtype=np.float32)
        wxyz[:, 0] = 1.0
        positions = np.full((self.capacity, 3), OUT_OF_SIGHT, dtype=np.float32)
        scales = np.zeros((self.capacity, 3), dtype=np.float32)
        return wxyz, positions, scales, np.zeros((self.capacity, 3), dtype=np.uint8)

    def _place(self, labels: tuple[Key, ...]) -> np.ndarray:
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

    def render(self, placed: Placed, rgb: np.ndarray) -> None:
        """Inside `server.atomic()`: the four arrays belong together."""
        slots = self._place(placed.labels)
        wxyz, positions, scales, colors = self._blank()
        wxyz[slots], positions[slots] = placed.wxyz, placed.positions
        scales[slots], colors[slots] = placed.scales, linear(rgb)
        self.node.batched_positions = positions
        self.node.batched_wxyzs = wxyz
        self.node.batched_scales = scales
        self.node.batched_colors = colors
