"""Show control characters in texts instead of executing them."""

from __future__ import annotations

from typing import cast

from rich import control
from textual import content

from dbbstation.text.printable import TEXT


def show_controls() -> None:
    """Let Textual and Rich show control characters."""
    for table in (content._CONTROL_STRIP_TRANSLATE, control._CONTROL_STRIP_TRANSLATE):  # noqa: SLF001 (no other way in)
        cast("dict[int, str]", table).update(TEXT)
