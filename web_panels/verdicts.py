"""What this frame did with every feature, as far as it has got."""

from __future__ import annotations

from scene_core.filter.records import Association, Trace
from scene_core.filter.world import Label
from web_panels.style import STATE_OF_VERDICT


def outcomes(trace: Trace) -> dict[tuple[str, Label], Association]:
    """The latest word on every feature by every mount: the update's, or before it the gate's."""
    return {(a.mount, a.label): a for r in trace.records for a in r.associations}


def states(trace: Trace) -> dict[Label, str]:
    """Palette key of every feature somebody judged; of several sensors, the first that measured
    it counts."""
    out: dict[Label, str] = {}
    for (_, label), a in outcomes(trace).items():
        if out.get(label, "unselected") == "unselected":
            out[label] = STATE_OF_VERDICT[a.verdict]
    return out
