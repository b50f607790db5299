"""`dbbstation study`: reproducible experiments of a checkout."""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING

from dbbstation.cli.lazy import LazyGroup
from dbbstation.errors import StationError
from dbbstation.files.shipped import checkout

if TYPE_CHECKING:
    from collections.abc import Mapping

    import click


class StudyGroup(LazyGroup):
    """The studies of the checkout; a wheel has none and says so."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the study.

        Raises:
            StationError: this installation has no studies.
        """
        if not STUDIES:
            raise StationError(
                f"study {args[0]}: the studies are not part of the installed package",
                remedy="get the source of dbbstation and run there: python3 dev.py run study " + " ".join(args),
            )
        return super().resolve_command(ctx, args)


def _studies() -> Mapping[str, str]:
    root = checkout()
    if root is None:
        return {}
    # Before anything else of this name that the folder of the caller may hold.
    sys.path.insert(0, str(root))
    table: Mapping[str, str] = importlib.import_module("studies.commands").STUDIES
    return table


STUDIES = _studies()

study = StudyGroup(
    name="study",
    table=STUDIES,
    package="studies.commands",
    help="""Repeat an experiment from a seed to its numbers and its figure.

The studies are part of the source, not of the installed package.

\b
Examples:
  dbbstation study concealed-gravity --figure concealed.svg
  dbbstation study coverage --machines 500
  dbbstation study table-iii --help
""",
)
