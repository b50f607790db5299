"""Convert foreign tables to runs of a plan, with units, angles and times."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import count
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.grouped import grouped
from dbbstation.errors import MOST_FAULTS, InputError, Problem
from dbbstation.files.formats.mapping import (
    ANGLE,
    DEVIATION,
    DIRECTION,
    LENGTH,
    MOUNTING,
    OF_RUNS,
    REPEAT,
    RUN,
    STARTED,
    STATE,
    TEST,
    TIME,
    UNITS,
    in_run_units,
)
from dbbstation.files.formats.session import RunState
from dbbstation.files.recordings.event_log import impossible_day
from dbbstation.files.recordings.new_session import FinishedRun
from dbbstation.files.recordings.run_csv import count_in
from dbbstation.plan.plan import Direction
from dbbstation.tasks.importing.moments import UnclearMomentError, moment_of
from dbbstation.tasks.importing.names import WORDS, RunName, named_by, run_name
from dbbstation.tasks.importing.plausible import centre_mm, chance_of_centres, check_units
from dbbstation.tasks.importing.splitting import (
    held_over_gaps,
    longest_pause_s,
    parts_by_direction,
    parts_by_gaps,
    samples_of,
)
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

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.files.formats.mapping import MappingFile
    from dbbstation.files.recordings.foreign_csv import ForeignTable
    from dbbstation.plan.plan import Plan


@dataclass(frozen=True, eq=False)
class ImportedRun:
    """A run that is ready to be written."""

    file: str
    run: FinishedRun
    computed: tuple[str, ...]


@dataclass
class Reader:
    """Converts tables to runs and collects every fault.

    Args:
        trusted: doubtful properties to accept: `unit`.
        left_out: gets skipped runs with reasons.
    """

    mapping: MappingFile
    plan: Plan
    started: Mapping[str, datetime] = field(default_factory=dict)
    trusted: frozenset[str] = frozenset()
    faults: list[Problem] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    _taken: set[tuple[str, Direction, int]] = field(default_factory=set)

    def read(self, table: ForeignTable, told: Sequence[RunName]) -> list[ImportedRun]:
        """Return the runs of a table."""
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
        found: list[ImportedRun] = []
        groups = self._groups(table)
        names = told if len(told) > 1 else [*told, RunName()][:1] * len(groups)
        if len(names) != len(groups):
            what = f"the file has {len(groups)} runs, and {len(names)} are named"
            begins = ", ".join(str(int(table.table.lines[rows[0]])) for rows, _ in groups)
            self._fault(file, table.table.header, what, f"they begin at lines {begins}: name as many with --run")
            return []
        for (rows, said), one in zip(groups, names, strict=True):
            if said.get(STATE) == RunState.RECORDING:
                broken = "-".join(said.get(key, "") for key in (TEST, DIRECTION, REPEAT))
                self.left_out.append(f"run {broken} was broken off where it was measured and is left out")
                continue
            run = self._run(table, rows, said, one)
            if run is not None:
                found.append(run)
        return found

    def check(self) -> None:
        """Raise an error if there are faults so far.

        Raises:
            InputError: the faults so far.
        """
        if self.faults:
            raise InputError(self.faults[:MOST_FAULTS])

    def _groups(self, table: ForeignTable) -> list[tuple[Integers, dict[str, str]]]:
        of_runs = {m: name for m in OF_RUNS if (name := self.mapping.column(m)) is not None}
        cells = table.table.cells
        # A start may be another one in each row: the first of a run counts.
        named = [cells[name] for m, name in of_runs.items() if m != STARTED]
        alike = grouped((key, k) for k, key in enumerate(zip(*named, strict=True)))
        groups = [np.array(each) for each in alike.values()] if named else self._split(table)
        return [(rows, {m: cells[name][int(rows[0])] for m, name in of_runs.items()}) for rows in groups]

    def _numbers(self, table: ForeignTable, means: str) -> Floats | None:
        name = self.mapping.column(means)
        if name is None or name not in table.table.values:
            return None
        factor, offset = in_run_units(means, self.mapping.columns[name].unit or "")
        found: Floats = table.table.values[name] * factor + offset
        return found

    def _split(self, table: ForeignTable) -> list[Integers]:
        every = np.arange(len(table.table))
        if table.repeated and self.mapping.split is None:
            again = ", ".join(map(str, table.repeated))
            what = f"the names of the columns come again in line {again}: more than one run"
            self._fault(
                table.table.file, table.repeated[0], what, "say --split gaps, and --runs FILE=a-ccw,a-cw in their order"
            )
            return []
        if self.mapping.split == "gaps":
            t_s = self._numbers(table, TIME)
            known = every if t_s is None else every[np.isfinite(t_s)]
            timed = None if t_s is None else t_s[known]
            parts = parts_by_gaps(timed, table.table.lines[known], longest_pause_s(list(self.plan.runs().values())))
            return [known[part] for part in parts]
        angle = self._numbers(table, ANGLE)
        if angle is None:
            return [every]
        known = every[np.isfinite(angle)]
        parts = [known[part] for part in parts_by_direction(angle[known])] if len(known) else [every]
        if self.mapping.split == "direction":
            return parts
        if len(parts) > 1:
            line = int(table.table.lines[parts[1][0]])
            what = (
                f"the angles turn round {'once' if len(parts) == 2 else f'{len(parts) - 1} times'}: more than one run"  # noqa: PLR2004
            )
            self._fault(table.table.file, line, what, "say --split direction, or give each run a file of its own")
            return []
        return [every]

    def _run(self, table: ForeignTable, rows: Integers, said: Mapping[str, str], told: RunName) -> ImportedRun | None:
        file, line = table.table.file, int(table.table.lines[rows[0]])
        before = len(self.faults)
        rows, gaps = samples_of(table, rows, self.mapping, self.faults)
        values, held = self._values(table, rows)
        if not len(rows) and len(self.faults) == before:
            self._fault(file, line, "no row of this run has a reading", "check the columns of the mapping")
        if len(self.faults) > before:
            return None
        computed: list[str] = [*gaps, *held]
        name = self._named(table, said, told, line)
        angle = values.pop(ANGLE, None)
        if name.test not in self.plan.tests:
            what = f"the plan has no test {name.test}" if name.test else "nothing says which test of the plan this is"
            self._fault(file, line, what, f"its tests: {', '.join(self.plan.tests)}; say --runs FILE=TEST-DIRECTION")
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
            self._fault(file, line, what, f"say --runs FILE={name.test}-ccw or -cw")
            return None
        circle = planned.run(direction)
        try:
            if "unit" not in self.trusted:
                check_units(self.mapping, table.table, rows, values | ({} if angle is None else {ANGLE: angle}), circle)
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
            started=self._started(table, rows, said, computed),
            state=state,
            reason="rejected where it was measured" if state is RunState.REJECTED else "",
            texts=texts,
            exact=True,
        )
        return ImportedRun(file, run, (*computed, *travelled.computed))

    def _values(self, table: ForeignTable, rows: Integers) -> tuple[dict[str, Floats], tuple[str, ...]]:
        found, said = {}, list[str]()
        for name, column in self.mapping.columns.items():
            if column.means not in UNITS or column.unit is None:
                continue
            numbers, held = held_over_gaps(table, rows, name, self.faults)
            if not np.isfinite(numbers).any():
                continue
            said += held
            factor, offset = in_run_units(column.means, column.unit)
            found[column.means] = numbers if factor == 1.0 and offset == 0.0 else numbers * factor + offset
        return found, tuple(said)

    def _named(self, table: ForeignTable, said: Mapping[str, str], told: RunName, line: int) -> RunName:
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
        in_column = run_name(said.get(RUN, ""), list(self.plan.tests)) or RunName()
        test = told.test or first(TEST) or in_column.test
        repeat = told.repeat or count_in(first(REPEAT)) or in_column.repeat
        return RunName(test, direction or in_column.direction, repeat)

    def asked_span_deg(self, table: ForeignTable) -> float | None:
        """Return the range of a file's angles [deg] if no circle of the plan has it, else None."""
        angle = self._numbers(table, ANGLE)
        of_runs = any(self.mapping.column(one) is not None for one in OF_RUNS)
        if angle is None or of_runs or not np.all(np.isfinite(angle)):
            return None
        spans = [unplanned_span_deg(angle, circle) for circle in self.plan.runs().values()]
        return next(iter(spans), None) if all(span is not None for span in spans) else None

    def says_test(self, table: ForeignTable) -> bool:
        """Return whether a file states its test and direction."""
        if self.mapping.column(TEST) is not None:
            return True
        name = self._named(table, {}, RunName(), table.table.header)
        turns = self.mapping.angle is not None and self.mapping.angle.grows != "travel"
        return name.test in self.plan.tests and (turns or name.direction is not None)

    def direction(self, word: str) -> Direction | None:
        """Return a word's direction, or None."""
        by_mapping = {key.lower(): Direction(value) for key, value in self.mapping.words.items()}
        return {**WORDS, **by_mapping}.get(word.strip().lower())

    def _repeat(self, name: RunName, direction: Direction, file: str, line: int) -> int:
        free = (k for k in count(1) if (name.test, direction, k) not in self._taken)
        repeat = next(free) if name.repeat is None else name.repeat
        if (name.test, direction, repeat) in self._taken:
            self._fault(
                file, line, f"run {name.test}-{direction}-{repeat} appears a second time", "give it another repeat"
            )
        self._taken.add((name.test, direction, repeat))
        return repeat

    def _state(self, text: str, file: str, line: int) -> RunState:
        if text and text not in set(RunState):
            self._fault(file, line, f"`{text}` is no state of a run", f"use one of {', '.join(_STATES)}")
        return RunState(text) if text in _STATES else RunState.ACCEPTED

    def _started(
        self, table: ForeignTable, rows: Integers, said: Mapping[str, str], computed: list[str]
    ) -> datetime | None:
        file, line, in_column = table.table.file, int(table.table.lines[rows[0]]), said.get(STARTED, "")
        at = self.started.get(file)
        later = timedelta(seconds=self._later_s(table, rows) if at is not None or not in_column else 0.0)
        if at is None:
            try:
                found = moment_of(in_column, table.comments, PurePath(file).stem, self.mapping.zone)
            except UnclearMomentError as error:
                remedy = "say --started FILE=2026-11-20T08:04:11+01:00, or ignore the column"
                self._fault(file, {**table.comment_lines, "": line}.get(error.key, 0), error.what, remedy)
                return None
            if found is None:
                return None
            at = found.at
            computed += found.assumed
        at += later
        wrong = impossible_day(at)
        if wrong:
            remedy = "say the right one, such as --started FILE=2026-11-20T08:04:11+01:00, and check the clock of what recorded it"
            self._fault(file, line, f"this run is of {wrong}", remedy)
        return at

    def _later_s(self, table: ForeignTable, rows: Integers) -> float:
        name = self.mapping.column(TIME)
        if name is None:
            return 0.0
        t = table.table.values[name]
        later = float(t[rows[0]] - t[np.isfinite(t)][0]) * in_run_units(TIME, self.mapping.columns[name].unit or "s")[0]
        return later if np.isfinite(later) and later > 0.0 else 0.0

    def _fault(self, file: str, line: int, what: str, remedy: str) -> None:
        self.faults.append(Problem(file, line, 0, what, remedy))


_STATES = (RunState.ACCEPTED, RunState.REJECTED, RunState.COMPLETE)
_SAY_IT = "add it to the mapping, as `ignored` where it does not matter"


def chance_of_runs(runs: Sequence[ImportedRun], plan: Plan) -> float | None:
    """Return the probability that runs are by chance so near to their commanded centres; None if unknown."""
    centres: dict[tuple[str, int | None], list[Floats]] = {}
    for one in runs:
        columns_of = one.run.columns
        if columns.THETA in columns_of:
            found = centre_mm(columns_of[columns.LENGTH], columns_of[columns.THETA])
            centres.setdefault((one.run.test, one.run.mounting), []).append(found)
    return chance_of_centres((plan.tests[test].ball, found) for (test, _), found in centres.items())
