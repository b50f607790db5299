"""Write a fleet's values as one tidy table, CSV or Parquet."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from dbbstation.errors import OutputError
from dbbstation.files.atomic import streamed
from dbbstation.files.provenance import write_table
from dbbstation.files.recordings.table_csv import table_csv
from dbbstation.results.fleet import TABLE
from dbbstation.tasks.exporting import pyarrow_for

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.files.provenance import Provenance
    from dbbstation.results.fleet import FleetResult

FORMATS = (".csv", ".parquet")
"""Formats of a table, by the ending of its file."""

_NUMBERS = frozenset({"value", "u", "usual", "scatter", "score", "smallest_seen"})
_WHOLE = frozenset({"sisters"})
_YES_OR_NO = frozenset({"unlike"})


def write_fleet_table(path: Path, result: FleetResult, provenance: Provenance, *, force: bool = False) -> None:
    """Write each value of a fleet as one row.

    Raises:
        OutputError: another extension; the file exists without `force`; pyarrow is missing.
    """
    rows = result.rows()
    if path.suffix.lower() == FORMATS[0]:
        columns = [[_cell(row[name]) for row in rows] for name in TABLE]
        write_table(path, table_csv(TABLE, columns), provenance, force=force)
        return
    if path.suffix.lower() != FORMATS[1]:
        raise OutputError("a table is written as .csv or .parquet", where=str(path), remedy="name such a file")
    pa, parquet = pyarrow_for(path)
    kinds = {
        name: pa.float64()
        if name in _NUMBERS
        else pa.int64()
        if name in _WHOLE
        else pa.bool_()
        if name in _YES_OR_NO
        else pa.string()
        for name in TABLE
    }
    told = {"dbbstation": json.dumps(provenance.data(), ensure_ascii=False)}
    arrays = [pa.array([row[name] for row in rows], type=kinds[name]) for name in TABLE]
    table = pa.Table.from_arrays(arrays, schema=pa.schema(list(kinds.items()), metadata=told))
    with streamed(path, force=force) as file:
        parquet.write_table(table, file)


def _cell(value: object) -> object:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "" if value is None else value
