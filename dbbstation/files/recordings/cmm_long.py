"""Convert sheets with a row per coordinate, as Calypso writes them, to a row per ball."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.errors import InputError, Problem
from dbbstation.files.formats.mapping import LENGTH, UNITS
from dbbstation.files.recordings.table_csv import NO_NUMBER, TableFile
from dbbstation.files.source_text import shortened

if TYPE_CHECKING:
    from collections.abc import Mapping

_BALL = ("featureid", "feature", "element", "ball", "name", "label", "merkmal", "id", "要素名")
_AXIS = ("axis", "achse", "idsymbol", "coordinate", "koordinate", "type", "characteristic", "property", "座標名")
_VALUE = ("actual", "ist", "istwert", "measured", "value", "messwert", "実測値", "測定値")
_UNIT = ("unit", "einheit")
AXES = ("x", "y", "z")
_AXIS_CELL = re.compile(
    r"(?:coord(?:inate)?[ ._-]*)?([xyz])(?:[ ._-]*(?:value|wert|coord(?:inate)?|position))?", re.IGNORECASE
)


def is_long(table: TableFile, columns: Mapping[str, str]) -> bool:
    """Return whether a table has columns of axes and values instead of x, y, z."""
    if {"x", "y"} & set(columns):
        return False
    return _axis_column(table, columns) is not None and _named(table, columns, "value", _VALUE) is not None


def wide(table: TableFile, columns: Mapping[str, str], unit: str) -> tuple[TableFile, dict[str, str]]:
    """Return the sheet with a row per ball, and its columns' roles.

    Rows of other characteristics, such as diameters, are left out.

    Args:
        columns: names by role: `ball`, `axis`, `value`, `unit`, `u`.
        unit: of values without a column of units.

    Raises:
        InputError: a coordinate is missing, given twice, not a number, or in an unknown unit.
    """
    axis_name, value_name = _axis_column(table, columns), _named(table, columns, "value", _VALUE)
    ball_name, unit_name = _named(table, columns, "ball", _BALL, but=axis_name), _named(table, columns, "unit", _UNIT)
    if axis_name is None or value_name is None or ball_name is None:
        what = "no column says which ball a row is"
        raise InputError.of(table.file, what, "name the column with --columns NAME=ball", line=table.header)
    faults: list[Problem] = []
    names = {"axis": axis_name, "value": value_name, "ball": ball_name, "unit": unit_name, "u": columns.get("u")}
    balls = _gathered(table, names, unit, faults)
    for ball, of in balls.items():
        missing = [axis for axis in AXES if axis not in of]
        if missing and not faults:
            line = next(iter(of.values())).line
            what = f"{ball} has no {', '.join(missing)}"
            faults.append(Problem(table.file, line, 0, what, "export all three coordinates"))
    if faults:
        raise InputError(faults)
    numbers = {axis: np.array([of[axis].value for of in balls.values()]) for axis in AXES}
    if "u" in columns:
        numbers |= {f"u{axis}": np.array([of[axis].u for of in balls.values()]) for axis in AXES}
    cells = {"ball": tuple(balls), **{name: tuple(map(str, of.tolist())) for name, of in numbers.items()}}
    lines = np.array([next(iter(of.values())).line for of in balls.values()], dtype=np.int64)
    values = {"ball": np.full(len(balls), np.nan), **numbers}
    turned = TableFile(table.file, table.header, tuple(cells), lines, cells, values)
    return turned, {name: name for name in cells}


class _Coordinate(NamedTuple):
    """One coordinate of a ball: line, value and uncertainty in the sheet's unit."""

    line: int
    value: float
    u: float


def _gathered(
    table: TableFile, names: Mapping[str, str | None], unit: str, faults: list[Problem]
) -> dict[str, dict[str, _Coordinate]]:
    balls: dict[str, dict[str, _Coordinate]] = {}
    for k, line in enumerate(table.lines.tolist()):
        of = {key: "" if name is None else table.cells[name][k] for key, name in names.items()}
        axis = _axis(of["axis"])
        if axis is None:
            continue
        found = balls.setdefault(of["ball"], {})
        value, row_unit = float(table.values[names["value"] or ""][k]), of["unit"].replace("um", "µm").replace("μ", "µ")

        def fault(key: str, what: str, remedy: str, line: int = line) -> None:
            column = table.names.index(names[key] or "") + 1
            faults.append(Problem(table.file, line, column, what, remedy))

        if names["unit"] is not None and row_unit not in UNITS[LENGTH]:
            fault("unit", f"`{shortened(row_unit)}` is no unit of a length", f"use one of {', '.join(UNITS[LENGTH])}")
        elif not np.isfinite(value):
            what = f"{names['value']} of {of['ball']} {axis} is `{shortened(of['value'])}`, not a finite number"
            fault("value", what, "correct the cell or remove the row")
        elif axis in found:
            fault("axis", f"{axis} of {of['ball']} is in the sheet a second time", "remove one of the rows")
        else:
            factor = UNITS[LENGTH][row_unit] / UNITS[LENGTH][unit] if row_unit else 1.0
            # A U has a unit of its own, or that of the sheet: the row's unit is the value's.
            u = np.nan if names["u"] is None else float(table.values[names["u"]][k])
            found[axis] = _Coordinate(line, factor * value, u)
    return balls


def _axis(cell: str) -> str | None:
    found = _AXIS_CELL.fullmatch(cell.strip().strip('"'))
    return found[1].lower() if found else None


def _axis_column(table: TableFile, columns: Mapping[str, str]) -> str | None:
    if "axis" in columns:
        return columns["axis"]
    found = [name for name in table.names if {_axis(cell) for cell in table.cells[name]} >= set(AXES)]
    known = [name for wanted in _AXIS for name in found if _plain(name) == wanted]
    return next(iter(known or found), None)


def _named(
    table: TableFile, columns: Mapping[str, str], key: str, known: tuple[str, ...], but: str | None = None
) -> str | None:
    if key in columns:
        return columns[key]
    for wanted in known:
        of = [name for name in table.names if _plain(name) == wanted and name != but]
        if len(of) == 1 and any(cell.lower() not in NO_NUMBER for cell in table.cells[of[0]]):
            return of[0]
    return None


def _plain(name: str) -> str:
    return re.split(r"[\s_\[(]", name.strip().lower())[0]
