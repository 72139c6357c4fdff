"""What a simulated camera takes pictures of: textured rectangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scene_core.arrays import Vec
from scene_core.geometry import quaternion


@dataclass(frozen=True)
class Surface:
    """A textured rectangle. Seen from its front, `right` and `down` are the texture's axes."""

    name: str
    corner: Vec
    """Upper left corner (3,), m."""
    right: Vec
    """Unit vector (3,)."""
    down: Vec
    """Unit vector (3,)."""
    width: float
    height: float
    texture: np.ndarray
    """uint8 (rows, columns, 3), RGB, with the light that falls on it."""
    is_wall: bool
    """One of the sides of a room, not of a piece of furniture."""

    @property
    def normal(self) -> Vec:
        """Unit vector (3,) towards who looks at the front."""
        return -np.cross(self.right, self.down)

    @property
    def centre(self) -> Vec:
        """Middle of the rectangle (3,), m."""
        return self.corner + 0.5 * (self.width * self.right + self.height * self.down)

    @property
    def wxyz(self) -> Vec:
        """Rotation (4,) from the axes right, down, away from the viewer to the world."""
        return quaternion.from_matrix(np.column_stack([self.right, self.down, -self.normal]))
