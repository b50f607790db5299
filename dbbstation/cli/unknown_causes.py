"""What every command says of a model that keeps an error whose cause nobody knows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import say

if TYPE_CHECKING:
    from dbbstation.model.machine_model import MachineModel


def unknown_causes(model: MachineModel) -> list[str]:
    """Names of the sources of a model that describe an error without a cause."""
    own = model.of_the_machine().sources
    return [fitted.source.name for fitted in own if not fitted.source.candidate and fitted.values.any()]


def say_unknown_causes(model: MachineModel) -> None:
    """Say that the cause is unknown, for each of them."""
    for name in unknown_causes(model):
        say(
            f"note: the model has {name}, an error whose cause is unknown; it holds where it was measured, while it lasts"
        )
