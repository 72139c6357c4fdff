"""How often a browser draws the map: as often as it can, and never at the cost of the page.

A browser without a graphics card needs a tenth of a second and more for one picture of the map, and
all that time nothing else reaches the screen: neither the answer to a key nor the camera's image.
The script lets such a browser rest after each picture for as long as the picture took. The messages
are still applied as they come, so the next picture shows the latest; one that takes less than
`SLOW_MS` is never held back. While the view is turned by hand every picture counts; when a control
of the page is used, a slow map waits until the answer has been shown.
"""

from __future__ import annotations

from web_panels.style import escape

SLOW_MS = 40
"""A picture of the map that takes longer is followed by a rest, ms."""
LONGEST_REST_MS = 400
ANSWER_MS = 300
"""How long a slow map waits after a key or a click elsewhere in the page; twice the longest rest at
most, while a slider is being dragged."""

PACE = (
    """(()=>{if(window.scenePace)return;
const pace=window.scenePace={cost:0,drawn:0,skipped:0,free:false};
let due=0,answer=0,started=0,fence=null,timer=0,size='',held=false;
const later=ms=>{if(!timer)timer=setTimeout(()=>{timer=0;const m=window.__viserMutable;
if(m)m.requestRender()},Math.max(ms,1))};
const finish=gl=>{if(!fence)return;if(gl.isContextLost()){fence=null;return}
if(gl.getSyncParameter(fence,gl.SYNC_STATUS)!==gl.SIGNALED){setTimeout(finish,8,gl);return}
gl.deleteSync(fence);fence=null;const now=performance.now(),took=now-started;
pace.cost=pace.cost?0.7*pace.cost+0.3*took:took;
due=took>SLOW?now+Math.min(took,LONGEST):0};
const wrap=r=>{if(r.scenePaced)return;r.scenePaced=true;const draw=r.render.bind(r);
r.render=(scene,camera)=>{const m=window.__viserMutable;
if(!m||scene!==m.scene||r.getRenderTarget())return draw(scene,camera);
const now=performance.now(),c=r.domElement,shape=c.width+'x'+c.height;
const busy=fence&&(pace.cost>SLOW||now-started>SLOW);
const rest=pace.cost>SLOW?Math.max(due,Math.min(answer,started+2*LONGEST)):due;
if(!pace.free&&shape===size&&(busy||(now<rest&&!held))){
pace.skipped++;later(busy?16:rest-now);return}
size=shape;pace.drawn++;draw(scene,camera);if(fence)return;
const gl=r.getContext();started=now;fence=gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE,0);
gl.flush();setTimeout(finish,8,gl)}};
window.addEventListener('pointerdown',e=>{const m=window.__viserMutable;
held=!!m&&e.target===m.canvas},true);
for(const up of['pointerup','pointercancel'])window.addEventListener(up,()=>{held=false},true);
for(const use of['keydown','pointerdown','input'])window.addEventListener(use,e=>{
const on=e.target;
if(on.closest&&on.closest('input,textarea,button,[role]'))answer=performance.now()+ANSWER},true);
const watch=()=>{const m=window.__viserMutable;if(m&&m.scene)m.scene.onAfterRender=wrap};
setInterval(watch,300);watch()})()""".replace("SLOW", str(SLOW_MS))
    .replace("LONGEST", str(LONGEST_REST_MS))
    .replace("ANSWER", str(ANSWER_MS))
)
"""Stands between viser and its renderer, once in each page. `scenePace` tells how long
a picture takes and how many were drawn; nothing is held back while its `free` is set."""


def pace_html() -> str:
    """The script, for `add_html`."""
    return f'<img src="data:," style="display:none" onerror="{escape(PACE)}">'
