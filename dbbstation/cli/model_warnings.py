"""What every command says first of a model that lacks physics, or has causes that are not decided or unknown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import say

if TYPE_CHECKING:
    from dbbstation.model.identified import IdentifiedModel


def say_model_warnings(identified: IdentifiedModel) -> None:
    """Say what speaks against a model, one line each."""
    from dbbstation.results.model_warnings import model_warnings

    for warning in model_warnings(identified):
        say(f"note: {warning}")
