"""State labels are the contract between models: what a component is called says what it is.

A state that holds more than one pose tells them apart by a prefix with a colon: 2:x, foot:qw.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

QUATERNION = ("qw", "qx", "qy", "qz")


def bare(label: str) -> str:
    """A label without its prefixes: qw of 2:qw."""
    return label.rpartition(":")[2]


def quaternions(labels: Sequence[str]) -> Mapping[str, list[int]]:
    """Rows of qw, qx, qy, qz of every quaternion among the labels, by its prefix ("", "2:")."""
    where = {label: i for i, label in enumerate(labels)}
    prefixes = [label.removesuffix("qw") for label in labels if bare(label) == "qw"]
    rows = {p: [where.get(p + part, -1) for part in QUATERNION] for p in prefixes}
    return {p: at for p, at in rows.items() if -1 not in at}
