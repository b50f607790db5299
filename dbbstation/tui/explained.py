"""A screen that has a help text of its own, and whatever every such screen does ten times a second."""

from __future__ import annotations

from typing import ClassVar

from textual.screen import Screen


class ExplainedScreen(Screen[None]):
    """A screen that F1 explains."""

    help_name: ClassVar[str] = ""
    """Under which the texts of help have it."""

    def look(self) -> None:
        """Take in what has changed elsewhere."""
