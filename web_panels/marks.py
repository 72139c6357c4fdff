"""What a sensor pane has to draw: one mark per feature, in the sensor's own measurement space.

Everything is read from the records of the frame; a mark holds the filter's numbers and the state
it is drawn in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scene_core.arrays import Mat, Vec
from scene_core.filter.ports import Image, Match, Points, Raw
from scene_core.filter.records import Association, PhaseRecord, Predictions, Trace
from scene_core.filter.world import Feature, World
from scene_core.geometry.ellipses import sigma
from scene_core.models.base import Fault
from scene_core.session.published import Published
from web_panels import line_marks
from web_panels.line_marks import LineShape
from web_panels.ray_marks import String, string_along_ray
from web_panels.style import STATE_OF_VERDICT
from web_panels.verdicts import outcomes

PENDING = "ink"
"""Palette key of a feature that is selected but not judged yet (stepping by phase)."""


@dataclass(frozen=True)
class Mark:
    """One feature in one pane."""

    label: int
    state: str
    """Palette key: accepted, nomatch, rejected, unselected, out, partial (born now) or ink."""
    h: Vec
    S: Mat | None
    z: Vec | None = None
    partial: bool = False
    string: String | None = None
    true_z: Vec | None = None
    selected: bool = False
    patch: int = 0
    """Side of the image patch that recognises it, px; 0: none."""
    line: LineShape | None = None
    """Of a line landmark; h is then the middle of its curve."""
    particles: tuple[Vec, Vec] | None = None
    """Where the particles of an open feature are predicted (K, m), and their weights (K,) as parts
    of the heaviest."""


@dataclass(frozen=True)
class Scene:
    """All that is drawn in a pane for one frame."""

    mount: str
    frame: int
    raw: Raw | None
    marks: tuple[Mark, ...]
    half_width: float
    """Of the ellipses, in standard deviations."""
    counts: Mapping[str, int] = field(default_factory=dict)
    """Features by palette key, and "partial" for those whose ray is still open."""
    raw_lines: Vec = field(default_factory=lambda: np.zeros((0, 2, 2)))
    """Measured segments (k, K, 2), as curved as the lens makes them."""


def partially_initialised(feature: Feature) -> bool:
    """It is a point whose parametrisation can hold what a first measurement leaves open."""
    return bool(feature.model.unmeasured) and feature.model.shape == "point"


def patch_side(feature: Feature) -> int:
    """Side of the feature's image template, px; 0 when something else recognises it."""
    template = getattr(feature.appearance, "template", None)
    return len(template) if isinstance(template, np.ndarray) else 0


def verdicts(trace: Trace, mount: str) -> Mapping[int, Association]:
    """The latest verdict on each feature: of the update, or of the gate when stepping by phase."""
    return {label: a for (seen_by, label), a in outcomes(trace).items() if seen_by == mount}


def matches(trace: Trace, mount: str) -> Mapping[int, Match]:
    """Answers of the search by label."""
    return {m.label: m for r in _of(trace, mount) for m in r.matches}


def _of(trace: Trace, mount: str) -> list[PhaseRecord]:
    return [r for r in trace.records if r.mount == mount]


def half_width(world: World, mount: str) -> float:
    """Half-width of the drawn ellipses: of the search, or of the gate where nothing is searched."""
    policies = world.policies
    if policies.association.kind == "search":
        return policies.association.search_sigma
    return sigma(world.mounts[mount].sensor.measurement_size, policies.gate.confidence)


def scene_of(p: Published, mount: str) -> Scene | None:
    """What the pane of a mount shows; None before the first frame or when the mount is gone."""
    trace = p.trace
    if trace is None or mount not in trace.world.mounts:
        return None
    judged, found = verdicts(trace, mount), matches(trace, mount)
    seen = trace.predictions(mount)
    world = _world_of_predictions(trace, mount)
    marks = [
        m
        for predictions in seen
        for m in _marks(world, predictions, judged, found, p.selected)
        if m is not None
    ]
    marks += _born(trace, mount, p.selected)
    counts = {"accepted": 0, "nomatch": 0, "rejected": 0, "unselected": 0, "partial": 0}
    for m in marks:
        counts[m.state] = counts.get(m.state, 0) + (m.state != "partial")
        counts["partial"] += m.partial
    return Scene(
        mount=mount,
        frame=trace.frame.index,
        raw=trace.frame.raw.get(mount),
        marks=tuple(marks),
        half_width=half_width(trace.world, mount),
        counts=counts,
        raw_lines=_raw_lines(world, mount, trace.frame.raw.get(mount)),
    )


