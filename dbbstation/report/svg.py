"""Write reproducible SVG with only the visible digits."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.figure import Figure

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
