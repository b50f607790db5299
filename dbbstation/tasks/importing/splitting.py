"""Separate the runs in one file, and their rows with readings from rows without."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MOST_FAULTS, Problem
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.files.formats.mapping import ANGLE, DEVIATION, LENGTH, TIME
from dbbstation.files.recordings.table_csv import NO_NUMBER
from dbbstation.files.source_text import shortened
from dbbstation.text.written import words
from dbbstation.trace.cut import LARGEST_GAP_DEG

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.files.formats.mapping import MappingFile
    from dbbstation.files.recordings.foreign_csv import ForeignTable
    from dbbstation.plan.plan import Circle


SMALLEST_RUN_DEG = 90.0
"""Smallest reversal of the angles that begins a new run [deg]; smaller ones come from settling axes, overshoot or
noise."""


def longest_pause_s(circles: Sequence[Circle]) -> float:
    """Return the longest pause within a run [s]."""
    return max(LARGEST_GAP_DEG / circle.turning_deg_s for circle in circles)


def parts_by_gaps(t_s: Floats | None, lines: Integers, pause_s: float) -> list[Integers]:
    """Return the rows of each run, separated by pauses, restarted times or empty lines.

    Args:
        t_s: shape (n,); None if the file has none.
    """
    begins = np.diff(lines) > 1
    if t_s is not None:
        steps = np.diff(t_s)
        begins |= (steps > pause_s) | (steps < 0.0)
    return _parts(len(lines), np.flatnonzero(begins) + 1)


def parts_by_direction(angle_deg: Floats) -> list[Integers]:
    """Return the rows of each run, separated by a change of turning direction."""
    travelled = np.unwrap(angle_deg, period=FULL_TURN_DEG)
    ends: list[int] = []
    low = high = 0
    sense = 0
    for k, value in enumerate(travelled.tolist()):
        high = k if value > travelled[high] else high
        low = k if value < travelled[low] else low
        if sense >= 0 and value <= travelled[high] - SMALLEST_RUN_DEG:
            if sense > 0:
                ends.append(high)
            sense, low = -1, k
        elif sense <= 0 and value >= travelled[low] + SMALLEST_RUN_DEG:
            if sense < 0:
                ends.append(low)
            sense, high = 1, k
        if sense > 0:
            low = k
        elif sense < 0:
            high = k
    return _parts(len(travelled), np.array(ends, dtype=np.int64) + 1)


def _parts(n: int, begins: Integers) -> list[Integers]:
    return [rows for rows in np.split(np.arange(n), begins) if len(rows)]


OUT_OF_RANGE = frozenset(
    words("over, ovr, ovl, ol, o.l, overrange, overflow, over range, under, udr, ul, lo, hi, err, error, fault")
)
"""Words of displays for a missing reading, in small letters, without surrounding signs and stars."""

_OF_A_SAMPLE = (LENGTH, DEVIATION, ANGLE, TIME)
"""Meanings that every sample needs."""


def says_no_reading(cell: str) -> bool:
    """Return whether a cell has no reading: empty, `NaN`, `OVER`, `-OL-`, `****`, `#N/A`."""
    plain = cell.strip().lower()
    return plain in NO_NUMBER or not (bare := plain.strip("+-*#!.= ")) or bare in OUT_OF_RANGE or bare in NO_NUMBER


def samples_of(
    table: ForeignTable, rows: Integers, mapping: MappingFile, faults: list[Problem]
) -> tuple[Integers, tuple[str, ...]]:
    """Return a run's rows with readings, and notes on rows without.

    Args:
        faults: gets unreadable cells with line and column.
    """
    whole = np.ones(len(rows), dtype=bool)
    words: Counter[str] = Counter()
    for name, column in mapping.columns.items():
        if column.means not in _OF_A_SAMPLE:
            continue
        bad = ~np.isfinite(table.table.values[name][rows])
        if bad.all() and column.means in {ANGLE, TIME}:
            continue  # this run has none at all
        for k in np.flatnonzero(bad).tolist():
            if _is_no_reading(table, name, int(rows[k]), faults) and whole[k]:
                words[table.table.cells[name][int(rows[k])].strip() or "empty"] += 1
        whole &= ~bad
    if whole.all():
        return rows, ()
    said = ", ".join(
        f"{count} {'are empty' if word == 'empty' else f'say `{shortened(word)}`'}" for word, count in words.items()
    )
    return rows[whole], (f"{int((~whole).sum())} rows have no reading and are left out as gaps: {said}",)


def _is_no_reading(table: ForeignTable, name: str, row: int, faults: list[Problem]) -> bool:
    cell = table.table.cells[name][row]
    if says_no_reading(cell):
        return True
    if len(faults) < MOST_FAULTS:
        what = f"{name} is `{shortened(cell)}`, neither a number nor a word for no reading"
        place = (table.table.file, int(table.table.lines[row]), list(table.table.names).index(name) + 1)
        faults.append(Problem(*place, what, f"correct the cell, or empty it; {table.language.text}"))
    return False


def held_over_gaps(
    table: ForeignTable, rows: Integers, name: str, faults: list[Problem]
) -> tuple[Floats, tuple[str, ...]]:
    """Return a slow column, such as a temperature. A gap gets the previous reading; a gap at the begin gets the next one."""
    numbers = table.table.values[name][rows]
    bad = ~np.isfinite(numbers)
    if not bad.any():
        return numbers, ()
    for row in rows[bad].tolist():
        _is_no_reading(table, name, row, faults)
    good = np.flatnonzero(~bad)
    if not len(good):
        return numbers, ()
    before = good[np.maximum(np.searchsorted(good, np.arange(len(numbers)), side="right") - 1, 0)]
    return numbers[before], (f"{name}: {int(bad.sum())} rows without a reading have the one before",)
