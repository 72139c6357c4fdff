"""The legend of the map, placed over the 3-D canvas wherever the panels leave it."""

from __future__ import annotations

from scene_core.geometry.ellipses import sigma
from web_panels import style
from web_panels.panel import Look
from web_panels.style import legend

MAP_LEGEND = (
    ("line", "truth", "truth"),
    ("line", "estimate", "estimate"),
    ("dot", "accepted", "accepted"),
    ("dot", "nomatch", "no match"),
    ("dot", "rejected", "rejected"),
    ("dot", "unselected", "not selected"),
    ("dot", "out", "out of view"),
    ("ray", "partial", "new; ray: depth open"),
)

PLACE_LEGEND = """(()=>{const id='scene-legend',m=document.getElementById('scene-legend-source');
let d=document.getElementById(id);if(!m)return;if(!d){d=document.createElement('div');d.id=id;
document.body.appendChild(d);const place=()=>{const c=window.__viserMutable&&
window.__viserMutable.canvas;if(!c)return;const r=c.getBoundingClientRect();
const narrow=window.innerWidth<700;d.style.left=r.left+'px';d.style.width=r.width+'px';
d.style.top=narrow?'6px':'auto';d.style.bottom=narrow?'auto':(window.innerHeight-r.bottom+10)+'px'};
setInterval(place,300);place()}d.innerHTML=m.innerHTML})()"""
"""Copies the legend over the middle of the 3-D canvas, wherever the panels leave it."""


def confidence_words(look: Look, d: int) -> str:
    """95 % in 3-D = 2.80 sigma."""
    return f"{100 * look.confidence:g} % in {d}-D = {sigma(d, look.confidence):.2f} sigma"


def legend_html(look: Look, d: int) -> str:
    """The legend of the map, and the script that puts it there."""
    if look.colour == "correlation":
        items = (
            ("line", "truth", "truth"),
            ("line", "estimate", "estimate"),
            ("dot", "out", "correlation 0"),
            ("dot", "unselected", "1 with the selected"),
        )
    else:
        items = MAP_LEGEND
    inner = (
        '<div class="e" style="text-align:center"><div class="maplegend">'
        f'{legend(items)}<span class="lg">ellipsoids {confidence_words(look, d)}</span></div></div>'
    )
    script = style.escape(PLACE_LEGEND)
    return (
        f'<div id="scene-legend-source" style="display:none">{inner}</div>'
        f'<img src="data:," style="display:none" onerror="{script}">'
    )
