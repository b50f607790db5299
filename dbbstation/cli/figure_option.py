"""`--figure FILE`: a figure in the format of its extension."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.provenance import provenance

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.report.figure_format import Stamped

_Function = TypeVar("_Function", bound="Callable[..., Any]")


def figure_option(
    what: str = "Write a figure here", name: str = "--figure", *, required: bool = False
) -> Callable[[_Function], _Function]:
    """Give a command this option as a path or None."""
    return click.option(
        name,
        required=required,
        type=click.Path(path_type=Path, dir_okay=False),
        callback=known_format,
        help=f"{what}, as SVG, PNG or PDF by the ending of its name.",
    )


def format_of(path: Path) -> Stamped:
    """Return the format of a path with its provenance."""
    from dbbstation.report.figure_format import FigureFormat, Stamped

    return Stamped(FigureFormat(path.suffix.lower()), provenance())


def known_format(_context: click.Context, _option: click.Parameter, path: Path | None) -> Path | None:
    """Refuse other extensions before any work.

    Raises:
        click.BadParameter: the name ends otherwise.
    """
    from dbbstation.report.figure_format import FigureFormat

    if path is not None and path.suffix.lower() not in set(FigureFormat):
        ending = f"`{path.suffix}` is no format of figures" if path.suffix else f"`{path.name}` has no ending"
        raise click.BadParameter(f"{ending}; let the name end in {', '.join(FigureFormat)}")
    return path
