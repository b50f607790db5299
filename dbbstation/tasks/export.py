"""Write sessions as a tidy table, one row per sample, with the memory of one run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from dbbstation.errors import ArgumentError
from dbbstation.files.inputs import in_a_book
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import File, Option, paths_of, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Unpack

    from dbbstation.files.provenance import Provenance
    from dbbstation.results.exchange import ExportResult
    from dbbstation.tasks.telling import Hooks

    States = str | Sequence[str]
else:
    States = tuple[Literal["accepted", "complete", "rejected", "recording"], ...]

FORMATS = (".csv", ".parquet")
"""Formats of a table, by the ending of its file."""


@task("export")
@in_a_book
def export(
    sessions: o.SessionPaths,
    out: Annotated[File, Option(o.OUTPUTS["out"], kind="file", metavar="FILE.csv|.parquet")],
    *,
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    states: Annotated[
        States, Option("Runs in this state only.", metavar="accepted|complete|rejected|recording,...", usual="all")
    ] = (),
    force: o.Force = False,
    provenance: Callable[[], Provenance] | None = None,
    **hooks: Unpack[Hooks],
) -> ExportResult:
    r"""Write sessions as one tidy table: one row per sample, with test, direction, repeat, state, time, angle, length, deviation.

    Columns carry their units in their names. Lengths are raw. The provenance is in a file beside a CSV file
    (.provenance.json), or in the metadata of a Parquet file, which has one row group per run. `dbbstation import` reads
    identical samples back from the CSV.

    \b
    Examples:
      dbbstation export session --out session.csv
      dbbstation export monday tuesday --states accepted --out week.parquet

    Args:
        provenance: called once all is read; None: from Python.

    Raises:
        ArgumentError: a value that it does not take, such as another ending.
        InputError: a run cannot be read, or none is left.
        OutputError: a file exists without `force`; pyarrow is missing.
        StationError: an unknown test.
        StoppedError: `stop` returned True; nothing was written.
    """
    from dbbstation.files.atomic import refuse_existing
    from dbbstation.files.provenance import from_python, refuse_existing_table
    from dbbstation.files.recordings.session import read_session
    from dbbstation.plan.plan import chosen_of
    from dbbstation.results.exchange import ExportResult
    from dbbstation.tasks.exporting import blocks, exporting, write_csv, write_parquet

    path = Path(out)
    if path.suffix.lower() not in FORMATS:
        raise ArgumentError("out", f"{path}: name a file that ends in {' or '.join(FORMATS)}")
    is_csv = path.suffix.lower() == FORMATS[0]
    (refuse_existing_table if is_csv else refuse_existing)(path, force=force)
    runs = []
    for folder in paths_of(sessions):
        session = read_session(folder)
        chosen = set(chosen_of(session.plan.name, session.plan.tests, tests, exclude))
        runs += [(session, run) for run in session.runs if run.test in chosen and (not states or run.state in states)]
    what = exporting(runs)
    telling = Telling(**hooks)
    write = write_csv if is_csv else write_parquet
    read = blocks(what, telling.counted("export"), telling.note)
    rows = write(path, what, read, provenance or from_python, force=force)
    return ExportResult(str(path), len(runs), rows, what.names)
