"""From foreign tables to the runs of a plan: which run each row belongs to, units, angles in the machine, times."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import InputError, Problem
from dbbstation.files.formats.mapping import (
    ANGLE,
    DEVIATION,
    DIRECTION,
    LENGTH,
    MOUNTING,
    OF_RUNS,
    REPEAT,
    STARTED,
    STATE,
    TEST,
    TIME,
    UNITS,
    in_run_units,
)
from dbbstation.files.recordings.entries import RunState, count_in
from dbbstation.files.recordings.new_session import FinishedRun
from dbbstation.files.recordings.table_csv import MOST_FAULTS
from dbbstation.plan.circle import Circle, Direction
from dbbstation.tasks.importing.travel import (
    UnusableTravelError,
    check_span,
    machine_angles,
    rises,
    travel,
    unplanned_span_deg,
)
from dbbstation.trace import columns

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.files.formats.mapping import MappingFile
    from dbbstation.files.recordings.foreign_csv import ForeignTable
    from dbbstation.plan.plan import Plan

WORDS = {
    **dict.fromkeys(("ccw", "anticlockwise", "counterclockwise", "counter-clockwise", "+"), Direction.CCW),
    **dict.fromkeys(("cw", "clockwise", "-"), Direction.CW),
}
"""Directions as people write them."""


@dataclass(frozen=True)
class RunName:
    """Which run a file is, as far as somebody said it.

    Attributes:
        test: of the plan; empty where not said.
        direction: None where not said.
        repeat: None: the next.
    """

    test: str = ""
    direction: Direction | None = None
    repeat: int | None = None


@dataclass(frozen=True, eq=False)
class ImportedRun:
    """A run as it will be written.

    Attributes:
        file: that it comes from.
        run: what is written.
        circle: as the plan has it.
        computed: what the file did not say and was computed, in words.
    """

    file: str
    run: FinishedRun
    circle: Circle
    computed: tuple[str, ...]

    @property
    def name(self) -> str:
        """Such as `a-ccw-1`."""
        return f"{self.run.test}-{self.run.direction}-{self.run.repeat}"


@dataclass
class Reader:
    """Turns tables into runs, one after the other, and gathers every fault.

    Args:
        mapping: what the columns mean.
        plan: whose circles were run.
        faults: grows.
        left_out: grows: runs that are not taken, and why.
    """

    mapping: MappingFile
    plan: Plan
    faults: list[Problem] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    _taken: set[tuple[str, Direction, int]] = field(default_factory=set)

    def read(self, table: ForeignTable, told: RunName) -> list[ImportedRun]:
        """Return the runs of a table.

        Args:
            table: one file.
            told: which run it is where its rows do not say that.
        """
        file = table.table.file
        unmapped = [name for name in table.table.names if name not in self.mapping.columns]
        missing = [name for name in self.mapping.columns if name not in table.table.names]
        for name in unmapped:
            self._fault(file, table.table.header, f"the mapping does not say what the column `{name}` is", _SAY_IT)
        for name in missing:
            what = f"there is no column `{name}`, which the mapping names"
            self._fault(file, table.table.header, what, f"columns here: {', '.join(table.table.names)}")
        if unmapped or missing:
            return []
        found = []
        for rows, said in self._groups(table):
            if said.get(STATE) == RunState.RECORDING:
                name = "-".join(said.get(key, "") for key in (TEST, DIRECTION, REPEAT))
                self.left_out.append(f"run {name} was broken off where it was measured and is left out")
                continue
            run = self._run(table, rows, said, told)
            if run is not None:
                found.append(run)
        return found

    def check(self) -> None:
        """Refuse what was found.

        Raises:
            InputError: the faults so far.
        """
        if self.faults:
            raise InputError(self.faults[:MOST_FAULTS])

    def _groups(self, table: ForeignTable) -> list[tuple[NDArray[np.int64], dict[str, str]]]:
        """Rows of each run, with what its columns say of it."""
        of_runs = {m: name for m in OF_RUNS if (name := self.mapping.column(m)) is not None}
        cells = [table.table.cells[name] for name in of_runs.values()]
        if not cells:
            return [(np.arange(len(table.table)), {})]
        keys = list(zip(*cells, strict=True))
        rows: dict[tuple[str, ...], list[int]] = {}
        for k, key in enumerate(keys):
            rows.setdefault(key, []).append(k)
        return [(np.array(each), dict(zip(of_runs, key, strict=True))) for key, each in rows.items()]

    def _run(
        self, table: ForeignTable, rows: NDArray[np.int64], said: Mapping[str, str], told: RunName
    ) -> ImportedRun | None:
        file, line = table.table.file, int(table.table.lines[rows[0]])
        before = len(self.faults)
        values = self._values(table, rows)
        if len(self.faults) > before:
            return None
        computed: list[str] = []
        name = self._named(table, said, told, line)
        angle = values.pop(ANGLE, None)
        if name.test not in self.plan.tests:
            what = f"the plan has no test {name.test}" if name.test else "nothing says which test of the plan this is"
            self._fault(file, line, what, f"its tests: {', '.join(self.plan.tests)}; say --run FILE=TEST-DIRECTION")
            return None
        direction = name.direction
        if direction is None and angle is not None and self.mapping.angle and self.mapping.angle.grows != "travel":
            grows = Direction(self.mapping.angle.grows)
            direction = grows if rises(angle) else next(one for one in Direction if one is not grows)
            computed.append(f"direction {direction}: the angles say it")
        planned = self.plan.tests[name.test]
        if direction is None or direction not in planned.directions:
            what = (
                "nothing says which direction this is"
                if direction is None
                else f"the plan has no {name.test} {direction}"
            )
            self._fault(file, line, what, f"say --run FILE={name.test}-ccw or -cw")
            return None
        circle = planned.run(direction)
        try:
            said_angle = self.mapping.angle
            theta = None if angle is None or said_angle is None else machine_angles(angle, said_angle, circle)
            if theta is not None and said_angle is not None:
                computed += check_span(theta, said_angle.span_deg, circle)
            travelled = travel(values.pop(TIME, None), theta, circle, self.mapping.trace)
        except UnusableTravelError as error:
            self._fault(file, line, error.what, error.remedy)
            return None
        length = values.pop(LENGTH) if LENGTH in values else float(self.mapping.zero_mm or 0.0) + values.pop(DEVIATION)
        kept = {columns.TIME: travelled.t_s, columns.LENGTH: length[travelled.rows]}
        if travelled.theta_deg is not None:
            kept[columns.THETA] = travelled.theta_deg
        kept |= {name: column[travelled.rows] for name, column in values.items()}
        status = self.mapping.column(columns.STATUS)
        cells = () if status is None else table.table.cells[status]
        texts = {} if status is None else {columns.STATUS: tuple(cells[k] for k in rows[travelled.rows].tolist())}
        state = self._state(said.get(STATE, ""), file, line)
        run = FinishedRun(
            test=name.test,
            direction=direction,
            columns=kept,
            repeat=self._repeat(name, direction, file, line),
            mounting=count_in(said.get(MOUNTING, "")) or None,
            started=self._moment(said.get(STARTED, ""), file, line),
            state=state,
            reason="rejected where it was measured" if state is RunState.REJECTED else "",
            texts=texts,
            exact=True,
        )
        return ImportedRun(file, run, circle, (*computed, *travelled.computed))

    def _values(self, table: ForeignTable, rows: NDArray[np.int64]) -> dict[str, NDArray[np.float64]]:
        """Numbers in units of a run file by meaning, shape (n,); a column that is empty in all rows of the run is left out."""
        found = {}
        for name, column in self.mapping.columns.items():
            if column.means not in UNITS or column.unit is None:
                continue
            numbers = table.table.values[name][rows]
            bad = np.flatnonzero(~np.isfinite(numbers))
            needed = column.means in {LENGTH, DEVIATION}
            if len(bad) == len(rows) and not needed and not any(table.table.cells[name][k] for k in rows.tolist()):
                continue
            for k in rows[bad][:MOST_FAULTS].tolist():
                what = f"{name} is `{table.table.cells[name][k]}`, not a finite number"
                self._fault(
                    table.table.file, int(table.table.lines[k]), what, f"correct the cell; {table.language.text}"
                )
            factor, offset = in_run_units(column.means, column.unit)
            found[column.means] = numbers if factor == 1.0 and offset == 0.0 else numbers * factor + offset
        return found

    def _named(self, table: ForeignTable, said: Mapping[str, str], told: RunName, line: int) -> RunName:
        """Which run it is: as the command line says, else columns, lines above the table, the file's name."""
        file = PurePath(table.table.file).stem
        pattern = named_by(self.mapping.file_name, file) if self.mapping.file_name else {}
        sources = (
            said,
            {key: table.comments[key] for key in (TEST, DIRECTION, REPEAT) if key in table.comments},
            pattern,
        )

        def first(key: str) -> str:
            return next((source[key] for source in sources if source.get(key)), "")

        word = first(DIRECTION)
        direction = told.direction or self.direction(word)
        if direction is None and word:
            what = f"`{word}` is no direction that is known"
            self._fault(table.table.file, line, what, "say in the mapping: `words: {" + word + ": ccw}`, or cw")
        return RunName(told.test or first(TEST), direction, told.repeat or count_in(first(REPEAT)))

    def asked_span_deg(self, table: ForeignTable) -> float | None:
        """Return the span of a file's angles that is surely not the plan's: that of none of its circles; None where it may be [deg].

        A table with columns that tell its runs apart has several, which are looked at when they are read.
        """
        name = self.mapping.column(ANGLE)
        if (
            name is None
            or any(self.mapping.column(one) is not None for one in OF_RUNS)
            or name not in table.table.values
        ):
            return None
        factor, offset = in_run_units(ANGLE, self.mapping.columns[name].unit or "deg")
        angle = table.table.values[name] * factor + offset
        if not np.all(np.isfinite(angle)):
            return None
        spans = [
            unplanned_span_deg(angle, test.run(direction))
            for test in self.plan.tests.values()
            for direction in test.directions
        ]
        return next(iter(spans), None) if all(span is not None for span in spans) else None

    def says_test(self, table: ForeignTable) -> bool:
        """Whether a file says itself which test and direction it is."""
        if self.mapping.column(TEST) is not None:
            return True
        name = self._named(table, {}, RunName(), table.table.header)
        turns = self.mapping.angle is not None and self.mapping.angle.grows != "travel"
        return name.test in self.plan.tests and (turns or name.direction is not None)

    def direction(self, word: str) -> Direction | None:
        """Return the direction that a word means; None where it means none."""
        by_mapping = {key.lower(): Direction(value) for key, value in self.mapping.words.items()}
        return {**WORDS, **by_mapping}.get(word.strip().lower())

    def _repeat(self, name: RunName, direction: Direction, file: str, line: int) -> int:
        repeat = name.repeat
        if repeat is None:
            repeat = 1
            while (name.test, direction, repeat) in self._taken:
                repeat += 1
        if (name.test, direction, repeat) in self._taken:
            self._fault(
                file, line, f"run {name.test}-{direction}-{repeat} comes a second time", "give it another repeat"
            )
        self._taken.add((name.test, direction, repeat))
        return repeat

    def _state(self, text: str, file: str, line: int) -> RunState:
        """State of a run: accepted where nothing is said."""
        if text and text not in set(RunState):
            self._fault(file, line, f"`{text}` is no state of a run", f"use one of {', '.join(_STATES)}")
        return RunState(text) if text in _STATES else RunState.ACCEPTED

    def _moment(self, text: str, file: str, line: int) -> datetime | None:
        if not text:
            return None
        try:
            moment = datetime.fromisoformat(text)
        except ValueError:
            moment = None
        if moment is None or moment.tzinfo is None:
            what = f"`{text}` is no time with its zone"
            self._fault(file, line, what, "expected such as 2026-11-20T08:04:11Z, or ignore the column")
            return None
        return moment

    def _fault(self, file: str, line: int, what: str, remedy: str) -> None:
        self.faults.append(Problem(file, line, 0, what, remedy))


