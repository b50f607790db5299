"""The rows of exported sessions, written run by run."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.computing.counted import counting
from dbbstation.errors import InputError, OutputError, TraceError, read_each
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.files.atomic import streamed, write_text
from dbbstation.files.csv_rows import csv_text
from dbbstation.files.formats.session import RunState
from dbbstation.files.provenance import beside_table
from dbbstation.files.recordings.run_lines import split_head
from dbbstation.trace import columns
from dbbstation.trace.cut import edges_of, progress_deg

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from dbbstation.computing.arrays import Floats
    from dbbstation.computing.counted import Counted
    from dbbstation.files.formats.session import RunEntry
    from dbbstation.files.provenance import Provenance
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.plan.plan import Circle
    from dbbstation.trace.recording import Recording

    Blocks = Iterator[Mapping[str, Floats | list[str]]]
    """Columns of each run."""

OF_RUN = ("session", "test", "direction", "repeat", "mounting", "state", "started")
"""Columns that are the same in all rows of a run."""

ANGLE, DEVIATION = "angle_deg", "deviation_um"
"""Computed columns: the angle of samples on the turn, from 0 to 360, and length minus the plan's bar length."""

MEANINGS = {
    "session": "name of the session's folder",
    "test": "test of the plan",
    "direction": "sense of travel, seen from +Z: ccw or cw",
    "repeat": "counts the runs of this test and direction",
    "mounting": "counts how often a ball was put up; empty: one per test",
    "state": "accepted, rejected, complete (not judged) or recording (broken off)",
    "started": "when the first sample was taken",
    ANGLE: "angle from +X towards +Y of samples on the full turn [deg]: as recorded, else by the plan's feed between the edges",
    DEVIATION: "length_mm less the plan's length of the bar [µm]; no centre is taken off",
    columns.STATUS: "what the instrument said of the sample; others than ok or empty are not used",
    **{name: f"{column.meaning} [{column.unit}]" for name, column in columns.COLUMNS.items()},
}
"""Meaning of every column of the table."""

_WHOLE = frozenset({"repeat", "mounting"})


@dataclass(frozen=True, eq=False)
class Exporting:
    """The runs and columns of an export."""

    runs: tuple[tuple[SessionFolder, RunEntry], ...]
    names: tuple[str, ...]

    def is_text(self, name: str) -> bool:
        """Return whether a column has texts."""
        return name not in _WHOLE and name not in {ANGLE, DEVIATION} and name not in columns.COLUMNS


def exporting(runs: Sequence[tuple[SessionFolder, RunEntry]]) -> Exporting:
    """Return these runs with the columns of all of them.

    Raises:
        InputError: there is no run, or a file is no run.
    """
    if not runs:
        raise InputError.of("export", "no run is left to be exported", "exclude fewer tests, or give another --states")
    heads = read_each(split_head, [run.path for _, run in runs])
    found = dict.fromkeys(name for head in heads for name in head)
    known = [
        name for name in columns.COLUMNS if name in found and name not in {columns.TIME, columns.THETA, columns.LENGTH}
    ]
    # A column of the file that is named like one of ours would stand there twice.
    clear = [name for name in found if name not in {*columns.COLUMNS, columns.CRC, *OF_RUN, ANGLE, DEVIATION}]
    names = (*OF_RUN, columns.TIME, columns.THETA, ANGLE, columns.LENGTH, DEVIATION, *known, *clear)
    return Exporting(tuple(runs), names)


def angles_deg(recording: Recording, circle: Circle) -> Floats:
    """Return each sample's commanded angle on the full turn, from 0 to 360, shape (n,) [deg]; NaN outside the turn.

    Raises:
        TraceError: the run has neither angles nor edges of a circle.
    """
    if recording.theta_deg is not None:
        return np.mod(recording.theta_deg, FULL_TURN_DEG)
    phi = progress_deg(recording, circle, edges_of(recording, circle))
    on_turn = (phi >= 0.0) & (phi < FULL_TURN_DEG)
    return np.where(on_turn, np.mod(circle.theta_deg(phi), FULL_TURN_DEG), np.nan)


