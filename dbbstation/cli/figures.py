"""The table of circles before and after, as [CAL Table III] has it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.output import print_table

if TYPE_CHECKING:
    from collections.abc import Mapping


def print_runs(summary: Mapping[str, Any]) -> None:
    """Print centre deviation, mean radial error and circularity of every run, before and after."""
    click.echo("             centre deviation     mean radial error         circularity      [µm]")
    titles = ["test", "dir", "n", "before", "after", " before", " after", "  before", "  after"]
    rows = []
    for run in summary["runs"]:
        pairs = [
            run[when][figure]
            for figure in ("centre_deviation_um", "mean_radial_error_um", "circularity_um")
            for when in ("before", "after")
        ]
        rows.append([run["test"], run["direction"], run["repeat"], *pairs])
    print_table(titles, rows)