def named_by(pattern: str, stem: str) -> dict[str, str]:
    """Return what the name of a file says under a pattern such as `{test}_{direction}`; empty where it does not fit."""
    parts = re.split(r"\{(test|direction|repeat)\}", pattern)
    fields = {
        TEST: r"(?P<test>[A-Za-z0-9][A-Za-z0-9.]*?)",
        DIRECTION: r"(?P<direction>[^\W\d_]+)",
        REPEAT: r"(?P<repeat>\d+)",
    }
    expression = "".join(fields[part] if k % 2 else re.escape(part) for k, part in enumerate(parts))
    try:
        found = re.fullmatch(expression, stem)
    except re.error:  # one field twice
        found = None
    return {} if found is None else found.groupdict()


def run_name(text: str, known: Sequence[str]) -> RunName | None:
    """Return which run `a`, `a-ccw` or `a-ccw-2` is; None where it is none.

    Args:
        text: as typed.
        known: tests of the plan, whose names may have hyphens.
    """
    test = max((name for name in known if text == name or text.startswith(f"{name}-")), key=len, default=None)
    if test is None:
        return None
    direction, _, repeat = text.removeprefix(test).removeprefix("-").partition("-")
    if not direction:
        return RunName(test)
    if direction not in set(Direction) or (repeat and not count_in(repeat)):
        return None
    return RunName(test, Direction(direction), count_in(repeat))


_STATES = (RunState.ACCEPTED, RunState.REJECTED, RunState.COMPLETE)
_SAY_IT = "add it to the mapping, as `ignored` where it does not matter"
