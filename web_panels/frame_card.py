"""What this frame did, what it took, where the robot is: the cards below the transport."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np
import viser

from scene_core.filter.records import Trace
from scene_core.session.published import Published, RobotSeries
from scene_core.session.tracks import pose_estimate
from web_panels import style
from web_panels.map_geometry import last_known
from web_panels.panel import Page, Post
from web_panels.style import CERTAIN, HEX, PHASES, escape, number, shown
from web_panels.verdicts import states

POINTS = 150
"""Samples of the consistency curve."""


def counts(trace: Trace) -> Counter[str]:
    """Features by state."""
    known = trace.world.features
    out = Counter(key for label, key in states(trace).items() if label in known)
    born = sum(f.born == trace.frame.index and not f.known for f in known.values())
    out["partial"] = born
    out["out"] = max(0, len(known) - sum(out.values()))
    return out


COUNT_ROWS = (
    ("accepted", "accepted", "in the update"),
    ("nomatch", "no match", "searched, not found"),
    ("rejected", "rejected", "outside its gate"),
    ("unselected", "not selected", "little information"),
    ("partial", "new", "started in this frame"),
    ("out", "out of view", ""),
)


def count_table(p: Published) -> str:
    """How many features this frame accepted, missed, rejected, left out and found."""
    if p.trace is None:
        return '<div class="d" style="margin-top:10px">No frame yet. Press <kbd>Space</kbd>.</div>'
    n = counts(p.trace)
    rows = "".join(
        f'<tr><td><span style="color:{HEX[key]}">■</span>&nbsp; {name}</td>'
        f'<td class="d" style="text-align:left">{why}</td><td><b>{n[key]}</b></td></tr>'
        for key, name, why in COUNT_ROWS
    )
    features = len(p.trace.world.features)
    noun = "feature" if features == 1 else "features"
    return (
        f'<div class="row" style="margin-top:8px"><span class="h">This frame</span>'
        f'<span class="d">{features} {noun} in the map</span></div>'
        f'<table style="margin:2px 0 10px">{rows}</table>'
    )


def time_bar(p: Published) -> str:
    """Milliseconds by phase of the last frame, against the time between two frames."""
    if p.trace is None or not p.trace.records:
        return ""
    ms: dict[str, float] = {}
    for r in p.trace.records:
        ms[r.phase] = ms.get(r.phase, 0.0) + r.ms
    total = sum(ms.values())
    budget = 1000.0 / p.experiment.source.frame_rate
    scale = 288.0 / max(total, 1e-9)
    bars, cells, x = "", "", 0.0
    bar_css = "display:block;margin:5px 0 4px"
    for phase, t in ms.items():
        title, c = PHASES[phase]
        width = max(0.0, t * scale - 1.5)
        bars += f'<rect x="{x:.1f}" width="{width:.1f}" height="10" fill="{c}" opacity=".8"/>'
        x += t * scale
        cells += (
            f'<div style="font-size:11px;line-height:1.35"><span style="color:{c}">■</span> '
            f'<span class="d">{title}</span><br><b>{t:.1f}</b></div>'
        )
    return (
        '<div class="row"><span class="h">Time per phase</span>'
        f'<span class="d">{total:.1f} of {budget:.1f} ms</span></div>'
        f'<svg viewBox="0 0 288 10" width="100%" style="{bar_css}">{bars}</svg>'
        '<div style="display:grid;grid-template-columns:repeat(4,1fr);gap:0 6px">'
        f"{cells}</div>"
    )


def _signed(value: float) -> str:
    text = number(abs(value), 2)
    return text if text == "0" else f"{'−' if value < 0 else '+'}{text}"


def pose_rows(
    estimate: Iterable[float], sds: Iterable[float], r: RobotSeries, complete: bool
) -> str:
    """One row per tangent component: estimate, 3 sigma, and the error of a complete frame."""
    out, wrong = "", last_known(r.error) if complete else None
    rows = zip(r.labels, r.units, estimate, sds, strict=True)
    for i, (label, unit, value, one_sd) in enumerate(rows):
        v, u = shown(value, unit)
        sd = shown(3.0 * float(one_sd), unit)[0]
        sd = sd if sd > CERTAIN else 0.0
        gap = "" if u.startswith("°") else " "
        error = "" if wrong is None else _signed(shown(float(wrong[i]), unit)[0])
        out += (
            f"<tr><td>{escape(label)}</td><td>{_fixed(v, sd)}{gap}{u}</td>"
            f'<td class="d">± {number(sd, 2)}</td><td>{error}</td></tr>'
        )
    return out


def _fixed(value: float, sd: float) -> str:
    """A value to the decimals its 3 sigma deserves."""
    if not (np.isfinite(value) and np.isfinite(sd)):
        return "–"
    places = 2 if sd <= 0 else int(np.clip(1 - np.floor(np.log10(sd)), 0, 5))
    return f"{value:.{places}f}".replace("-", "−")


def pose_card(p: Published) -> str:
    """Where every robot is, how sure the filter is, and how wrong."""
    if p.trace is None:
        return ""
    out = ""
    several = len(p.series.robots) > 1
    for name, r in p.series.robots.items():
        if not len(r.sd):
            continue
        motion = p.trace.world.robots[r.robot].motion
        if r.body not in motion.bodies:
            continue
        space, now = motion.space, pose_estimate(p.trace.world, r.robot, r.body)
        estimate = space.difference(now.xp, space.identity())
        sds = np.sqrt(np.maximum(np.diag(now.P), 0.0))
        complete, title = p.trace.complete, f"Pose of {name}" if several else "Robot pose"
        note = "estimate, 3 sigma" + (", error" if complete and r.error is not None else "")
        out += (
            '<div class="row" style="margin-top:12px;white-space:nowrap"><span class="h" '
            f'style="overflow:hidden;text-overflow:ellipsis">{escape(title)}</span>'
            f'<span class="d">{note}</span></div>'
            f'<table style="margin:2px 0 12px">{pose_rows(estimate, sds, r, complete)}</table>'
        )
        if r.nees is not None:
            out += consistency(r)
    return out


def consistency(r: RobotSeries) -> str:
    """NEES over the last frames, in its 95 % band."""
    assert r.nees is not None
    lo, hi = r.nees_band
    known = last_known(r.nees[:, None])
    value = float("nan") if known is None else float(known[0])
    curve = r.nees[-POINTS:]
    top = 1.35 * hi

    def y(v: float) -> float:
        return 44.0 - 42.0 * min(max(v, 0.0), top) / top

    step = 288.0 / max(POINTS - 1, 1)
    line = " ".join(f"{i * step:.1f},{y(v):.1f}" for i, v in enumerate(curve) if np.isfinite(v))
    c = HEX["estimate"]
    return (
        '<div class="row"><span class="h">Consistency</span>'
        f"<span>NEES <b>{number(value, 3)}</b> "
        f'<span class="d">in {lo:.2f} to {hi:.2f}</span></span></div>'
        '<svg viewBox="0 0 288 46" width="100%" style="display:block;margin:5px 0 10px">'
        '<rect width="288" height="46" rx="3" fill="var(--card)"/>'
        f'<rect y="{y(hi):.1f}" width="288" height="{y(lo) - y(hi):.1f}" fill="{c}" opacity=".13"/>'
        f'<path d="M0 {y(hi):.1f}H288M0 {y(lo):.1f}H288" stroke="{c}" stroke-dasharray="4 3" '
        'opacity=".6"/>'
        f'<polyline points="{line}" fill="none" stroke="var(--ink)" stroke-width="1.3"/>'
        '<text x="284" y="9.5" text-anchor="end" font-size="9" fill="var(--dim)">'
        f"95 %, {r.nees_dof} DoF</text></svg>"
    )


class FrameCard:
    """Counts, times, pose and consistency of the frame that is shown."""

    rate_hz = 5.0

    def __init__(self, page: Page) -> None:
        self.page = page

    def build(self, server: viser.ViserServer, post: Post) -> None:
        self.html = server.gui.add_html("")

    def render(self, p: Published) -> None:
        self.html.content = style.block(count_table(p) + time_bar(p) + pose_card(p))
