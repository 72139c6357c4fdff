"""Marks the elements of viser's page that the style sheet is about.

`:has()` in the style sheet would find them too, but makes the browser work out the style of the
whole page again after every change of it: a fifth of the time of its one thread while a run plays.
"""

from __future__ import annotations

from web_panels.style import escape

TAG = """(()=>{if(window.sceneTags)return;const all=s=>document.querySelectorAll(s);
const mark=(on,name)=>{if(on&&!on.hasAttribute(name))on.setAttribute(name,'')};
const tag=window.sceneTags=()=>{
for(const b of all('div>div>.mantine-Button-root[data-block]')){
mark(b.parentElement,'data-half');mark(b.parentElement.parentElement,'data-halves')}
for(const r of all('.mantine-ScrollArea-content .mantine-ScrollArea-root'))
mark(r.parentElement.closest('.mantine-ScrollArea-content'),'data-scrolls');
for(const l of all('p>label')){mark(l.parentElement,'data-label');
if(l.closest('.mantine-Flex-root>div')===l.parentElement.parentElement)
mark(l.parentElement.parentElement,'data-labelled')}
for(const n of all('.mantine-Flex-root>.mantine-NumberInput-root:nth-child(3)'))
mark(n.parentElement,'data-triple')};
const own=n=>n.nodeType!==1||n.matches('.e,style,img,svg');
new MutationObserver(news=>{for(const {target,addedNodes} of news)
if(addedNodes.length&&![...addedNodes].every(own)&&!target.closest('.e')){tag();return}
}).observe(document.body,{childList:true,subtree:true});tag()})()"""
"""Before the next picture, once an element came that is not part of our own markup."""


def tags_html() -> str:
    """The script, for `add_html`."""
    return f'<img alt="" src="data:," style="display:none" onerror="{escape(TAG)}">'
