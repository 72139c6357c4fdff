"""One frame as a generator of phases, and nothing else.

predict, internal; then for every mount that fired: select, search, associate, update, manage.
Each phase yields the immutable world after it and every decision with its reason, so pausing
between phases, redoing a frame and showing it from another thread need nothing more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

from scene_core.filter.associate import judged, queries
from scene_core.filter.correct import correct
from scene_core.filter.expect import predictions, with_selected
from scene_core.filter.manage import manage
from scene_core.filter.observe import sensor_state
from scene_core.filter.ports import Frame, Image, Match, Source
from scene_core.filter.predict import measure_internally, predict
from scene_core.filter.records import Association, Event, Phase, PhaseRecord, Predictions
from scene_core.filter.select import ranked, select
from scene_core.filter.warp import warps
from scene_core.filter.world import Label, World


def step(world: World, frame: Frame, source: Source) -> Iterator[PhaseRecord]:
    """All phases of a frame, in order; the last record's world is the state after the frame."""
    record = _timed("predict", None, lambda: _predict(world, frame))
    yield record
    record = _timed("internal", None, lambda w=record.world: _internal(w, frame))
    yield record
    world = record.world
    for mount in frame.raw:
        for record in observe_with(world, frame, source, mount):
            yield record
            world = record.world


def observe_with(world: World, frame: Frame, source: Source, mount: str) -> Iterator[PhaseRecord]:
    """The phases of one mount."""
    selected = _timed("select", mount, lambda: _select(world, mount))
    yield selected
    seen = selected.predictions
    labels = select(seen, world.policies.selection.budget)
    searched = _timed("search", mount, lambda: _search(world, frame, source, mount, seen, labels))
    yield searched
    judged = _timed("associate", mount, lambda: _associate(world, mount, seen, searched.matches))
    yield judged
    updated = _timed(
        "update", mount, lambda: _update(world, mount, searched.matches, judged.associations)
    )
    yield updated
    agreed = {a.label for a in updated.associations if a.verdict == "accepted"}
    fresh = [match for match in searched.matches if match.label in agreed]
    yield _timed("manage", mount, lambda: _manage(updated.world, frame, source, mount, seen, fresh))


def _timed(phase: Phase, mount: str | None, work: Callable[[], dict[str, Any]]) -> PhaseRecord:
    t0 = perf_counter()
    content = work()
    return PhaseRecord(phase=phase, mount=mount, ms=1e3 * (perf_counter() - t0), **content)


def _predict(world: World, frame: Frame) -> dict[str, Any]:
    moved, numbers = predict(world, frame)
    return dict(world=moved, numbers=numbers)


def _internal(world: World, frame: Frame) -> dict[str, Any]:
    after, updates = measure_internally(world, frame)
    events = tuple(
        Event(frame.index, "rejected", f"{u.instrument} rejected: {u.why}")
        for u in updates
        if not u.accepted
    )
    return dict(world=after, internals=updates, events=events)


def _select(world: World, mount: str) -> dict[str, Any]:
    seen = predictions(world, mount)
    budget = world.policies.selection.budget
    order = ranked(seen)
    numbers = {"measurable": float(len(order)), "budget": float(budget)}
    if len(order) > budget > 0:
        numbers["lowest selected score"] = order[budget - 1][0]
    return dict(
        world=world,
        predictions=with_selected(seen, [label for _, label in order[:budget]]),
        numbers=numbers,
    )


def _search(
    world: World,
    frame: Frame,
    source: Source,
    mount: str,
    seen: tuple[Predictions, ...],
    labels: tuple[Label, ...],
) -> dict[str, Any]:
    if not labels:
        return dict(world=world)
    matches: tuple[Match, ...] = ()
    for request in queries(world, mount, seen, labels):
        if isinstance(frame.raw[mount], Image) and world.policies.vision.warp:
            request = replace(
                request, warp=warps(world, sensor_state(world, mount), request.labels)
            )
        matches += tuple(source.search(frame, request, world.policies.vision))
    numbers = {
        "searched": float(len(matches)),
        "found": float(sum(match.z is not None for match in matches)),
        "positions": float(sum(match.positions for match in matches)),
    }
    return dict(world=world, matches=matches, numbers=numbers)


def _associate(
    world: World,
    mount_id: str,
    seen: tuple[Predictions, ...],
    matches: tuple[Match, ...],
) -> dict[str, Any]:
    return dict(world=world, associations=judged(world, mount_id, seen, matches))


def _update(
    world: World, mount: str, matches: tuple[Match, ...], verdicts: tuple[Association, ...]
) -> dict[str, Any]:
    if not matches:
        return dict(world=world, associations=verdicts)
    after, final, numbers = correct(world, mount, matches, verdicts)
    events = tuple(
        Event(world.frame, "rejected", f"{a.label} rejected, {a.why}", a.label)
        for a in final
        if a.verdict == "rejected"
    )
    return dict(world=after, associations=final, events=events, numbers=numbers)


def _manage(
    world: World,
    frame: Frame,
    source: Source,
    mount: str,
    seen: tuple[Predictions, ...],
    fresh: Sequence[Match],
) -> dict[str, Any]:
    after, events = manage(world, frame, source, mount, seen, fresh)
    return dict(world=after, events=tuple(events))
