"""`dbbstation report`: a session as one HTML file that anyone can read and print."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dbbstation.cli.declared import command
from dbbstation.cli.output import COVERAGE_FACTOR, echo, echo_line
from dbbstation.cli.shop import shop_settings
from dbbstation.tasks.report import report as task

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.results.report import ReportResult


def show(result: ReportResult) -> None:
    """Print the verdict, its reasons and advice."""
    verdict = result.verdict
    echo(result.certificate.title)
    echo(verdict.headline)
    for text in (*verdict.reasons, *verdict.to_do):
        echo_line(f"- {text}")


def _written(result: ReportResult) -> list[str]:
    return [f"report written to {result.report}", *([] if result.pdf is None else [f"printed to {result.pdf}"])]


def _of_the_shop() -> Mapping[str, object]:
    from dbbstation.cli.asking import Asker

    known = {"settings": shop_settings(), "coverage_factor": COVERAGE_FACTOR}
    given = click.get_current_context().params
    if given["certificate"] and not given["place"] and (asker := Asker()).terminal:
        return known | {"place": asker.text("where it was measured", "--place")}
    return known


report = command(task, show, remarks=_written, more=_of_the_shop)
