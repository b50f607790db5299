"""Read ball centres from CMM sheets, CSV or DMIS, and make the jig file."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.errors import Faults, InputError, refuse
from dbbstation.files.formats.jig import BallSchema, JigFile, checked_jig, jig_text
from dbbstation.files.formats.mapping import LENGTH, UNITS
from dbbstation.files.recordings.dmis import Measured, read_dmis
from dbbstation.files.recordings.foreign_csv import read_foreign
from dbbstation.files.recordings.table_csv import NO_NUMBER, TableFile, missing_column
from dbbstation.files.source_text import shortened
from dbbstation.text.written import words

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.files.formats.number_language import NumberLanguage


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
    faults = Faults(table.file)
    names = {"axis": axis_name, "value": value_name, "ball": ball_name, "unit": unit_name, "u": columns.get("u")}
    balls = _gathered(table, names, unit, faults)
    for ball, of in balls.items():
        missing = [axis for axis in AXES if axis not in of]
        if missing and not faults:
            line = next(iter(of.values())).line
            faults.add(f"{ball} has no {', '.join(missing)}", "export all three coordinates", line)
    refuse(faults)
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
    table: TableFile, names: Mapping[str, str | None], unit: str, faults: Faults
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
            faults.add(what, remedy, line, table.names.index(names[key] or "") + 1)

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


DMIS_ENDINGS = (".dmo", ".dmi", ".dmis", ".out")


def read_sheet(
    path: Path,
    columns: Mapping[str, str],
    unit: str | None,
    coverage: float | None,
    *,
    of_one_holder: bool = False,
    u_unit: str | None = None,
    numbers: NumberLanguage | None = None,
    encoding: str | None = None,
) -> list[Measured]:
    """Read a sheet: DMIS by its extension, else a table.

    Args:
        columns: names by role: `ball`, `bore`, `holder`, `x`, `y`, `z`, `u` or `ux`, `uy`, `uz`; with a row per coordinate also
            `axis`, `value`, `unit`.
        unit: of coordinates; None: as the sheet states, else mm.
        of_one_holder: a bore alone identifies a ball.
        u_unit: of uncertainties; None: as the sheet states, else the coordinates' unit.
        numbers, encoding: of a table; None: as fits best.

    Raises:
        InputError: every fault of the file.
    """
    if path.suffix.lower() in DMIS_ENDINGS:
        return read_dmis(path)
    foreign = read_foreign(path, numbers, encoding)
    table = foreign.table
    given = columns.get("u") or columns.get("ux")
    u_said = u_unit or ("" if given is None else _said_unit(given, foreign.units))
    if is_long(table, columns):
        unit = unit or "mm"
        table, columns = wide(table, columns, unit)
    found = {**{key: name for key in _KEYS if (name := _usual(key, table)) is not None}, **columns}
    said = _said_unit(found.get("x", ""), foreign.units)
    if unit is not None and said and said != unit:
        what = f"the sheet says that {found['x']} is in {said}, and --unit says {unit}"
        raise InputError.of(path, what, "leave --unit out, or correct the sheet", line=table.header)
    unit = unit or said or "mm"
    missing = [key for key in ("x", "y") if key not in found]
    faults, header = Faults(path), table.header
    faults += [
        missing_column(name, table.names, faults.file, header) for name in found.values() if name not in table.names
    ]
    remedy = f"say which with --columns NAME={missing[0] if missing else 'x'}; columns here: {', '.join(table.names)}"
    for key in missing:
        faults.add(f"no column is known to be {key}", remedy, header)
    if "ball" not in found and not ({"bore"} if of_one_holder else {"bore", "holder"}) <= set(found):
        what = "no column says which ball a row is"
        faults.add(what, "name the column with --columns NAME=ball, or with bore and holder", header)
    of_u = [key for key in ("u", "ux", "uy", "uz") if key in found]
    if of_u and coverage is None:
        what = "the sheet has uncertainties, and nothing says what they are"
        faults.add(what, "give --coverage: 2 for U (k = 2), 1 for standard uncertainties", header)
    if not faults:
        for key in (*AXES, *of_u):
            faults += table.not_finite(found[key], "correct the cell or remove the row") if key in found else ()
    refuse(faults)
    factors = UNITS[LENGTH][unit], UNITS[LENGTH][u_said or unit]
    rows = [_row(table, k, found, factors, coverage) for k in range(len(table))]
    if not u_said:
        _check_like_a_cmm(rows, unit, faults)
    refuse(faults)
    return rows


def jig_of_sheet(
    before: JigFile,
    measured: Sequence[Measured],
    file: str,
    *,
    names: Mapping[str, str],
    uncertainty_um: float | None,
    cmm_temp_c: float | None,
) -> JigFile:
    """Return a jig with the balls of a sheet; plate and holders stay unchanged.

    Args:
        uncertainty_um: for balls without a stated one; None: refuse them.
        cmm_temp_c: of the plate; None if not known.

    Raises:
        InputError: a ball is unknown, given twice or without uncertainty, or the jig is invalid.
    """
    faults = Faults(file)
    balls: dict[str, BallSchema] = {}
    for one in measured:
        name = names.get(one.name) or _known_name(one, before)
        known = before.balls.get(name)
        bore, holder = (one.bore, one.holder) if known is None else (known.bore, known.holder)
        u_um = one.uncertainty_um if one.uncertainty_um is not None else uncertainty_um
        if not holder:
            remedy = f"say --names '{one.name}=BALL'; the jig has {', '.join(before.balls)}"
            faults.add(f"the jig has no ball `{name}`", remedy, one.line)
        elif name in balls:
            faults.add(f"the ball `{name}` is in the sheet a second time", "remove one of them", one.line)
        elif u_um is None:
            remedy = "give --u-um, the standard uncertainty of a coordinate, or name its column: --columns NAME=u"
            faults.add(f"nothing states an uncertainty of `{name}`", remedy, one.line)
        elif not all(map(math.isfinite, one.centre_mm)):
            faults.add(f"`{name}` has no z", "name the column: --columns NAME=z", one.line)
        else:
            x, y, z = (float(f"{value:.7f}") for value in one.centre_mm)  # 0.1 nm: no digits of the conversion
            balls[name] = BallSchema.model_construct(
                bore=bore, holder=holder, centre_mm=(x, y, z), uncertainty_um=float(f"{u_um:.6g}")
            )
    refuse(faults)
    plate = before.jig.model_copy(update={"cmm_temp_c": cmm_temp_c})
    return checked_jig(jig_text(before.model_copy(update={"jig": plate, "balls": balls})), file)


_KEYS = ("ball", "bore", "holder", *AXES, "u", "ux", "uy", "uz")
_NAMES = {
    "ball": {"ball", "name", "label", "feature", "id", "kugel", "要素名"},
    "holder": {"holder", "halter"},
    "bore": {"bore", "bohrung"},
}
_MEASURED = {"actual", "act", "ist", "istwert", "meas", "measured", "gemessen", "実測値", "測定値"}
_NOT_MEASURED = set(
    words("nominal, nom, soll, sollwert, target, 基準値, 設計値, u, dev, deviation, abweichung, tol, tolerance")
)
"""Words that, beside an axis, mark a column as no measured coordinate. Programs use `U` and `u` differently, so the user must name uncertainty columns."""


def _usual(key: str, table: TableFile) -> str | None:
    """Return the column whose name means this role, such as `X`, `x_mm` or `X Ist [mm]`; `U(x) [µm]` is not guessed."""
    if key.startswith("u"):
        return None
    wanted = _NAMES.get(key, {key})
    words = {name: [word for word in re.split(r"[\W_]+", name.lower()) if word] for name in table.names}
    first = [name for name, of in words.items() if of[:1] and of[0] in wanted]
    found = first if key not in AXES else [name for name, of in words.items() if wanted & set(of)]
    found = [name for name in found if not _NOT_MEASURED & set(words[name])]
    stated = [name for name in found if _MEASURED & set(words[name])]
    return next((names[0] for names in (stated, found) if len(names) == 1), None)


LIKE_A_CMM_UM = (0.01, 100.0)
"""Range of a CMM's standard uncertainty of a ball's centre [µm]; values outside indicate another, unstated unit."""


def _check_like_a_cmm(rows: Sequence[Measured], unit: str, faults: Faults) -> None:
    low, high = LIKE_A_CMM_UM
    for one in rows:
        if one.uncertainty_um and not low <= one.uncertainty_um <= high:
            what = f"the standard uncertainty of {one.name or one.bore} would be {one.uncertainty_um:.3g} µm, if it were in {unit} like its coordinates"
            faults.add(what, "state the unit of uncertainties: --u-unit µm", one.line)


def _said_unit(name: str, units: Mapping[str, str]) -> str:
    """Return a column's unit, written below its name, in brackets or at the name's end; else empty."""
    for text in (units.get(name, ""), *re.findall(r"[\[(]\s*([^\])]*?)\s*[\])]", name), name.rpartition("_")[2]):
        plain = text.strip(" []()").lower().replace("μ", "µ")
        known = {"um": "µm", "in": "inch", "uinch": "µinch", "uin": "µinch"}.get(plain, plain)
        if known in UNITS[LENGTH]:
            return known
    return ""


def _row(
    table: TableFile, k: int, found: Mapping[str, str], factors: tuple[float, float], coverage: float | None
) -> Measured:
    factor, u_factor = factors

    def text(key: str) -> str:
        return table.cells[found[key]][k] if key in found else ""

    def number(key: str) -> float:
        each = u_factor if key.startswith("u") else factor
        return each * float(table.values[found[key]][k]) if key in found else math.nan

    of_axes = [number(key) for key in ("ux", "uy", "uz") if key in found] or [number("u")]
    u_mm = math.sqrt(sum(one**2 for one in of_axes) / len(of_axes))
    u_um = None if math.isnan(u_mm) or coverage is None else 1e3 * u_mm / coverage
    bore = int(text("bore")) if text("bore").isdigit() else None
    centre = (number("x"), number("y"), number("z"))
    return Measured(text("ball"), bore, text("holder"), centre, u_um, int(table.lines[k]))


def _known_name(one: Measured, jig: JigFile) -> str:
    plain = {name.lower().replace("_", "-"): name for name in jig.balls}
    if one.name:
        return plain.get(one.name.lower().replace("_", "-"), one.name)
    placed = [name for name, ball in jig.balls.items() if (ball.bore, ball.holder) == (one.bore, one.holder)]
    return placed[0] if placed else f"{one.bore}-{one.holder}"
