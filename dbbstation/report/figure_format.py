"""A figure's bytes in the format that the name of its file asks for."""

from __future__ import annotations

import io
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.report.svg import as_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dbbstation.files.provenance import Provenance

PNG_DOTS_PER_INCH = 200
"""Sharp on paper at the figures' own size; a figure 10 inches wide has 2000 pixels."""


class FigureFormat(StrEnum):
    """Formats of figures, by the ending of the file."""

    SVG = ".svg"
    PNG = ".png"
    PDF = ".pdf"


@dataclass(frozen=True)
class Stamped:
    """A format together with where the figure comes from.

    Attributes:
        provenance: kept in the metadata of the file.
    """

    format: FigureFormat
    provenance: Provenance


def figure_format(wanted: object) -> FigureFormat | Stamped:
    """Return a format, also from the ending of a file's name, such as `.svg`."""
    return wanted if isinstance(wanted, Stamped) else FigureFormat(str(wanted))


def in_format(figure: Figure, wanted: FigureFormat | Stamped) -> bytes:
    """Return the figure's bytes: the same for the same figure and provenance, without a date.

    Args:
        wanted: format, with where the figure comes from; that goes into the metadata that the format has for it.
    """
    kind = wanted.format if isinstance(wanted, Stamped) else wanted
    metadata = _metadata(wanted.provenance, kind) if isinstance(wanted, Stamped) else {}
    if kind is FigureFormat.SVG:
        return as_svg(figure, metadata)
    out = io.BytesIO()
    if kind is FigureFormat.PNG:
        figure.savefig(out, format="png", dpi=PNG_DOTS_PER_INCH, metadata=metadata)
    else:
        figure.savefig(out, format="pdf", metadata={"CreationDate": None, **metadata})
    return out.getvalue()


def _metadata(provenance: Provenance, kind: FigureFormat) -> dict[str, object]:
    """Program, command and inputs under the names that each format has for them."""
    names = {
        FigureFormat.SVG: ("Creator", "Description"),  # Dublin Core, in RDF
        FigureFormat.PNG: ("Software", "Description"),  # text chunks of the PNG specification
        FigureFormat.PDF: ("Creator", "Subject"),  # the document information dictionary
    }[kind]
    return dict(zip(names, (provenance.program, provenance.text()), strict=True))