def blocks(what: Exporting, progress: Counted, say: Callable[[str], None]) -> Iterator[dict[str, Floats | list[str]]]:
    """Yield the columns of each run: arrays of numbers with NaN for gaps, and lists of texts.

    Raises:
        InputError: a run cannot be read.
    """
    for session, run in counting(what.runs, progress):
        try:
            read, circle = session.load(run), session.circle(run)
        except InputError as error:
            if run.state is not RunState.RECORDING:
                raise
            say(f"{session.name}: run {run.label} was interrupted and is left out: {error.problems[0]}")
            continue
        recording, count = read.recording, len(read.recording)
        try:
            angle = angles_deg(recording, circle)
        except TraceError as error:
            say(f"{session.name}: run {run.label} has no {ANGLE}: {error.what}")
            angle = np.full(count, np.nan)
        none = np.full(count, np.nan)
        said = {
            "session": session.name,
            "test": run.test,
            "direction": run.direction.value,
            "state": run.state.value,
            "started": "" if run.started is None else run.started.isoformat(),
        }
        numbers = {
            "repeat": np.full(count, float(run.repeat)),
            "mounting": none if run.mounting is None else np.full(count, float(run.mounting)),
            columns.TIME: recording.t_s,
            columns.THETA: none if recording.theta_deg is None else recording.theta_deg,
            ANGLE: angle,
            columns.LENGTH: recording.length_mm,
            DEVIATION: 1e3 * (recording.length_mm - circle.bar_mm),
            **recording.logged,
        }
        texts = {columns.STATUS: read.status, **read.unknown_columns}
        texts |= {name: (text,) * count for name, text in said.items()}
        yield {
            name: list(texts.get(name) or [""] * count) if what.is_text(name) else numbers.get(name, none)
            for name in what.names
        }


def write_csv(path: Path, what: Exporting, read: Blocks, provenance: Callable[[], Provenance], *, force: bool) -> int:
    """Write the table as CSV with its provenance file; return the number of rows.

    Raises:
        InputError: a run cannot be read.
        OutputError: a file exists without `force`, or the disk refuses; nothing is replaced.
    """
    rows = 0
    with streamed(path, force=force) as file:
        file.write(csv_text([what.names]).encode())
        for block in read:
            cells = [_cells(block[name], whole=name in _WHOLE) for name in what.names]
            file.write(csv_text(zip(*cells, strict=True), exact=True).encode())
            rows += len(cells[0])
        told = {**provenance().data(), "columns": _meanings(what)}
        write_text(beside_table(path), json.dumps(told, indent=1, ensure_ascii=False) + "\n", force=force)
    return rows


def pyarrow_for(path: Path) -> tuple[Any, Any]:
    """Return pyarrow and its module for Parquet.

    Raises:
        OutputError: it is not installed.
    """
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError as error:
        remedy = "install it with `pip install 'dbbstation[parquet]'`, or name a .csv file"
        raise OutputError(
            "Parquet is written by pyarrow, which is not installed", where=str(path), remedy=remedy
        ) from error
    return pa, parquet


def write_parquet(
    path: Path, what: Exporting, read: Blocks, provenance: Callable[[], Provenance], *, force: bool
) -> int:
    """Write the table as Parquet with one row group per run, provenance and meanings; return the number of rows.

    Raises:
        InputError: a run cannot be read.
        OutputError: pyarrow is missing; or as `write_csv`.
    """
    pa, parquet = pyarrow_for(path)

    def kind(name: str) -> Any:  # noqa: ANN401 - a type of pyarrow
        if what.is_text(name):
            return pa.string()
        return pa.int64() if name in _WHOLE else pa.float64()

    meanings = _meanings(what)
    schema = pa.schema([pa.field(name, kind(name), metadata={"meaning": meanings[name]}) for name in what.names])
    rows = 0
    with streamed(path, force=force) as file, parquet.ParquetWriter(file, schema) as writer:
        for block in read:
            arrays = [pa.array(block[name], from_pandas=True, safe=False).cast(kind(name)) for name in what.names]
            table = pa.Table.from_arrays(arrays, schema=schema)
            writer.write_table(table, row_group_size=max(len(table), 1))
            rows += len(table)
        writer.add_key_value_metadata({"dbbstation": json.dumps(provenance().data(), ensure_ascii=False)})
    return rows


def _meanings(what: Exporting) -> Mapping[str, str]:
    return {
        name: MEANINGS.get(name, "a column of the run files that this program does not know") for name in what.names
    }


def _cells(values: Floats | list[str], *, whole: bool) -> list[object]:
    if isinstance(values, list):
        return list(values)
    kind = int if whole else float
    return ["" if value != value else kind(value) for value in values.tolist()]  # noqa: PLR0124 - NaN is not itself
