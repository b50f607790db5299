"""Drawings of a result: bytes by file extension, a figure, or one panel in given Axes; SVG is reproducible."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from dbbstation.files.provenance import VIRTUAL
from dbbstation.results.frame import OnePanel

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.figure import Figure

    from dbbstation.files.provenance import Provenance

_PATH = re.compile(rb' d="([^"]*)"')
_POLYGON = re.compile(rb"[\s\d.e+MLz-]*")
_FURTHER_DIGITS = re.compile(rb"(\.\d\d)\d+")
_FRAME = re.compile(rb"\bp[0-9a-f]{10}\b")
_INDENT = re.compile(rb"\n\s+")
_NOT_TURNED = re.compile(rb' transform="rotate\(-?0 [^"]*\)"')
_PLACED = re.compile(rb"<(?:text|use) [^>]*>")
_PLACE = re.compile(rb' (?:[xy]="[^"]*"|transform="(?:rotate|translate)\([^"]*")')
_NUMBER = re.compile(rb"-?\d+\.\d+")


def as_svg(figure: Figure, metadata: Mapping[str, Any] | None = None) -> bytes:
    """Return a figure as reproducible SVG.

    Args:
        metadata: Dublin Core names for Matplotlib.
    """
    out = io.BytesIO()
    figure.savefig(out, format="svg", metadata={"Date": None, **(metadata or {})})
    drawn = _PATH.sub(lambda path: b' d="' + _shorter(path[1]) + b'"', out.getvalue())
    drawn = _INDENT.sub(b"\n", _NOT_TURNED.sub(b"", drawn))
    drawn = _PLACED.sub(lambda tag: _PLACE.sub(lambda at: _NUMBER.sub(_rounded, at.group()), tag.group()), drawn)
    number = {name: k for k, name in enumerate(dict.fromkeys(_FRAME.findall(drawn)))}
    return _FRAME.sub(lambda frame: f"frame{number[frame.group()]}".encode(), drawn)


def _rounded(number: re.Match[bytes]) -> bytes:
    return _text(round(10 * float(number.group()))).encode()


def _shorter(path: bytes) -> bytes:
    if not _POLYGON.fullmatch(path):
        return _FURTHER_DIGITS.sub(rb"\1", path)
    return "".join(_steps(path.decode().split())).replace(" -", "-").encode()


def _steps(words: list[str]) -> Iterator[str]:
    at, before, k = (0, 0), "", 0
    while k < len(words):
        command = words[k]
        if command == "z":
            yield "z"
            before, k = command, k + 1
            continue
        there = (round(10 * float(words[k + 1])), round(10 * float(words[k + 2])))
        if command == "M":
            yield f"M{_text(there[0])} {_text(there[1])}"
        elif there != at or before == "M":
            yield f"{' ' if before == 'L' else 'l'}{_text(there[0] - at[0])} {_text(there[1] - at[1])}"
        else:
            command = before
        at, before, k = there, command, k + 3


def _text(tenths: int) -> str:
    return re.sub(r"^(-?)0\.", r"\1.", f"{tenths / 10:g}")


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
