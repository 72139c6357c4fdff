"""The legend of the map, placed over the 3-D canvas wherever the panels leave it."""

from __future__ import annotations

from collections.abc import Sequence

from scene_core.geometry.ellipses import sigma
from scene_core.session.published import Published
from scene_core.session.tracks import body_name
from web_panels import map_geometry as geo
from web_panels import style
from web_panels.panel import Look
from web_panels.style import legend

Items = tuple[tuple[str, str, str], ...]

VERDICTS: Items = (
    ("dot", "accepted", "accepted"),
    ("dot", "nomatch", "no match"),
    ("dot", "rejected", "rejected"),
    ("dot", "unselected", "not selected"),
    ("dot", "out", "out of view"),
)
NEW: Items = (("dot", "partial", "new"),)
NEW_AND_RAYS: Items = (("ray", "partial", "new; ray: depth open"),)
SELECTED: Items = (("ring", "white", "selected"),)
DEPTHS = {"lambda": "depth", "rho": "depth"}
"""What particles along a ray are labelled, in the word of the legend."""

PLACE_LEGEND = """(()=>{const id='scene-legend',m=document.getElementById('scene-legend-source');
let d=document.getElementById(id);if(!m)return;if(!d){d=document.createElement('div');d.id=id;
document.body.appendChild(d);const place=()=>{const c=window.__viserMutable&&
window.__viserMutable.canvas;if(!c)return;const r=c.getBoundingClientRect();
const narrow=window.innerWidth<700;d.style.left=r.left+'px';d.style.width=r.width+'px';
d.style.top=narrow?'6px':'auto';d.style.bottom=narrow?'auto':(window.innerHeight-r.bottom+10)+'px';
const s=narrow&&document.querySelector('.mantine-Paper-root[style*="bottom: 0px"]');
const up=s?Math.round((r.bottom-s.getBoundingClientRect().top-d.offsetHeight)/2):0;
const v=window.__viserMutable.camera,on=v.view&&v.view.enabled?v.view.offsetY:0;
if(up>0&&(up!==on||v.view.fullHeight!==r.height))v.setViewOffset(r.width,r.height,0,up,r.width,
r.height);else if(up<=0&&on)v.clearViewOffset();else return;
window.__viserMutable.requestRender()};
setInterval(place,300);place()}d.innerHTML=m.innerHTML})()"""
"""Copies the legend over the middle of the 3-D canvas, wherever the panels leave it. On a phone the
panels lie over the canvas: the map is moved up to what they leave of it."""


def confidence_words(look: Look, d: int) -> str:
    """95 % in 3-D = 2.80 sigma."""
    return f"{100 * look.confidence:g} % in {d}-D = {sigma(d, look.confidence):.2f} sigma"


def legend_of(p: Published, look: Look) -> str:
    """The legend of what an experiment shows on the map."""
    landmark = p.experiment.estimator.policies.landmark
    robots = [body_name(*body) for body in geo.bodies(p.experiment.estimator.robots)]
    return legend_html(
        look, landmark.space.d, robots, landmark.free_labels, rays=bool(landmark.unmeasured)
    )


def legend_html(
    look: Look,
    d: int,
    robots: Sequence[str] = (),
    free_labels: Sequence[str] = (),
    rays: bool = True,
) -> str:
    """The legend of the map, and the script that puts it there; of several bodies each has its
    colour, particles carry the `free_labels` of partial landmarks, others may begin as `rays`."""
    lines: Items = (("line", "truth", "truth"), ("line", "estimate", "estimate"))
    if len(robots) > 1:
        each = ((style.robot_key(i), style.escape(name)) for i, name in enumerate(robots))
        lines = (lines[0], *(("line", key, f"estimate of {name}") for key, name in each))
    if look.colour == "correlation":
        items: Items = (
            *lines,
            ("dot", "out", "correlation 0"),
            ("dot", "unselected", "1 with the selected"),
        )
    elif free_labels:
        free = dict.fromkeys(DEPTHS.get(label, label) for label in free_labels)
        words = f"grains: {style.escape(' and '.join(free))} open, coloured by verdict"
        new = NEW_AND_RAYS if "depth" in free else NEW
        items = (*lines, *VERDICTS, *new, ("grains", "ink", words), *SELECTED)
    else:
        items = (*lines, *VERDICTS, *(NEW_AND_RAYS if rays else NEW), *SELECTED)
    inner = (
        '<div class="e" style="text-align:center"><div class="maplegend">'
        f'{legend(items)}<span class="lg">ellipsoids {confidence_words(look, d)}</span></div></div>'
    )
    script = style.escape(PLACE_LEGEND)
    return (
        f'<div id="scene-legend-source" style="display:none">{inner}</div>'
        f'<img src="data:," style="display:none" onerror="{script}">'
    )
