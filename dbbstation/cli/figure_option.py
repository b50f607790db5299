"""Figures in the format of their extension."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.provenance import provenance

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.report.figure_format import Stamped


def format_of(path: Path) -> Stamped:
    """Return the format of a path with its provenance."""
    from dbbstation.report.figure_format import FigureFormat, Stamped

    return Stamped(FigureFormat(path.suffix.lower()), provenance())


def known_format(path: Path) -> Path:
    """Return a path after checking its extension, before any work.

    Raises:
        ValueError: the name ends otherwise.
    """
    from dbbstation.report.figure_format import FigureFormat

    if path.suffix.lower() not in set(FigureFormat):
        ending = f"`{path.suffix}` is no format of figures" if path.suffix else f"`{path.name}` has no ending"
        raise ValueError(f"{ending}; let the name end in {', '.join(FigureFormat)}")
    return path
