"""A figure's bytes in the format that the name of its file asks for."""

from __future__ import annotations

import io
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.report.svg import as_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PNG_DOTS_PER_INCH = 200
"""Sharp on paper at the figures' own size; a figure 10 inches wide has 2000 pixels."""


class FigureFormat(StrEnum):
    """Formats of figures, by the ending of the file."""

    SVG = ".svg"
    PNG = ".png"
    PDF = ".pdf"


def in_format(figure: Figure, wanted: FigureFormat) -> bytes:
    """Return the figure's bytes: the same for the same figure, without a date."""
    if wanted is FigureFormat.SVG:
        return as_svg(figure)
    out = io.BytesIO()
    if wanted is FigureFormat.PNG:
        figure.savefig(out, format="png", dpi=PNG_DOTS_PER_INCH)
    else:
        figure.savefig(out, format="pdf", metadata={"CreationDate": None})
    return out.getvalue()
