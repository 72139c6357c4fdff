"""Gives a number box that was left empty, or with half a number, its last number back.

The browser tells nobody of what is no number, and what is in force equals the last one it was
told: nothing the server could send would fill such a box again.
"""

from __future__ import annotations

from web_panels.style import escape

REFILL = """(()=>{if(window.sceneBoxes)return;window.sceneBoxes=1;const last=new WeakMap();
const set=Object.getOwnPropertyDescriptor(HTMLInputElement.prototype,'value').set;
const box=e=>e.target.matches&&e.target.matches('.mantine-NumberInput-input');
const whole=t=>t.value.trim()!==''&&Number.isFinite(Number(t.value));
const keep=e=>{if(box(e)&&whole(e.target))last.set(e.target,e.target.value)};
window.addEventListener('focusin',keep,true);window.addEventListener('beforeinput',keep,true);
window.addEventListener('focusout',e=>{const t=e.target;if(box(e))setTimeout(()=>{
if(whole(t)||!last.has(t))return;set.call(t,last.get(t));
t.dispatchEvent(new Event('input',{bubbles:true}));
t.dispatchEvent(new FocusEvent('focusout',{bubbles:true}))},0)},true)})()"""
"""The box is left once more after that, so that the browser keeps it within its limits."""


def boxes_html() -> str:
    """The script, for `add_html`."""
    return f'<img alt="" src="data:," style="display:none" onerror="{escape(REFILL)}">'
