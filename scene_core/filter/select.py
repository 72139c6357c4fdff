"""Active selection: measure where the outcome is least certain.

Source: Davison, Scene, section 5.2.1 (visibility test and selection score); Solà, toolbox,
`correctKnownLmks` (the nUpdates largest by det(E)).
"""

from __future__ import annotations

from collections.abc import Sequence

from scene_core.filter.records import Predictions
from scene_core.filter.world import Label


def ranked(predictions: Sequence[Predictions]) -> list[tuple[float, Label]]:
    """Measurable features, largest score first; equal scores keep the order of their labels."""
    rows = [
        (float(p.score[i]), label)
        for p in predictions
        for i, label in enumerate(p.labels)
        if not p.fault[i]
    ]
    return sorted(rows, key=lambda row: (-row[0], row[1]))


def select(predictions: Sequence[Predictions], budget: int) -> tuple[Label, ...]:
    """The `budget` measurable features with the largest score, in that order."""
    return tuple(label for _, label in ranked(predictions)[:budget])
