"""A screen with a help text, polled ten times a second."""

from __future__ import annotations

from typing import ClassVar

from textual.screen import Screen


class ExplainedScreen(Screen[None]):
    """A screen that F1 explains."""

    help_name: ClassVar[str] = ""
    """Name of its text in the help."""

    def look(self) -> None:
        """Show changes from other parts of the program."""
