"""What the screen shows gives the terminal no orders: a machine's name, a reason, what an instrument says."""

from __future__ import annotations

from typing import cast

from rich import control
from textual import content

from dbbstation.text.printable import TEXT


def show_controls() -> None:
    """Let Textual and Rich show control characters.

    Each has a table of five that it takes out of every text; escape, with which orders begin, is in neither. Textual is pinned
    to one release, and a test holds that its table still counts.
    """
    for table in (content._CONTROL_STRIP_TRANSLATE, control._CONTROL_STRIP_TRANSLATE):  # noqa: SLF001 (no other way in)
        cast("dict[int, str]", table).update(TEXT)
