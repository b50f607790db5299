"""Read tables of measured and simulated values, for command and studies."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import average_of, largest_size, range_of, sum_of
from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.units import PLAIN, Meaning, meaning_of, stated_meaning
from dbbstation.errors import MOST_FAULTS, ArgumentError, Faults, InputError, Problem, refuse
from dbbstation.files.recordings.table_csv import TableFile, given_table, read_table
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.triangle import left_by

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.files.formats.number_language import NumberLanguage
    from dbbstation.files.recordings.table_csv import Columns

FEWEST_ROWS = 30
"""Least number of rows of a comparison: fewer do not determine a curve of seven functions in noise."""

DERIVATIVE = "d_"
"""First characters of columns with the derivative of the simulated value by a parameter."""

ROWS = "rows"
"""Value of the option for the time if rows are in the order of measurement and no column has the time."""

SAME = 1e-10
"""Residual share of a column's variance, after a straight line in measured and simulated value, below which it is one
of these values."""

MOST_RESETS = 30
"""Least average number of rows per run, if each restart of the clock begins a run."""


@dataclass(frozen=True, eq=False)
class TableOptions:
    """Options for reading the files.

    Attributes:
        variables: meaning by name of columns that the difference may follow; None: all suitable ones.
        time: column of time, `ROWS` for row order; None: guess.
        numbers: notation; None: decimal point and the header's most frequent separator.
        known: prior standard uncertainty of parameters, by name.
    """

    measured: str
    simulated: str
    variables: Mapping[str, Meaning | None] | None = None
    run: str | None = None
    time: str | None = None
    numbers: NumberLanguage | None = None
    known: Mapping[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    has_offset: bool = True


@dataclass(frozen=True, eq=False)
class Tabulated:
    """The content of the files as a table."""

    table: Table
    names: tuple[str, ...]
    columns: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...]


RESULT = "result"
"""Marks a driven variable."""


def stated_variables(
    given: str | Mapping[str, Meaning | str | None] | Sequence[str],
) -> dict[str, Meaning | None] | None:
    """Return variables from an option (`q1=deg,temperature,torque=N m:result`), a mapping or names; None to guess.

    Raises:
        ArgumentError: an unknown unit or kind.
    """
    found: dict[str, Meaning | None] = {}
    if isinstance(given, Mapping):
        found = {name: one for name, one in given.items() if not isinstance(one, str)}
        parts = [f"{name}={one}" for name, one in given.items() if isinstance(one, str)]
    else:
        parts = given.split(",") if isinstance(given, str) else list(given)
    for part in (part.strip() for part in parts):
        what, marked, result = (piece.strip() for piece in part.partition(":"))
        name, has, unit = (piece.strip() for piece in what.partition("="))
        meaning = stated_meaning(unit) if has else None
        if marked and result == RESULT and (meaning or not has):
            meaning = replace(meaning or meaning_of(name), driven=True)
        elif marked:
            name = ""
        if not name or (has and meaning is None):
            remedy = f"a unit such as mm, deg, s, degC, N, or one of {', '.join(Kind)}"
            raise ArgumentError(
                "variables", f"`{part}` is not understood", f"write NAME, NAME=UNIT or NAME=UNIT:{RESULT}, {remedy}"
            )
        found[name] = meaning
    return found or None


def stated_uncertainties(given: str | Mapping[str, float]) -> dict[str, float]:
    """Return standard uncertainties from an option (`mass=0.2,stiffness=300`) or a mapping.

    Raises:
        ArgumentError: one that is no positive number.
    """
    found: dict[str, float] = {}
    parts = [f"{name}={u!r}" for name, u in given.items()] if isinstance(given, Mapping) else given.split(",")
    for part in (part.strip() for part in parts):
        name, _, number = (piece.strip() for piece in part.partition("="))
        try:
            found[name] = float(number)
        except ValueError:
            found[name] = np.nan
        if not name or not 0.0 < found[name] < np.inf:
            remedy = "write NAME=U, U a positive number in the unit of the parameter"
            raise ArgumentError("known", f"`{part}` is not understood", remedy)
    return found


def load_tables(tables: Sequence[Path | Columns], asked: TableOptions) -> Tabulated:
    """Read tables, or convert columns as `given_table` does, and join them.

    Raises:
        InputError: every fault with its line; different units of measured and simulated values; too few rows.
    """
    needed = [asked.measured, asked.simulated, *(asked.variables or ())]
    needed += [name for name in (asked.run, asked.time) if name is not None and name != ROWS]
    faults = Faults(tables[0] if isinstance(tables[0], Path) else "table 1")
    files: list[TableFile] = []
    for number, one in enumerate(tables, start=1):
        try:
            files.append(
                read_table(one, needed, asked.numbers)
                if isinstance(one, Path)
                else given_table(one, needed, f"table {number}")
            )
        except InputError as error:
            faults += error.problems
    units = {name: meaning_of(name).unit for name in (asked.measured, asked.simulated)}
    if len({unit for unit in units.values() if unit}) > 1:
        said = " and ".join(f"`{name}` in {unit}" for name, unit in units.items())
        faults.add(f"{said} cannot be compared", "give both in the same unit")
    if asked.measured == asked.simulated:
        what = f"`{asked.measured}` is named for measured and for simulated values"
        faults.add(what, "name the column of the simulation")
    certain = [asked.measured, asked.simulated, *(asked.variables or ())]
    faults += [fault for file in files for name in dict.fromkeys(certain) for fault in file.faults_of(name)]
    faults += [fault for file in files for fault in _faults_of_size(file, certain if asked.variables else file.names)]
    faults += _faults_of_scale(files, asked)
    refuse(faults[:MOST_FAULTS])
    return _Reader(files, asked, units[asked.measured] or units[asked.simulated]).read()


def load_rows(tables: Sequence[Path | Columns], asked: TableOptions, like: Table) -> Tabulated:
    """Read other rows with the columns of a table; they need no measured values.

    Raises:
        InputError: a column is missing, or no row has all values.
    """
    clock = like.clock.name if like.clock is not None else None
    derivatives = {name: f"{DERIVATIVE}{name}" for name in like.derivatives}
    needed = [asked.simulated, *(v.name for v in like.variables), *derivatives.values(), *filter(None, [asked.run])]
    files = [
        read_table(one, needed, asked.numbers) if isinstance(one, Path) else given_table(one, needed) for one in tables
    ]
    reader = _Reader(files, asked, like.unit)
    rows, blocks, names = reader.order([name for name in needed if name != asked.run], clock)
    if not len(rows):
        raise InputError.of(files[0].file, "no row has all values", "fill them in", line=files[0].header)
    kept = {name: column[rows] for name, column in reader.values.items()}
    variables = tuple(replace(v, values=kept[v.name], range=(v.low, v.high)) for v in like.variables)
    table = replace(
        like,
        measured=kept.get(asked.measured, np.full(len(rows), np.nan)),
        simulated=kept[asked.simulated],
        variables=variables,
        derivatives={name: kept[column] for name, column in derivatives.items()},
        columns=kept,
        blocks=blocks,
        names=names,
        clock=next((v for v in variables if v.name == clock), None),
        like=like,
    )
    return reader.tabulated(table, rows)


LARGEST_SIZE = 1e60
"""Greatest number that is compared; its inverse is the least beside 0. Real quantities are within this range, and their
fourth powers fit into a double."""

LARGEST_RATIO = 1e6
"""Greatest ratio of measured to simulated values, or of simulated to measured ones: nanometres to millimetres. With a
greater ratio, the difference has no digits of the smaller value."""


def _faults_of_size(file: TableFile, names: Sequence[str]) -> Faults:
    faults = Faults(file.file)
    for name in dict.fromkeys(names):
        size = np.abs(np.nan_to_num(file.values[name], nan=0.0, posinf=0.0, neginf=0.0))
        row = int(size.argmax())
        if size[row] > LARGEST_SIZE or 0.0 < size[row] < 1.0 / LARGEST_SIZE:
            what = (
                f"{name} goes up to {size[row]:g}, sizes from {1.0 / LARGEST_SIZE:g} to {LARGEST_SIZE:g} are compared"
            )
            faults.add(what, "check the column and its unit", int(file.lines[row]))
    return faults


def _faults_of_scale(files: Sequence[TableFile], asked: TableOptions) -> list[Problem]:
    greatest = {name: _greatest(files, name) for name in (asked.measured, asked.simulated)}
    less, more = min(greatest, key=lambda name: greatest[name]), max(greatest, key=lambda name: greatest[name])
    if greatest[less] == 0.0 or greatest[more] <= LARGEST_RATIO * greatest[less]:
        return []
    what = (
        f"`{more}` goes up to {greatest[more]:g}, `{less}` to {greatest[less]:g}: these are no values of one quantity"
    )
    return [Problem.of(files[0].file, what, "give both in the same unit", files[0].header)]


def _greatest(files: Sequence[TableFile], name: str) -> float:
    columns = [file.values[name] for file in files if name in file.values]
    return max((float(np.abs(column[np.isfinite(column)]).max(initial=0.0)) for column in columns), default=0.0)


class _Reader:
    def __init__(self, files: Sequence[TableFile], asked: TableOptions, unit: str) -> None:
        self._files, self._asked, self._unit = files, asked, unit
        self.notes: list[str] = []
        shared = set(files[0].names).intersection(*(file.names for file in files))
        self.names = [name for name in files[0].names if name in shared]
        elsewhere = dict.fromkeys(name for file in files for name in file.names if name not in shared)
        if elsewhere:
            self.notes.append(f"not in every file and left out: {', '.join(elsewhere)}")

    @cached_property
    def values(self) -> dict[str, Floats]:
        """Return the columns that all files have, by name."""
        return {name: np.concatenate([file.values[name] for file in self._files]) for name in self.names}

    def tabulated(self, table: Table, rows: Integers) -> Tabulated:
        """Return a table with the texts of its rows, and the notes."""
        cells = {name: [cell for file in self._files for cell in file.cells[name]] for name in self.names}
        texts = {name: tuple(column[k] for k in rows.tolist()) for name, column in cells.items()}
        return Tabulated(table, tuple(self.names), texts, tuple(self.notes))

    def read(self) -> Tabulated:
        """Return the table."""
        asked, chosen, derivatives = self._asked, self._chosen(), self._derivatives()
        clock = self._clock(chosen)
        used = [asked.measured, asked.simulated, *chosen, *derivatives, *([clock] if clock else [])]
        rows, blocks, names = self.order(used, clock)
        if len(rows) < FEWEST_ROWS:
            file = self._files[0]
            what = f"{len(rows)} rows with all values are too few to compare, {FEWEST_ROWS} are needed"
            raise InputError.of(file.file, what, "record more", line=file.header)
        kept = {name: column[rows] for name, column in self.values.items()}
        self._refuse_constant(kept[asked.measured], kept[asked.simulated])
        variables = [self._variable(name, kept[name]) for name in chosen]
        varying = [v for v in variables if v is not None and not self._is_the_difference(v, kept)]
        at = self._variable(clock, kept[clock], quiet=True) if clock else None
        self._note_order(clock, at, blocks)
        others = self._once([v for v in varying if clock is None or v.name != clock])
        table = Table(
            measured=kept[asked.measured],
            simulated=kept[asked.simulated],
            unit=self._unit,
            simulated_name=asked.simulated,
            variables=tuple([at, *others] if at is not None else others),
            derivatives={name.removeprefix(DERIVATIVE): kept[name] for name in derivatives if kept[name].any()},
            columns={name: column for name, column in kept.items() if np.isfinite(column).all()},
            blocks=blocks,
            names=names,
            clock=at,
            in_row_order=asked.time == ROWS,
            known=asked.known,
            free=frozenset(asked.free),
            has_offset=asked.has_offset,
        )
        self._refuse_unknown(table)
        return self.tabulated(table, rows)

    def _note_order(self, clock: str | None, at: Variable | None, blocks: Sequence[slice]) -> None:
        if clock is not None and at is None:
            self.notes.append(
                f"`{clock}` is the same in all rows: their order is unknown; give --time rows if they are in order"
            )
        elif at is not None and (still := sum(int(np.sum(np.diff(at.values[own]) == 0.0)) for own in blocks)):
            self.notes.append(
                f"`{clock}` stands still in {still} rows: delays, memories and integrals are not compared"
            )
        if self._asked.run is not None and len(blocks) == 1:
            self.notes.append(f"`{self._asked.run}` has one run only: no other run tests what is found")

    def _refuse_unknown(self, table: Table) -> None:
        there = ", ".join(table.derivatives) or "none"
        remedy = f"name parameters of columns {DERIVATIVE}NAME, here: {there}"
        stated = [("--known", name) for name in self._asked.known] + [("--free", name) for name in self._asked.free]
        faults = [
            Problem.of(option, f"`{name}` is no parameter of this table", remedy)
            for option, name in stated
            if name not in table.derivatives
        ]
        both = sorted(set(self._asked.known) & set(self._asked.free))
        faults += [Problem.of("--free", f"`{name}` is also stated with --known", "give it once") for name in both]
        refuse(faults)

    def _derivatives(self) -> list[str]:
        found = [name for name in self.names if name.startswith(DERIVATIVE) and len(name) > len(DERIVATIVE)]
        return [name for name in found if self._is_numeric(name)]

    def _chosen(self) -> list[str]:
        asked = self._asked
        if asked.variables is not None:
            return list(asked.variables)
        taken = {asked.measured, asked.simulated, asked.run}
        others = [name for name in self.names if name not in taken and not name.startswith(DERIVATIVE)]
        siblings = [name for name in others if self._is_another_pair(name)]
        if siblings:
            self.notes.append(f"measured or simulated themselves and left out: {', '.join(siblings)}")
        return [name for name in others if name not in siblings and self._is_numeric(name)]

    def _is_another_pair(self, name: str) -> bool:
        """Return whether a column's name shows that it belongs to another pair of measured and simulated values."""
        measured, simulated = (set(_words(one)) for one in (self._asked.measured, self._asked.simulated))
        marks = (measured - simulated, simulated - measured)
        words = _words(name)
        for own, other in (marks, marks[::-1]):
            if own & set(words) and len(other) == 1:
                partner = [next(iter(other)) if word in own else word for word in words]
                if any(_words(one) == partner for one in self.names if one != name):
                    return True
        return False

    def _refuse_constant(self, measured: Floats, simulated: Floats) -> None:
        """Refuse a constant measured value, or a constant difference; rounding is no noise."""
        apart, what = measured - simulated, f"`{self._asked.measured}`"
        if np.ptp(measured) > 0.0:
            rounding = 8.0 * np.spacing(max(largest_size(measured), largest_size(simulated)))
            if range_of(apart) > rounding:
                return
            what += f" less `{self._asked.simulated}`"
        else:
            apart = measured
        file, size = self._files[0], f"{average_of(apart):.6g} {self._unit}".strip()
        what += f" is {size} in every row: no difference is left to explain"
        raise InputError.of(file.file, what, "check that these are the columns that you mean", line=file.header)

    def _is_numeric(self, name: str) -> bool:
        bad = sum(len(file.faults_of(name)) for file in self._files)
        if all(file.is_text(name) for file in self._files):
            self.notes.append(f"`{name}` has no numbers and is left out")
            return False
        column = self.values[name]
        missing = int((~np.isfinite(column)).sum())
        if bad or missing > len(column) // 10:
            first = next((fault for file in self._files for fault in file.faults_of(name)), None)
            where = f", the first in line {first.line} of {first.file}" if first else ""
            self.notes.append(f"`{name}` lacks a number in {missing} of {len(column)} rows{where}, and is left out")
            return False
        return True

    def _clock(self, chosen: Sequence[str]) -> str | None:
        asked = self._asked
        if asked.time is not None:
            return None if asked.time == ROWS else asked.time
        return next((name for name in chosen if self._meaning(name).kind is Kind.TIME), None)

    def order(self, used: Sequence[str], clock: str | None) -> tuple[Integers, tuple[slice, ...], tuple[str, ...]]:
        """Return the complete rows in time order within each block, the blocks, and their names."""
        values = self.values
        good = np.all([np.isfinite(values[name]) for name in dict.fromkeys(used)], axis=0)
        if not good.all():
            self.notes.append(f"{int((~good).sum())} of {len(good)} rows lack a number and are left out")
        order: list[Integers] = []
        names: list[str] = []
        first = 0
        sorted_blocks = 0
        for file in self._files:
            for name, own in self._runs(file):
                rows = first + own
                rows = rows[good[rows]]
                if not len(rows):
                    continue
                parts = [rows] if clock is None else _by_clock(rows, values[clock])
                for k, part in enumerate(parts):
                    if clock is not None and np.any(np.diff(values[clock][part]) < 0.0):
                        sorted_blocks += 1
                        part = part[np.argsort(values[clock][part], kind="stable")]  # noqa: PLW2901 - put in order
                    order.append(part)
                    names.append(f"{name} part {k + 1}" if len(parts) > 1 else name)
            first += len(file)
        if sorted_blocks:
            self.notes.append(f"rows were put in the order of `{clock}`")
        ends = np.cumsum([0, *(len(part) for part in order)])
        blocks = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        return np.concatenate([np.zeros(0, dtype=np.int64), *order]), blocks, tuple(names)

    def _runs(self, file: TableFile) -> list[tuple[str, Integers]]:
        stem = re.sub(r"^.*[/\\]", "", file.file)
        if self._asked.run is None:
            return [(stem, np.arange(len(file)))]
        cells = file.cells[self._asked.run]
        several = len(self._files) > 1
        return [
            (f"{stem} {label}" if several else label, np.flatnonzero([cell == label for cell in cells]))
            for label in dict.fromkeys(cells)
        ]

    def _meaning(self, name: str) -> Meaning:
        stated = (self._asked.variables or {}).get(name)
        found = stated or meaning_of(name)
        if any(name in file.instants for file in self._files):
            return Meaning("s", Kind.TIME)
        return Meaning(found.unit, Kind.TIME) if name == self._asked.time else found

    def _variable(self, name: str, values: Floats, *, quiet: bool = False) -> Variable | None:
        meaning = self._meaning(name)
        if np.ptp(values) == 0.0:
            if not quiet:
                self.notes.append(f"`{name}` is the same in all rows and is left out")
            return None
        known = meaning if meaning.unit or meaning.kind is not Kind.ANY else PLAIN
        return Variable(name, known.unit, known.kind, values, known.period, meaning.driven)

    def _once(self, variables: Sequence[Variable]) -> list[Variable]:
        kept: list[Variable] = []
        for variable in variables:
            same = next((one for one in kept if _is_a_line(one.values, variable.values)), None)
            if same is None:
                kept.append(variable)
                continue
            scaled = "" if np.array_equal(same.values, variable.values) else ", but for scale and origin,"
            self.notes.append(f"`{variable.name}` has the values of `{same.name}` in all rows{scaled} and is left out")
        return kept

    def _is_the_difference(self, variable: Variable, kept: Mapping[str, Floats]) -> bool:
        """Return whether measured and simulated values together give a column, and simulated values alone do not."""
        asked = self._asked
        both = np.column_stack([np.ones(len(variable.values)), kept[asked.simulated], kept[asked.measured]])
        alone, beside = (sum_of(np.square(left_by(columns, variable.values))) for columns in (both[:, :2], both))
        whole = SAME * sum_of((variable.values - variable.values.mean()) ** 2)
        if alone <= whole or beside > whole:
            return False
        self.notes.append(f"`{variable.name}` is measured and simulated value over again, and is left out")
        return True


def _is_a_line(one: Floats, other: Floats) -> bool:
    """Return whether columns are equal except for scale and origin, so that no effect separates them."""
    if np.array_equal(one, other):
        return True
    a, b = (column - column.mean() for column in (one, other))
    left = b - a * float(a @ b) / float(a @ a)
    return largest_size(left) <= ROUNDED * largest_size(b)


ROUNDED = 1e-9
"""Largest relative departure of a column from a line in another column that counts as equal."""


def _by_clock(rows: Integers, clock: Floats) -> list[Integers]:
    back = np.flatnonzero(np.diff(clock[rows]) < 0.0) + 1
    if len(back) and len(rows) >= MOST_RESETS * (len(back) + 1):
        return np.split(rows, back)
    return [rows]


def _words(name: str) -> list[str]:
    return [word for word in re.split(r"[^A-Za-z0-9µ]+", name.lower()) if word]
