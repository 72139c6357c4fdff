"""The button that forgets the selected feature."""

from __future__ import annotations

import viser

from scene_core.session.commands import DeleteFeature
from scene_core.session.published import Published
from web_panels.panel import Post
from web_panels.widgets import on_press

HELP = (
    "Forget this landmark at the end of the frame: its block leaves the state and every sensor "
    "forgets it; what it has taught the rest stays. Undo brings it back."
)


class DeleteSelected:
    """A button that is there while a feature of the map is selected."""

    def __init__(self, gui: viser.GuiApi, post: Post) -> None:
        self.post = post
        self.label: int | None = None
        self.button = gui.add_button(
            "Delete feature", icon=viser.Icon.TRASH, color="gray", hint=HELP, visible=False
        )
        on_press(self.button, self._pressed)

    def _pressed(self, _: viser.ClientHandle) -> None:
        if self.label is not None:
            self.post(DeleteFeature(self.label))

    def render(self, p: Published) -> None:
        label = deletable(p)
        if label == self.label:
            return
        self.label = label
        if label is not None:
            self.button.label = f"Delete feature {label}"
        self.button.visible = label is not None


def deletable(p: Published) -> int | None:
    """The selected feature if it is in the map; a marker is there as long as its robot."""
    if p.trace is None or p.selected is None:
        return None
    feature = p.trace.world.features.get(p.selected)
    return None if feature is None or feature.carrier else feature.label
