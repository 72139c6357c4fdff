"""A table that grows by a row per frame and hands out read-only views of itself."""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Vec


class Column:
    """Rows of equal shape; appending is amortised, a view costs nothing and never changes."""

    def __init__(self, *shape: int) -> None:
        self._shape = shape
        self._rows = np.empty((64, *shape))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, row: Vec | float) -> None:
        if self._count == len(self._rows):
            grown = np.empty((2 * self._count, *self._shape))
            grown[: self._count] = self._rows
            self._rows = grown
        self._rows[self._count] = row
        self._count += 1

    def pad(self, count: int) -> None:
        """Rows of NaN up to `count`."""
        while self._count < count:
            self.append(np.nan)

    def truncate(self, count: int) -> None:
        """Keep the first `count` rows. Views that show more keep the old table."""
        if count < self._count:
            self._rows = self._rows.copy()
            self._count = count

    def drop_first(self, count: int) -> None:
        """Forget the oldest rows."""
        count = min(count, self._count)
        self._rows = self._rows[count:].copy()
        self._count -= count
        if not len(self._rows):
            self._rows = np.empty((64, *self._shape))

    def any_row(self) -> bool:
        """Whether any row says something."""
        return bool(np.isfinite(self._rows[: self._count]).any())

    def view(self, count: int) -> Vec:
        """The first `count` rows (T, ...), read-only."""
        out = self._rows[: min(count, self._count)]
        out.flags.writeable = False
        return out
