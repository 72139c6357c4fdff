"""Colours, sizes, words and the one style sheet of the page."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping

import numpy as np

from scene_core.filter.records import Verdict

RGB = tuple[int, int, int]

C: Mapping[str, RGB] = {
    "accepted": (239, 71, 60),
    "nomatch": (72, 149, 255),
    "rejected": (236, 84, 226),
    "unselected": (245, 178, 56),
    "out": (104, 114, 130),
    "partial": (62, 208, 196),
    "truth": (250, 216, 70),
    "estimate": (64, 206, 112),
    "robot 2": (166, 148, 255),
    "robot 3": (190, 214, 84),
    "robot 4": (255, 156, 128),
    "white": (255, 255, 255),
    "ink": (222, 228, 236),
    "dim": (133, 146, 164),
    "line": (34, 43, 55),
    "card": (13, 17, 23),
}
"""The palette. The first six are the states of a feature: SceneLib's colours where it had one."""

HEX: Mapping[str, str] = {k: "#{:02x}{:02x}{:02x}".format(*v) for k, v in C.items()}

ROBOTS = ("estimate", "robot 2", "robot 3", "robot 4")
"""Palette keys of the estimated robots, in their order."""

STATE_OF_VERDICT: Mapping[Verdict, str] = {
    "accepted": "accepted",
    "rejected": "rejected",
    "no match": "nomatch",
    "not selected": "unselected",
}
"""Palette key of a verdict; a feature without one is "out" of view."""

EVENT_COLOUR: Mapping[str, str] = {
    "born": "partial",
    "converted": "truth",
    "deleted": "unselected",
    "rejected": "rejected",
    "no match": "nomatch",
    "swap": "estimate",
    "error": "accepted",
    "info": "out",
}
"""Palette key of a kind of event."""

PHASES: Mapping[str, tuple[str, str]] = {
    "predict": ("Predict", "#4895ff"),
    "internal": ("Internal", "#9b8cff"),
    "select": ("Select", "#f5b238"),
    "search": ("Search", "#ef473c"),
    "associate": ("Associate", "#ec54e2"),
    "update": ("Update", "#40ce70"),
    "manage": ("Manage", "#3ed0c4"),
}
"""Title and colour of every phase."""

CERTAIN = 1e-9
"""A standard deviation below this is what rounding left of none."""

