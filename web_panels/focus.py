"""Gives the keyboard back to the page after a click.

A tab, a tick or a list that was clicked keeps the focus: Space would then act on it, or
be typed into it, instead of playing. A script lets go of them after a click with a pointer; whoever
walks through the page by Tab keeps the focus where it is.
"""

from __future__ import annotations

from web_panels.style import escape

LET_GO = """(()=>{if(window.sceneFocus)return;window.sceneFocus=1;
const held='[role=tab],input[type=checkbox]';let pointed=false;
const letGo=on=>setTimeout(()=>{if(on===document.activeElement)on.blur()},0);
window.addEventListener('keydown',e=>{if(e.key==='Tab')pointed=false},true);
window.addEventListener('pointerdown',()=>{pointed=true},true);
window.addEventListener('focusin',e=>{if(pointed&&e.target.matches(held))letGo(e.target)},true);
window.addEventListener('click',e=>{const chose=e.target.closest('[role=option]');
if(pointed)setTimeout(()=>{const on=document.activeElement;
if(chose||on.matches(held))on.blur()},50)},true)})()"""


def focus_html() -> str:
    """The script, for `add_html`."""
    return f'<img alt="" src="data:," style="display:none" onerror="{escape(LET_GO)}">'
