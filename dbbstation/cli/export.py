"""`dbbstation export`: sessions as one tidy table, CSV or Parquet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import command
from dbbstation.cli.output import echo_line
from dbbstation.tasks.export import export as task

if TYPE_CHECKING:
    from dbbstation.results.exchange import ExportResult


def show(result: ExportResult) -> None:
    """Print the written file."""
    echo_line(f"{result.rows} rows of {result.runs} runs written to {result.table}")


export = command(task, show)