STYLE_SHEET = """<style>
:root[data-mantine-color-scheme=dark]{--mantine-color-dark-9:#0a0d12;--mantine-color-dark-8:#0d1117;
--mantine-color-dark-7:#12171f;--mantine-color-dark-6:#1a212b;--mantine-color-dark-5:#222b37;
--mantine-color-dark-4:#2b3645;--mantine-color-body:#12171f;--mantine-color-text:#dee4ec;
--mantine-color-dimmed:#8592a4;
--ink:#dee4ec;--dim:#8592a4;--soft:#b8c2cf;--rule:#222b37;--card:#0d1117;--key:#1a212b;--frame:#3a4656}
:root[data-mantine-color-scheme=light]{--ink:#1b2430;--dim:#5a6778;--soft:#39465a;--rule:#dbe1e9;
--card:#f4f6f9;--key:#eef1f5;--frame:#b4bfcd}
.e{font:12.5px/1.5 -apple-system,BlinkMacSystemFont,"Segoe UI",Roboto,"Helvetica Neue",Arial,
sans-serif;color:var(--ink);padding:0 13px 0 10px;font-variant-numeric:tabular-nums}
.e b{font-weight:600}.e .d{color:var(--dim)}
.e .row{display:flex;justify-content:space-between;align-items:center;gap:10px}
.e .h{font-size:10.5px;letter-spacing:.07em;text-transform:uppercase;color:var(--dim);
font-weight:600}
.e .chip{border-radius:3px;padding:1px 7px;font-size:11px;font-weight:600;white-space:nowrap}
.e .m{font-family:ui-monospace,"DejaVu Sans Mono",monospace;font-size:11px}
.e table{border-collapse:collapse;width:100%}
.e td,.e th{padding:4px 0;border-bottom:1px solid var(--rule);text-align:right;font-weight:400}
.e td:first-child,.e th:first-child{text-align:left}.e th{color:var(--dim);font-size:10.5px}
.e tr:last-child td{border-bottom:0}
.e .card{background:var(--card);border:1px solid var(--rule);border-radius:5px;padding:8px 10px}
.e .two{display:-webkit-box;-webkit-line-clamp:2;-webkit-box-orient:vertical;overflow:hidden}
.e math{font-size:14px}
.e kbd{font:600 10px ui-monospace,monospace;border:1px solid var(--frame);border-radius:3px;
padding:0 4px;color:var(--soft);background:var(--key)}
.e .lg{display:inline-flex;align-items:center;gap:5px;margin-right:11px;white-space:nowrap;
vertical-align:middle;font-size:11px;color:var(--soft)}
.e .mx{border:solid currentColor;border-width:0 1.3px;padding:0 3px;
background:linear-gradient(currentColor,currentColor) 0 0/4px 1.3px no-repeat,
linear-gradient(currentColor,currentColor) 100% 0/4px 1.3px no-repeat,
linear-gradient(currentColor,currentColor) 0 100%/4px 1.3px no-repeat,
linear-gradient(currentColor,currentColor) 100% 100%/4px 1.3px no-repeat}
.e .bad{background:#ef473c1f;border:1px solid #ef473c;border-radius:5px;padding:8px 10px}
.e .note{background:#f5b2381a;border:1px solid #f5b238;border-radius:5px;padding:5px 10px}
.e pre{font:11px/1.4 ui-monospace,"DejaVu Sans Mono",monospace;white-space:pre-wrap;margin:6px 0 0;
max-height:180px;overflow:auto}
[data-halves]{display:grid;grid-template-columns:repeat(2,minmax(0,1fr))}
[data-halves]>div:not([data-half]){grid-column:1/-1}
[data-half]:nth-child(odd of [data-half]){margin-right:3px!important}
[data-half]:nth-child(even of [data-half]){margin-left:3px!important}
.mantine-Button-root{padding-inline:4px!important}.mantine-Button-label{font-size:13px}
[data-scrolls]{padding-right:9px}
label{letter-spacing:0!important}
#scene-legend{position:fixed;z-index:5;pointer-events:none}
.e .maplegend{display:inline-block;background:color-mix(in srgb,var(--card) 85%,transparent);
border:1px solid var(--rule);border-radius:6px;padding:5px 4px 4px 12px;max-width:560px;
line-height:1.35}
[data-labelled]{width:7.4em!important}
[data-label]{overflow-wrap:break-word!important}[data-label] wbr{display:none}
@media(max-height:800px){.e .about{display:-webkit-box;-webkit-line-clamp:2;
-webkit-box-orient:vertical;overflow:hidden}}
@media(max-height:800px) and (min-width:48em){img[src^="blob:"]{
max-height:calc(50vh - 115px)!important;width:auto!important;display:block;margin:0 auto}}
[role=tab]{padding-inline:7px!important}
[data-triple] .mantine-NumberInput-section{display:none}
[data-triple] input{padding:0 .4em!important}
@media(max-width:36em){.mantine-Paper-root[style*="bottom: 0px"][style*="width: 20em"],
.mantine-Paper-root[style*="bottom: 0px"] div[style*="width: 20em"]{width:100%!important}
.mantine-Paper-root[style*="bottom: 0px"] .mantine-ScrollArea-content{
width:100vw!important;min-width:0!important}
.mantine-Paper-root[style*="bottom: 0px"] .mantine-ScrollArea-content>div>div:last-child{
display:flex;flex-direction:column}
.mantine-Paper-root[style*="bottom: 0px"] .mantine-ScrollArea-content>div>div:last-child>
div:last-child{order:-1}}
.u-legend{font-size:11px!important;margin:0!important}.u-title{font-size:12px!important;font-weight:600}
</style>"""
"""Put on the page once; every `add_html` of every panel is styled by it."""

LARGE_TYPE = "<style>.e{zoom:1.25}.mantine-Button-label,label{font-size:15px!important}</style>"
"""Follows the style sheet when the View tab asks for large type."""

UPLOT_AXIS: Mapping[str, object] = dict(
    stroke="#8592a4",
    grid=dict(stroke="#1f2833", width=1),
    ticks=dict(stroke="#2b3645", width=1),
    font="11px sans-serif",
    labelFont="11px sans-serif",
    size=34,
)
"""An axis of a plot that can be read on dark ground."""

