"""`dbbstation program`: NC programs of a plan's circles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import command
from dbbstation.cli.programs import print_programs
from dbbstation.tasks.circle_programs import program as task

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.results.programs import ProgramsResult


def show(result: ProgramsResult, out: Path) -> None:
    """Print the written programs."""
    from dbbstation.cli.output import say

    print_programs(result)
    say(f"{len(result.programs)} programs written to {out}, all within the machine's travel")


program = command(task, show)
