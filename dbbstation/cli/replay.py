"""`dbbstation instrument replay`: decode a byte log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import click

from dbbstation.cli.declared import made
from dbbstation.cli.instrument_options import INSTRUMENT, PROFILE, ZERO_MM
from dbbstation.cli.output import echo
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option


@made()
def replay(
    file: Annotated[Path, Option("byte log.", kind="argument")],
    *,
    instrument: Annotated[str | None, replace(INSTRUMENT, setting="", usual="that of the log")] = None,
    profile: Annotated[str | None, replace(PROFILE, setting="", usual="that of the log")] = None,
    zero_mm: Annotated[float | None, replace(ZERO_MM, usual="lengths count from zero")] = None,
    as_json: o.Json = False,
) -> None:
    r"""Decode a byte log of `--spy` or `monitor --log`: print every reading, and all bytes that it does not understand.

    \b
    Examples:
      dbbstation instrument replay bytes.txt
      dbbstation instrument replay bytes.txt --instrument streaming-encoder --json
    """
    from dbbstation.cli.output import print_json
    from dbbstation.instrument.bytelog import logged_instrument, read_byte_log
    from dbbstation.instrument.library import load_instrument, with_zero
    from dbbstation.instrument.reading import DOUBTFUL
    from dbbstation.instrument.replay import replayed

    of_log, profile_of_log = logged_instrument(file)
    name = instrument or of_log
    if not name:
        raise click.UsageError(
            "the log does not name its instrument: give --instrument with a name or a file, as in --instrument ./my-gauge.yaml"
        )
    # The profile of the log is one of the log's instrument.
    protocol = load_instrument(name, profile or (profile_of_log if instrument in {None, of_log} else None))
    if zero_mm is not None:
        protocol = with_zero(protocol, zero_mm)
    rows = replayed(protocol, read_byte_log(file), where=str(file))
    if as_json:
        every = list(rows)
        lost = sum(row.reading.lost for row in every if row.reading is not None)
        doubtful = sum(row.reading.status == DOUBTFUL for row in every if row.reading is not None)
        garbage = [row for row in every if row.reading is None]
        said = [
            {"t_s": row.t_s, "length_mm": row.reading.length_mm, "status": row.reading.status, "lost": row.reading.lost}
            for row in every
            if row.reading is not None
        ]
        unread = [{"t_s": row.t_s, "bytes": row.raw.hex(" "), "why": row.why} for row in garbage]
        print_json({"readings": said, "lost": lost, "doubtful": doubtful, "not_understood": unread})
        return
    readings = lost = doubtful = unread_bytes = 0
    for row in rows:
        if row.reading is None:
            unread_bytes += len(row.raw)
            echo(f"{row.t_s:12.6f} s  not understood: {row.raw.hex(' ')}" + (f"  ({row.why})" if row.why else ""))
            continue
        length = f"{row.reading.length_mm:14.5f} mm" if row.reading.length_mm is not None else f"{'--':>14}   "
        readings += 1
        lost += row.reading.lost
        gap = f"  ({row.reading.lost} lost before)" if row.reading.lost else ""
        status = f"  {row.reading.status}: {row.reading.said}" if row.reading.status != "ok" else ""
        echo(f"{row.t_s:12.6f} s {length}{gap}{status}")
        doubtful += row.reading.status == DOUBTFUL
    echo(f"{readings} readings, {lost} lost, {doubtful} doubtful, {unread_bytes} bytes not understood", err=True)
