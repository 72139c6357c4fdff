"""What happened to one feature in one frame, in words.

Every branch of the frame has its sentence: predicted, visible or why not, selected or why not,
searched, matched, held against the gate, in the update. Each says what to do next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scene_core.arrays import Vec
from scene_core.filter.ports import Match, Points
from scene_core.filter.records import Association, Event, Predictions, Trace
from scene_core.filter.select import ranked
from scene_core.models.base import Fault, Sensor, words
from web_panels.marks import matches, verdicts
from web_panels.style import STATE_OF_VERDICT, escape, gate_words, number, shown

NEXT_PHASE = "press <kbd>P</kbd> for the next phase"
CLOSE_PEAKS = 0.06
"""A runner-up that scores this near to the best peak looks like repeated texture."""

REMEDY = {
    Fault.BEHIND: "It is measured again when the sensor turns to it.",
    Fault.OUTSIDE: "It is measured again when it comes into view.",
    Fault.SCALE: "It is measured again from a distance nearer to that of its first view; the "
    "sensor's scale limit in the Estimator tab sets how near.",
    Fault.ANGLE: "It is measured again from a direction nearer to that of its first view; the "
    "sensor's angle limit in the Estimator tab sets how near.",
    Fault.UNCERTAIN: "It is measured again when the robot's position is better known; raise "
    "'Search, max' to search farther.",
    Fault.INFEASIBLE: "It is measured again when the state allows it.",
}
"""What lets a feature be measured again, by fault."""


@dataclass(frozen=True)
class Story:
    """One feature in one frame, as seen by one sensor."""

    state: str
    """Palette key."""
    chip: str
    """The verdict in two words."""
    text: str
    """Sentences, as markup."""


def place(sensor: Sensor, z: Vec, plus: bool = False) -> str:
    """A measurement with its units: (236.4, 204.4) px, or r 3.21 m, b 12.3°."""
    sign = "+" if plus else ""
    parts = [shown(float(v), u) for v, u in zip(z, sensor.units, strict=True)]
    cells = [
        f"{v:{sign}.{1 if u in ('px', '°') else 3}f}".replace("-", "\N{MINUS SIGN}")
        for v, u in parts
    ]
    units = {u for _, u in parts}
    if len(units) == 1 and len(cells) > 1:
        return f"({', '.join(cells)}) {escape(units.pop())}"
    return ", ".join(
        f"{escape(name)} {c}{'' if u.startswith('°') else ' '}{escape(u)}"
        for name, c, (_, u) in zip(sensor.labels, cells, parts, strict=True)
    )


def segment_place(sensor: Sensor, ends: Vec) -> str:
    """Both ends of a segment with their units."""
    n = len(sensor.units)
    return f"{place(sensor, ends[:n])} to {place(sensor, ends[n:])}"


def where(sensor: Sensor, z: Vec) -> str:
    """A point or a segment, as it was measured."""
    return (segment_place if len(z) == 2 * len(sensor.units) else place)(sensor, z)


def expected(sensor: Sensor, p: Predictions, i: int) -> str:
    """Where a feature is predicted; of a line, where its ends are expected."""
    return place(sensor, p.h[i]) if p.ends is None else segment_place(sensor, p.ends[i])


def story(trace: Trace, mount: str, label: int) -> Story:
    """The words for a feature and a mount."""
    own = [e for e in trace.events if e.label == label]
    feature = trace.world.features.get(label) or trace.start.features.get(label)
    if feature is None:
        return Story(
            "out", "gone", f"There is no feature {label} in this frame: select another one."
        )
    if label not in trace.start.features:
        return _born(trace, label)
    told = _measured(trace, mount, label)
    for event in own:
        if event.kind in ("converted", "deleted"):
            opened = trace.start.features[label].particles is not None
            told = _with_event(told, event, opened)
    return told


def _with_event(told: Story, event: Event, opened: bool) -> Story:
    after = {
        "converted": "Then its particles agreed"
        if opened
        else "Then it was certain enough for its depth to be linear",
        "deleted": "Then it was forgotten",
    }[event.kind]
    chip = "deleted" if event.kind == "deleted" else told.chip
    return Story(told.state, chip, f"{told.text} {after}: {escape(event.text)}.")


def _born(trace: Trace, label: int) -> Story:
    f = trace.world.features[label]
    sensor = trace.world.mounts[f.mount].sensor
    return Story(
        "partial",
        "new",
        f"Started in this frame as {escape(f.model.name)} where {escape(f.mount)} saw it, at "
        f"{where(sensor, f.z0)}. It is predicted and measured from the next frame on: press "
        "<kbd>N</kbd>.",
    )


def _measured(trace: Trace, mount: str, label: int) -> Story:
    who = escape(mount)
    if mount not in trace.frame.raw:
        return Story(
            "out", "not measured", f"{who} gave no data in this frame: step on with <kbd>N</kbd>."
        )
    seen = trace.predictions(mount)
    p = next((p for p in seen if label in p.row), None)
    if p is None:
        if any(r.phase == "select" and r.mount == mount for r in trace.records):
            return Story(
                "out", "not measured", f"{who} can not measure this kind of feature: another can."
            )
        return Story("out", "waiting", f"Not predicted by {who} yet: {NEXT_PHASE}.")
    sensor = trace.world.mounts[mount].sensor
    i = p.row[label]
    fault = int(p.fault[i])
    if fault:
        return _not_measurable(fault, who)
    line, opened = p.shape == "segment", p.particles is not None
    at = f"Predicted {'from' if line else 'at'} {expected(sensor, p, i)}"
    if opened:
        at += " on average over its particles"
    judged, match = verdicts(trace, mount).get(label), matches(trace, mount).get(label)
    if not p.selected[i]:
        return _not_selected(trace, seen, label, at)
    rank = _rank(trace, seen, label)
    if judged is not None:
        return _judged(sensor, judged, match, f"{at}, {rank}", trace)
    if match is None:
        return Story("ink", "selected", f"{at}, {rank}. It is searched next: {NEXT_PHASE}.")
    if match.z is None:
        return Story(
            "nomatch", "no match", f"{at}, {rank}. {_search_words(match, trace)} {NEXT_PHASE}."
        )
    return Story(
        "ink",
        "matched",
        f"{at}, {rank}. {_search_words(match, trace)} It meets the gate next: {NEXT_PHASE}.",
    )


def _not_measurable(fault: int, who: str) -> Story:
    remedy = " ".join(text for bit, text in REMEDY.items() if fault & bit)
    chip = "out of view" if fault & (Fault.BEHIND | Fault.OUTSIDE) else "not measurable"
    return Story("out", chip, f"Not measurable by {who}: {words(fault)}. {remedy}")


def _rank(trace: Trace, seen: Sequence[Predictions], label: int) -> str:
    order = ranked(seen)
    at = [name for _, name in order].index(label)
    how = trace.world.policies.selection.score
    return f"{at + 1} of {len(order)} by score ({how} of E = {number(order[at][0])}), selected"


def _not_selected(trace: Trace, seen: Sequence[Predictions], label: int, at: str) -> Story:
    order = ranked(seen)
    rank = [name for _, name in order].index(label)
    budget = trace.world.policies.selection.budget
    how = trace.world.policies.selection.score
    return Story(
        "unselected",
        "not selected",
        f"{at} and visible, but its score ({how} of E = {number(order[rank][0])}) is only "
        f"{rank + 1} of {len(order)}, and {budget} are measured. It waits until it is less "
        "certain; raise 'Select, max' to measure more.",
    )


def _search_words(match: Match, trace: Trace) -> str:
    if isinstance(trace.frame.raw[match.mount], Points):
        return _points_words(match, trace.world.policies.association.kind)
    many = "position" if match.positions == 1 else "positions"
    where = f"Searched at {match.positions} {many}"
    if match.z is None:
        return f"{where}."
    best = f"{where}: the best correlation (NCC) is {match.score:.2f}, needed {match.threshold:.2f}"
    if match.runner_up is None:
        return f"{best}, with no rival."
    return f"{best}; the second best place has {match.runner_up:.2f}."


def _points_words(match: Match, kind: str) -> str:
    if kind == "identity":
        return "Looked for by its identity." if match.z is None else "Recognised by its identity."
    if match.z is None:
        return "Looked for in its gate."
    if match.positions == 1:
        return "The only measurement in its gate."
    return f"Of {match.positions} measurements in its gate, the nearest that no other feature took."


def _judged(sensor: Sensor, a: Association, match: Match | None, at: str, trace: Trace) -> Story:
    state = STATE_OF_VERDICT[a.verdict]
    searched = "" if match is None else _search_words(match, trace) + " "
    known = (
        ""
        if a.wrong is None
        else " (The simulation knows: the match is wrong.)"
        if a.wrong
        else " (The simulation knows: the match is right.)"
    )
    if a.verdict == "no match":
        return Story(state, a.verdict, f"{at}. {searched}{_missed(a, match, trace)}")
    if a.verdict == "not selected" or a.d2 is None or a.gate is None:
        return Story(state, a.verdict, f"{at}. {escape(a.why)}.")
    gate = gate_words(a.d2, a.gate, a.dof, a.confidence)
    sigmas = f"{a.d2**0.5:.1f} sigma from its prediction"
    if len(a.h) != len(a.S):
        sigmas = f"{a.d2**0.5:.1f} sigma off the line, its ends being free to slide along it"
    if a.verdict == "accepted":
        return Story(
            state,
            a.verdict,
            f"{at}. {searched}The match lies {sigmas}, {gate}: it is in the update.{known}",
        )
    redo = "press <kbd>R</kbd> to redo the frame after changing the gate"
    if a.d2 < a.gate:
        return Story(
            state,
            a.verdict,
            f"{at}. {searched}The match lies {sigmas}, {gate}, but it {escape(a.why)}. It is left "
            f"out of this update; {redo}.{known}",
        )
    guess = ""
    if match is not None and match.runner_up is not None:
        if match.score - match.runner_up < CLOSE_PEAKS:
            guess = ": probably a repeated texture"
    return Story(
        state,
        a.verdict,
        f"{at}. {searched}The match lies {sigmas}{guess}. {gate}, so it is left out of this "
        f"update; {redo}.{known}",
    )


def _missed(a: Association, match: Match | None, trace: Trace) -> str:
    feature = trace.world.features.get(a.label) or trace.start.features[a.label]
    rules = trace.world.policies.management
    text = f"Not found: {escape(a.why)}."
    if feature.misses > 1:
        text += f" It failed {feature.misses} times in a row."
    if feature.known and not rules.delete_known:
        return f"{text} It was given at the start and stays; it is searched again when selected."
    if not rules.min_match_ratio:
        return f"{text} It is searched again when selected."
    return (
        f"{text} It is searched again when selected, and forgotten when fewer than "
        f"{100 * rules.min_match_ratio:.0f} % of at least {rules.min_attempts} searches find it "
        f"(now {feature.matches} of {feature.attempts})."
    )


def interesting(trace: Trace) -> int | None:
    """The feature worth looking at: a rejected one, else one not found, else the largest d2.

    Before anything is judged: the one that was selected first, else any.
    """
    found = [a for mount in trace.frame.raw for a in verdicts(trace, mount).values()]
    for verdict in ("rejected", "no match"):
        hit = next((a.label for a in found if a.verdict == verdict), None)
        if hit is not None:
            return hit
    judged = [a for a in found if a.d2 is not None]
    if judged:
        return max(judged, key=lambda a: a.d2 or 0.0).label
    order = [row for mount in trace.frame.raw for row in ranked(trace.predictions(mount))]
    if order:
        return max(order)[1]
    return next(iter(trace.world.features), None)
