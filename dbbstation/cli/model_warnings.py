"""Warnings of a model, printed first by every command."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import say

if TYPE_CHECKING:
    from dbbstation.model.identified import IdentifiedModel


def say_model_warnings(identified: IdentifiedModel) -> None:
    """Print a model's warnings, one line each."""
    from dbbstation.results.model_warnings import model_warnings

    for warning in model_warnings(identified):
        say(f"note: {warning}")