SWATCHES: Mapping[str, str] = {
    "fill": '<rect x="5" y="3" width="8" height="8" fill="none" stroke="{c}" stroke-width="2"/>'
    '<ellipse cx="9" cy="7" rx="8" ry="6" fill="none" stroke="{c}"/>',
    "ellipse": '<ellipse cx="9" cy="7" rx="7.5" ry="5" fill="none" stroke="{c}" stroke-width="2"/>',
    "dash": '<ellipse cx="9" cy="7" rx="7.5" ry="5" fill="none" stroke="{c}" stroke-width="2" '
    'stroke-dasharray="4 3"/>',
    "thin": '<ellipse cx="9" cy="7" rx="7.5" ry="5" fill="none" stroke="{c}"/>',
    "dot": '<circle cx="9" cy="7" r="4.5" fill="{c}"/>',
    "small": '<circle cx="9" cy="7" r="2.2" fill="{c}"/>',
    "grains": '<circle cx="4" cy="10" r="1.6" fill="{c}"/><circle cx="9" cy="7" r="2.6" '
    'fill="{c}"/><circle cx="14.5" cy="4" r="1.9" fill="{c}"/>',
    "ring": '<circle cx="9" cy="7" r="5" fill="none" stroke="{c}" stroke-width="1.5"/>',
    "line": '<path d="M1 7H17" stroke="{c}" stroke-width="2.5"/>',
    "cross": '<path d="M9 2V12M4 7H14" stroke="{c}" stroke-width="2"/>',
    "ray": '<path d="M2 12L16 3" stroke="{c}" stroke-width="1.5"/><circle cx="11" cy="6.2" r="3" '
    'fill="{c}"/>',
}
"""Drawings of the legend by kind."""


def escape(text: object) -> str:
    """Text from a file, a name or a user, made harmless for `add_html` and `add_markdown`."""
    return html.escape(str(text), quote=True)


def block(inner: str, css: str = "") -> str:
    """Markup in the type of the page."""
    return f'<div class="e" style="{css}">{inner}</div>'


def swatch(kind: str, colour: str) -> str:
    """A small drawing of a line or a shape, in a palette colour."""
    drawing = SWATCHES[kind].format(c=HEX[colour])
    return f'<svg width="18" height="14" style="flex:none">{drawing}</svg>'


def legend(items: Iterable[tuple[str, str, str]]) -> str:
    """Swatches with their words: (kind, palette key, text), text already escaped."""
    return "".join(f'<span class="lg">{swatch(k, c)}{t}</span>' for k, c, t in items)


def shown(value: float, unit: str) -> tuple[float, str]:
    """Value and unit as the page shows them: angles in degrees, everything else as it is."""
    if unit == "rad" or unit.startswith(("rad/", "rad ")):
        return math.degrees(value), "°" + unit[3:]
    return value, unit


def number(value: float, digits: int = 3) -> str:
    """A number of so many significant digits, without an exponent where it can be read."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{max(0, digits - 1)}e}".replace("-", "−")
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{places}f}".replace("-", "−")


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A number with its unit, angles in degrees."""
    v, u = shown(value, unit)
    gap = "" if u.startswith("°") else " "
    return f"{number(v, digits)}{gap}{u}".strip()


def gate_words(d2: float, gate: float, dof: int, confidence: float) -> str:
    """d2 = 12.4 > 9.21 (2 DoF, 99 %)."""
    sign = "&gt;" if d2 >= gate else "&lt;"
    return f"d2 = {d2:.1f} {sign} {gate:.2f} ({dof} DoF, {100 * confidence:.4g} %)"


def robot_colour(i: int) -> RGB:
    """The colour of the i-th robot of an experiment."""
    return C[robot_key(i)]


def robot_key(i: int) -> str:
    """The palette key of the i-th robot of an experiment."""
    return ROBOTS[i % len(ROBOTS)]


def linear(rgb: np.ndarray | RGB) -> np.ndarray:
    """Colours (..., 3) of batched instances, which the browser takes as linear light."""
    return (255.0 * (np.asarray(rgb, dtype=np.float64) / 255.0) ** 2.2).astype(np.uint8)