def _raw_lines(world: World, mount: str, raw: Raw | None) -> Vec:
    sensor = world.mounts[mount].sensor
    lines = raw.lines if isinstance(raw, Points) else None
    if lines is None or len(lines.z) == 0 or not line_marks.drawable(sensor):
        return np.zeros((0, 2, 2))
    return line_marks.curves(sensor, world.mount_calib(mount), lines.z)


def _world_of_predictions(trace: Trace, mount: str) -> World:
    return next(
        (r.world for r in trace.records if r.mount == mount and r.phase == "select"), trace.world
    )


def _marks(
    world: World,
    p: Predictions,
    judged: Mapping[int, Association],
    found: Mapping[int, Match],
    selected: int | None,
) -> list[Mark | None]:
    """The marks of a group of predictions."""
    sensor = world.mounts[p.mount].sensor
    shapes: list[LineShape | None] = [None] * len(p.labels)
    if p.shape == "segment":
        if not line_marks.drawable(sensor):
            return []
        S = np.array([judged[x].S if x in judged else p.S[i] for i, x in enumerate(p.labels)])
        matched = [found.get(label) for label in p.labels]
        known = [(None, None) if m is None else (m.z, m.true_z) for m in matched]
        k, confidence = world.mount_calib(p.mount), world.policies.gate.confidence
        shapes = line_marks.shapes(sensor, k, p, S, known, confidence)
    marks = [
        _mark(world, p, i, judged.get(label), found.get(label), selected)
        for i, label in enumerate(p.labels)
    ]
    if p.shape == "segment":
        marks = [_as_line(m, s) for m, s in zip(marks, shapes, strict=True)]
    return marks


def _as_line(mark: Mark | None, shape: LineShape | None) -> Mark | None:
    """The mark of a line instead of that of its normal."""
    if mark is None or shape is None:
        return None
    seen = None if shape.seen is None else middle(shape.seen)
    at = middle(shape.curve)
    return replace(mark, h=at, S=None, z=seen, true_z=None, patch=0, line=shape)


def middle(curve: Vec) -> Vec:
    """The place half way along the samples of a curve."""
    return curve[len(curve) // 2]


def _mark(
    world: World,
    p: Predictions,
    i: int,
    judged: Association | None,
    match: Match | None,
    selected: int | None,
) -> Mark | None:
    label, fault = p.labels[i], int(p.fault[i])
    if fault & (Fault.BEHIND | Fault.OUTSIDE) or not np.isfinite(p.h[i]).all():
        return None
    if fault:
        state = "out"
    elif judged is not None:
        state = STATE_OF_VERDICT[judged.verdict]
    else:
        state = PENDING if p.selected[i] else "unselected"
    feature = world.features[label]
    partial = partially_initialised(feature)
    return Mark(
        label=label,
        state=state,
        h=p.h[i],
        S=p.E[i] + p.R[i],
        z=None if match is None else match.z,
        partial=partial,
        string=string_along_ray(world, p, i, feature) if partial and not fault else None,
        true_z=None if match is None else match.true_z,
        selected=label == selected,
        patch=patch_side(feature),
        particles=_particles(p, i),
    )


def _particles(p: Predictions, i: int) -> tuple[Vec, Vec] | None:
    """The particles of one feature that have any weight, and where they are predicted."""
    if p.particles is None:
        return None
    h, w = (a[i] for a in p.particles)
    alive = (w > 0.0) & np.isfinite(h).all(axis=-1)
    return (h[alive], w[alive] / w[alive].max()) if alive.any() else None


def _born(trace: Trace, mount: str, selected: int | None) -> list[Mark]:
    """Features that this mount started in this frame, where it saw them."""
    out = []
    for label, f in trace.world.features.items():
        if f.mount != mount or label in trace.start.features or f.known:
            continue
        line = None
        if f.model.shape == "segment":
            k = trace.world.mount_calib(mount)
            curve = line_marks.curves(trace.world.mounts[mount].sensor, k, f.z0[None])[0]
            line = LineShape(curve, curve[:0], curve)
        z = f.z0 if line is None else middle(line.curve)
        chosen, patch = label == selected, patch_side(f)
        out.append(
            Mark(label, "partial", z, None, z, True, selected=chosen, patch=patch, line=line)
        )
    return out


def raw_points(raw: Raw | None) -> Vec:
    """Raw measurements (k, m) of a sensor that gives points; none for an image."""
    return raw.z if isinstance(raw, Points) else np.zeros((0, 1))


def raw_pixels(raw: Raw | None) -> np.ndarray | None:
    """The grey picture, where there is one."""
    return raw.pixels if isinstance(raw, Image) else None


def outcome(marks: Sequence[Mark], label: int) -> Mark | None:
    """The mark of a feature."""
    return next((m for m in marks if m.label == label), None)
