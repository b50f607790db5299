"""A mark before the chosen row, for terminals without colours."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual.widgets import OptionList

CURSOR = "▸ "
"""Text before the chosen row."""


def mark_chosen(options: OptionList, rows: Sequence[Content]) -> None:
    """Show rows with the mark before the chosen row."""
    for place, row in enumerate(rows[: options.option_count]):
        mark = CURSOR if place == options.highlighted else " " * len(CURSOR)
        options.replace_option_prompt_at_index(place, Content(mark) + row)
