"""`dbbstation simulate`: noise-free recordings of a plan, as a model predicts them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import CommandOutput, command
from dbbstation.tasks.simulate import simulate as task

if TYPE_CHECKING:
    from dbbstation.results.sessions import SimulatedSession


def show(result: SimulatedSession) -> None:
    """Print what was written."""
    from dbbstation.cli.output import say

    say(f"{result.runs} runs written to {result.session}")


simulate = command(task, show, CommandOutput("out", "SESSION", folder=True, required=True, field="session"))
