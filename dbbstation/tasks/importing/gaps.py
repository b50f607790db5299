"""Recognise cells without a reading, which are gaps and not faults: empty cells, or words for an out-of-range gauge."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import Problem
from dbbstation.files.formats.mapping import ANGLE, DEVIATION, LENGTH, TIME
from dbbstation.files.recordings.table_csv import MOST_FAULTS, NO_NUMBER
from dbbstation.files.source_text import shortened

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.files.formats.mapping import MappingFile
    from dbbstation.files.recordings.foreign_csv import ForeignTable

OUT_OF_RANGE = frozenset(
    {
        "over",
        "ovr",
        "ovl",
        "ol",
        "o.l",
        "overrange",
        "overflow",
        "over range",
        "under",
        "udr",
        "ul",
        "lo",
        "hi",
        "err",
        "error",
        "fault",
    }
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
    named = list(table.table.names)
    for name, column in mapping.columns.items():
        if column.means not in _OF_A_SAMPLE:
            continue
        cells = table.table.cells[name]
        bad = ~np.isfinite(table.table.values[name][rows])
        if bad.all() and column.means in {ANGLE, TIME}:
            continue  # this run has none at all
        for k in np.flatnonzero(bad).tolist():
            cell = cells[int(rows[k])]
            if not says_no_reading(cell):
                if len(faults) < MOST_FAULTS:
                    what = f"{name} is `{shortened(cell)}`, neither a number nor a word for no reading"
                    place = (table.table.file, int(table.table.lines[rows[k]]), named.index(name) + 1)
                    faults.append(Problem(*place, what, f"correct the cell, or empty it; {table.language.text}"))
            elif whole[k]:
                words[cell.strip() or "empty"] += 1
        whole &= ~bad
    if whole.all():
        return rows, ()
    said = ", ".join(
        f"{count} {'are empty' if word == 'empty' else f'say `{shortened(word)}`'}" for word, count in words.items()
    )
    return rows[whole], (f"{int((~whole).sum())} rows have no reading and are left out as gaps: {said}",)


def held_over_gaps(
    table: ForeignTable, rows: Integers, name: str, faults: list[Problem]
) -> tuple[Floats, tuple[str, ...]]:
    """Return a slow column, such as a temperature. A gap gets the previous reading; a gap at the begin gets the next one."""
    numbers = table.table.values[name][rows]
    bad = ~np.isfinite(numbers)
    if not bad.any():
        return numbers, ()
    column = list(table.table.names).index(name) + 1
    for k in np.flatnonzero(bad).tolist():
        cell = table.table.cells[name][int(rows[k])]
        if not says_no_reading(cell) and len(faults) < MOST_FAULTS:
            what = f"{name} is `{shortened(cell)}`, neither a number nor a word for no reading"
            line = int(table.table.lines[rows[k]])
            faults.append(
                Problem(table.table.file, line, column, what, f"correct the cell, or empty it; {table.language.text}")
            )
    good = np.flatnonzero(~bad)
    if not len(good):
        return numbers, ()
    before = good[np.maximum(np.searchsorted(good, np.arange(len(numbers)), side="right") - 1, 0)]
    return numbers[before], (f"{name}: {int(bad.sum())} rows without a reading have the one before",)
