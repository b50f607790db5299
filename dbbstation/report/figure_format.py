"""Drawings of a result: bytes by file extension, a figure, or one panel in given Axes."""

from __future__ import annotations

import io
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from dbbstation.files.provenance import VIRTUAL
from dbbstation.report.svg import as_svg
from dbbstation.results.panel import OnePanel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dbbstation.files.provenance import Provenance

PNG_DOTS_PER_INCH = 200
"""Resolution that is sharp on paper at the figures' own size; a figure 10 inches wide has 2000 pixels."""


class FigureFormat(StrEnum):
    """Formats by extension."""

    SVG = ".svg"
    PNG = ".png"
    PDF = ".pdf"


@dataclass(frozen=True)
class Stamped:
    """A format with provenance."""

    format: FigureFormat
    provenance: Provenance


Wanted = FigureFormat | Stamped | OnePanel | None
"""The wanted output: bytes in a format, one panel, or with None the figure itself."""


def figure_format(wanted: object) -> Wanted:
    """Return a format; an extension such as `.svg` is converted."""
    return wanted if wanted is None or isinstance(wanted, Stamped | OnePanel) else FigureFormat(str(wanted))


def in_format(figure: Figure, wanted: Wanted) -> Any:  # noqa: ANN401 - bytes or the figure
    """Return the figure's bytes, reproducible and without date; without a format return the figure itself."""
    if wanted is None or isinstance(wanted, OnePanel):
        return figure
    kind = wanted.format if isinstance(wanted, Stamped) else wanted
    if isinstance(wanted, Stamped) and wanted.provenance.virtual:
        figure.text(0.005, 0.995, VIRTUAL, va="top", color="#d55e00", weight="bold", fontsize=8)
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
    names = {
        FigureFormat.SVG: ("Creator", "Description"),  # Dublin Core, in RDF
        FigureFormat.PNG: ("Software", "Description"),  # text chunks of the PNG specification
        FigureFormat.PDF: ("Creator", "Subject"),  # the document information dictionary
    }[kind]
    return dict(zip(names, (provenance.program, provenance.text()), strict=True))
