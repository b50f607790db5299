"""`--figure FILE` of a study."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.output import known_format

if TYPE_CHECKING:
    from collections.abc import Callable


def figure_option(what: str = "Write a figure here") -> Callable[[Any], Any]:
    """Give a command this option as a path or None."""
    return click.option(
        "--figure",
        type=click.Path(path_type=Path, dir_okay=False),
        callback=_known,
        help=f"{what}, as SVG, PNG or PDF by the ending of its name.",
    )


def _known(_context: click.Context, _option: click.Parameter, path: Path | None) -> Path | None:
    try:
        return None if path is None else known_format(path)
    except ValueError as error:
        raise click.BadParameter(str(error)) from None
