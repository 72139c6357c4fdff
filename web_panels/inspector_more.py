"""The inspector's words for what is no plain point: lines, and features carried by particles."""

from __future__ import annotations

import numpy as np

from scene_core import params
from scene_core.arrays import Vec
from scene_core.filter.ports import Match
from scene_core.filter.records import Association, Predictions
from scene_core.filter.world import Feature, World
from scene_core.models.base import Particles
from web_panels.line_marks import pixels_per_radian
from web_panels.story import segment_place
from web_panels.style import HEX, escape, number, quantity

BINS = 48
"""Bars of the histogram, at most."""
WIDTH, HEIGHT = 288.0, 56.0


def row(name: str, what: str, text: str) -> str:
    """One line of the table beside the patches."""
    return (
        f'<tr><td><b>{name}</b></td><td class="d" style="text-align:left">&nbsp;{what}</td>'
        f"<td>{text}</td></tr>"
    )


def line_rows(
    world: World, p: Predictions, i: int, a: Association | None, match: Match | None
) -> str:
    """h is a normal, z both ends, nu their distances from the line, in mrad and in px."""
    assert p.ends is not None
    sensor, k = world.mounts[p.mount].sensor, world.mount_calib(p.mount)
    S = p.S[i] if a is None else a.S
    out = row("h", "normal of the plane", f"({', '.join(number(v) for v in p.h[i])})")
    out += row("", "ends expected", segment_place(sensor, p.ends[i]))
    z = None if match is None else match.z
    if z is not None:
        out += row("z", "ends matched", segment_place(sensor, z))
    if z is not None and a is not None and a.nu is not None:
        px = a.nu * pixels_per_radian(sensor, k, z, p.h[i])
        out += row("&nu;", "off the line", f"{_pair(1e3 * a.nu)} mrad<br>{_pair(px)} px")
    sd = 1e3 * np.sqrt(np.maximum(np.diag(S), 0.0))
    rho = S[0, 1] / max(np.sqrt(S[0, 0] * S[1, 1]), 1e-300)
    text = f"{number(sd[0])}, {number(sd[1])} mrad"
    return out + row("S", "1 sigma of each", f"{text}, correlation {number(float(rho), 2)}")


def _pair(v: Vec) -> str:
    return "(" + ", ".join(f"{x:+.2f}" for x in v).replace("-", "\N{MINUS SIGN}") + ")"


def particles_card(feature: Feature) -> str:
    """How many particles are left, what they say together, and when they settle."""
    cloud, model = feature.particles, feature.model
    if cloud is None:
        return ""
    mean, cov = model.moments(cloud)
    sd = np.sqrt(np.maximum(np.diag(cov), 0.0))
    cards = ""
    for i, (name, unit) in enumerate(zip(model.free_labels, model.free_units, strict=True)):
        value, spread = float(mean[i]), float(sd[i])
        part = f", {spread / abs(value):.2f} of it" if value and unit != "rad" else ""
        words = f"<b>{quantity(value, unit)}</b> ± {quantity(spread, unit)}{part}"
        cards += (
            f'<div class="row"><span>{escape(name)} {words}</span></div>'
            f"{histogram(cloud, i, value, spread, unit)}"
        )
    return (
        '<div class="card" style="margin-top:8px"><div class="row"><span class="h">Particles</span>'
        f'<span class="d">{len(cloud.w)} left, mean ± 1 sigma</span></div>{cards}'
        f'<div class="d">{settling(feature)}</div></div>'
    )


def settling(feature: Feature) -> str:
    """When the feature stops being partial."""
    spec = next((s for s in params.schema(feature.model) if s.name == "ratio"), None)
    next_ = feature.model.successor()
    becomes = "" if next_ is None else f" It becomes: {escape(next_.name)}."
    if spec is None:
        return f"Converted when its own model says so.{becomes}"
    help_text = " ".join(spec.help.split())
    return f"{escape(spec.label)} {number(spec.value, 2)}. {escape(help_text)}{becomes}"


def histogram(cloud: Particles, i: int, mean: float, sd: float, unit: str) -> str:
    """Weights over one free parameter, with mean and standard deviation, as a drawing."""
    lam, w = cloud.lam[:, i], cloud.w
    lo, hi = float(lam.min()), float(lam.max())
    span = max(hi - lo, 1e-9 * max(1.0, abs(hi)))
    bins = max(1, min(BINS, len(np.unique(lam))))
    index = np.minimum(((lam - lo) / span * bins).astype(int), bins - 1)
    heights = np.bincount(index, w, bins)
    heights = heights / max(heights.max(), 1e-300)
    step, c = WIDTH / bins, HEX["partial"]
    bars = "".join(
        f'<rect x="{k * step:.1f}" y="{HEIGHT - HEIGHT * v:.1f}" width="{max(step - 1, 0.6):.1f}" '
        f'height="{HEIGHT * v:.1f}" fill="{c}" opacity=".8"/>'
        for k, v in enumerate(heights)
        if v > 0.0
    )

    def x(value: float) -> float:
        return float(np.clip((value - lo) / span, 0.0, 1.0)) * WIDTH

    band = f'<rect x="{x(mean - sd):.1f}" width="{x(mean + sd) - x(mean - sd):.1f}" '
    band += f'height="{HEIGHT:.0f}" fill="var(--ink)" opacity=".09"/>'
    line = f'<path d="M{x(mean):.1f} 0V{HEIGHT:.0f}" stroke="var(--ink)" stroke-width="1.3"/>'
    first, last = (quantity(v, unit) for v in (lo, hi))
    ends = (
        f'<g font-size="10.5" fill="var(--dim)"><text x="0" y="{HEIGHT + 12:.0f}">{first}</text>'
        f'<text x="{WIDTH:.0f}" y="{HEIGHT + 12:.0f}" text-anchor="end">{last}</text></g>'
    )
    return (
        f'<svg viewBox="0 0 {WIDTH:.0f} {HEIGHT + 15:.0f}" width="100%" '
        f'style="display:block;margin:4px 0">{band}{bars}{line}{ends}</svg>'
    )
