"""Read measured points from a CMM's output in DMIS [ISO 22093]: `FA(NAME)=FEAT/SPHERE,OUTER,CART,x,y,z,d` and `FEAT/POINT,CART,x,y,z,i,j,k`.

The module reads actual features (`FA`) in cartesian coordinates, `UNITS/`, comments (`$$`) and lines continued by `$`.
The statements follow manuals of CMM programs (PTC Creo, Supported DMIS Commands); the standard's text was not
available.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.errors import Faults, refuse
from dbbstation.files.source_text import LARGEST_SHEET, shortened, text_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_MM = {"MM": 1.0, "CM": 10.0, "M": 1000.0, "INCH": 25.4, "FEET": 304.8}
_ACTUAL = re.compile(r"FA\(\s*([^()]+?)\s*\)\s*=\s*FEAT\s*/\s*(.*)", re.IGNORECASE)
_FRAME = re.compile(r"(D\(.*\)\s*=\s*)?(DATSET|TRANS|ROTATE|RECALL|LOCATE)\s*/", re.IGNORECASE)


@dataclass(frozen=True)
class Measured:
    """One ball of a sheet.

    Attributes:
        name: empty if the sheet gives only bore and holder.
        bore: None if not stated.
        holder: empty if not stated.
        centre_mm: x, y, z; z is NaN if not stated.
        uncertainty_um: standard uncertainty, rms over the axes; None if not stated.
    """

    name: str
    bore: int | None
    holder: str
    centre_mm: tuple[float, float, float]
    uncertainty_um: float | None
    line: int


def read_dmis(path: Path) -> list[Measured]:
    """Read the actual spheres and points of a DMIS output.

    Raises:
        InputError: it cannot be read, has no features, no unit, polar coordinates, or several frames.
    """
    text = text_of(path, LARGEST_SHEET)
    faults = Faults(path)
    found: list[Measured] = []
    factor, frame = 0.0, 0
    for line, statement in _statements(text):
        unit = re.match(r"UNITS\s*/\s*(\w+)", statement, re.IGNORECASE)
        actual = _ACTUAL.match(statement)
        if unit:
            factor = _MM.get(unit[1].upper(), 0.0)
            if not factor:
                faults.add(f"`{unit[1]}` is no unit", f"known: {', '.join(_MM)}", line)
        elif _FRAME.match(statement) and found:
            frame = frame or line
        elif actual and actual[2].split(",")[0].strip().upper() in {"SPHERE", "POINT"}:
            if frame:
                what = f"the frame was set anew in line {frame}, between measured features: they have no common frame"
                faults.add(what, "output all features in the frame of the jig", line)
                break
            point = _point(actual[1], actual[2], factor, line, faults)
            found += [] if point is None else [point]
    if found and not factor:
        faults.add("no unit is stated", "the file needs a statement such as UNITS/MM,ANGDEC")
    if not found and not faults:
        what = "there is no measured sphere or point: no `FA(NAME)=FEAT/SPHERE` or `FEAT/POINT`"
        faults.add(what, "output actual features; `F(NAME)` are nominal ones")
    refuse(faults)
    return found


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Return statements with their first line numbers; comments are removed and continued lines joined."""
    first, parts = 0, list[str]()
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.partition("$$")[0].strip()
        first = first if parts else number
        parts.append(line.removesuffix("$").strip())
        if not line.endswith("$"):
            whole = "".join(parts)
            parts = []
            if whole:
                yield first, whole


def _point(name: str, said: str, factor: float, line: int, faults: Faults) -> Measured | None:
    cells = [cell.strip() for cell in said.split(",")]
    words = [cell.upper() for cell in cells]
    if "CART" not in words:
        faults.add(f"{name} is not in cartesian coordinates", "output it with CART", line)
        return None
    after = cells[words.index("CART") + 1 :][:3]
    try:
        x, y, z = (float(cell) * factor for cell in after)
    except ValueError:
        faults.add(f"{name}: `{shortened(', '.join(after))}` are not three numbers", "check the line", line)
        return None
    return Measured(name, None, "", (x, y, z), None, line)
