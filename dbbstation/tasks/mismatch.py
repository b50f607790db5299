"""Mismatch: where measured and simulated values of a table differ, and what the simulation lacks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.errors import StationError
from dbbstation.results.of_mismatch import mismatch_result
from dbbstation.tasks.load import paths_of
from dbbstation.tasks.tables import TableOptions, load_sources, load_tables, stated_variables
from dbbstation.tasks.telling import Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from os import PathLike

    from dbbstation.diagnosis.table.mismatch import Mismatch
    from dbbstation.diagnosis.table.units import Meaning
    from dbbstation.files.formats.number_language import NumberLanguage
    from dbbstation.results.mismatch import MismatchResult
    from dbbstation.tasks.load import Sessions
    from dbbstation.tasks.tables import Tabulated
    from dbbstation.tasks.telling import Progress

STAGES = {"look": 0, "sets of causes": 8, "held-out part": 15}
STAGES_WHOLE = {"look": 0, "sets of causes": 50}
"""Stages of a comparison with the held-out test and without it, and the share of its time that has passed by then [%]."""

MATTERS = "state the smallest effect that you care about, as root mean square in the unit of the measured values"

CORRECTED, LEFT = "corrected", "left"
"""Columns that are added to the table."""


def mismatch(
    data: Sessions,
    measured: str,
    simulated: str,
    *,
    variables: Mapping[str, Meaning | str | None] | Sequence[str] | None = None,
    run: str | None = None,
    time: str | None = None,
    source_files: Sequence[str | PathLike[str]] = (),
    known_u: Mapping[str, float] | None = None,
    free: Sequence[str] = (),
    has_offset: bool = True,
    matters: float | None = None,
    hold_out: bool = True,
    numbers: NumberLanguage | None = None,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
    say: Callable[[str], None] = silent,
) -> MismatchResult:
    """Find where simulation and recording differ, in what form, and what the simulation lacks.

    Each row has a measured and a simulated value with known conditions. Columns `d_NAME` are derivatives of the simulated
    value by NAME, which is refitted.

    Args:
        data: CSV files.
        measured: column.
        simulated: column, in the same unit.
        variables: columns that the difference may follow, each with unit or kind if its name has none; None: all.
        run: column that separates runs; several files are several runs anyway.
        time: column of time; `rows`: in the order of rows; None: guess.
        source_files: own physics as Python, which is executed.
        known_u: prior standard uncertainty of parameters by name, in their units.
        free: parameters without prior, such as initial states.
        has_offset: allow a constant difference of no interest.
        matters: rms size that matters, in the unit of the values; None: what refitted parameters leave.
        hold_out: repeat for each held-out part; takes most of the time.
        numbers: notation; None: decimal point and the header's most frequent separator.
        progress: called with each stage.
        stop: asked at each stage.
        say: called with notes.

    Returns:
        What was found; `drawing` draws it, and `table` has the corrected simulation.

    Raises:
        InputError: every fault of every file; too few rows.
        StationError: `matters` is not above zero.
        CalibrationError: rounding hides what so large a difference follows.
        StoppedError: `stop` returned True.
    """
    require_size(matters)
    telling = Telling(progress, stop, say)
    asked = TableOptions(
        measured,
        simulated,
        _meanings(variables),
        run,
        time,
        numbers,
        known=known_u or {},
        free=tuple(free),
        has_offset=has_offset,
    )
    tabulated = load_tables(paths_of(data), asked)
    telling.note(*tabulated.notes)
    sources, lacking = load_sources([Path(file) for file in source_files], tabulated.table)
    telling.note(*(f"{name} cannot be asked: {why}" for name, why in lacking.items()))
    found = find_mismatch(
        tabulated.table, sources, hold_out=hold_out, lacking=lacking, matters=matters, progress=telling.stage
    )
    return mismatch_result(
        found, table=_corrected(tabulated, found), drawing=partial(_drawn, found), notes=tuple(telling.notes)
    )


def require_size(matters: float | None) -> None:
    """Refuse a size of zero, which no recording could exclude.

    Raises:
        StationError: it is not above zero.
    """
    if matters is not None and not (math.isfinite(matters) and matters > 0.0):
        raise StationError(
            f"a size that matters must be above zero, not {matters:g}", where="--matters", remedy=MATTERS
        )


def _meanings(
    variables: Mapping[str, Meaning | str | None] | Sequence[str] | None,
) -> dict[str, Meaning | None] | None:
    """Return meanings of columns by name; None to guess."""
    if variables is None:
        return None
    given = dict(variables) if isinstance(variables, Mapping) else dict.fromkeys(variables)
    return {
        name: stated_variables(f"{name}={meaning}")[name] if isinstance(meaning, str) else meaning
        for name, meaning in given.items()
    }


def _corrected(tabulated: Tabulated, found: Mismatch) -> dict[str, tuple[str | float, ...]]:
    """Return the files' columns with the corrected simulation and the residual."""
    corrected = found.table.simulated + found.correction
    columns: dict[str, tuple[str | float, ...]] = {name: tabulated.columns[name] for name in tabulated.names}
    unit = f"_{found.table.unit.replace('µ', 'u')}" if found.table.unit else ""
    for name, values in ((CORRECTED, corrected), (LEFT, found.table.measured - corrected)):
        columns[_unused(f"{name}{unit}", columns)] = tuple(values.tolist())
    return columns


def _unused(name: str, taken: Mapping[str, object]) -> str:
    return next(one for one in (name, *(f"{name}_{k}" for k in range(2, len(taken) + 3))) if one not in taken)


def _drawn(found: Mismatch, wanted: object) -> bytes:
    from dbbstation.report.figure_format import figure_format  # noqa: PLC0415 - half a second for who draws nothing
    from dbbstation.report.mismatch_figure import mismatch_figure  # noqa: PLC0415

    return mismatch_figure(found, figure_format(wanted))
