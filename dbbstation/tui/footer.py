"""The footer with the keys of a screen, composed anew only when the keys change."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.widgets import Footer

if TYPE_CHECKING:
    from textual.screen import Screen


class KeyFooter(Footer):
    """A footer without the command palette; Textual's own composes all keys anew at every change of focus."""

    def __init__(self) -> None:
        super().__init__(show_command_palette=False)
        self._keys: list[object] | None = None

    def bindings_changed(self, screen: Screen[object]) -> None:
        if screen.app.app_focus and self.is_attached and screen is self.screen:
            keys: list[object] = [key[1:] for key in screen.active_bindings.values() if key.binding.show]
            if keys == self._keys:
                return
            self._keys = keys
        super().bindings_changed(screen)
