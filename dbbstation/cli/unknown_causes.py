"""What every command says of a model that keeps an error whose cause nobody knows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import say

if TYPE_CHECKING:
    from dbbstation.model.machine_model import MachineModel


def say_unknown_causes(model: MachineModel) -> None:
    """Say that the cause is unknown, for each of them."""
    from dbbstation.results.prediction import unknown_cause_notes

    for note in unknown_cause_notes(model):
        say(f"note: {note}")
