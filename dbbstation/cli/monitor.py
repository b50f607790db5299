"""`dbbstation instrument monitor` and `replay`: readings of an instrument, live or from a byte log."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from dbbstation.cli.declared import made
from dbbstation.cli.instrument_options import INSTRUMENT, PROFILE, ZERO_MM, LineOptions, Spy, spying
from dbbstation.cli.output import echo, json_text, print_json, provenance
from dbbstation.facts import picked
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from dbbstation.instrument.reading import Reading
    from dbbstation.instrument.reception import Tally


NO_PARITY = "note: this port does not tell of characters with a wrong parity; connect the instrument directly where lines are noisy"
"""Note for network ports, and on Windows."""


@made()
def monitor(
    line: LineOptions,
    *,
    count: Annotated[int | None, Option("Number of readings.", least=1)] = None,
    spy: Spy = None,
    log: Annotated[Path | None, Option("The same as --spy.", kind="file")] = None,
    force: o.Force = False,
    as_json: o.Json = False,
) -> None:
    r"""Show what an instrument measures, until Ctrl-C.

    \b
    Examples:
      dbbstation instrument monitor --instrument heidenhain-nd281b --port /dev/ttyUSB0
      dbbstation instrument monitor --instrument streaming-encoder --port COM3 --count 100 --json
      dbbstation instrument monitor --instrument heidenhain-nd281b --port /dev/ttyUSB0 --spy bytes.txt
      dbbstation instrument monitor --instrument tesa-tt80 --profile tt80 --zero-mm 150.0003 --port /dev/ttyUSB1
    """
    from dbbstation.instrument.driver import Instrument
    from dbbstation.service.held_line import RECONNECT_S

    protocol = line.protocol()
    with ExitStack() as stack:
        book = stack.enter_context(spying(spy or log, protocol, line.port, force=force))
        driver = stack.enter_context(Instrument(protocol, line.port, baud=line.baud, log=book, reconnect_s=RECONNECT_S))
        if protocol.line.parity != "none" and not driver.sees_damage:
            echo(NO_PARITY, err=True)
        first_s: float | None = None
        try:
            for reading in driver.readings(count):
                first_s = reading.t_s if first_s is None else first_s
                _show(reading, reading.t_s - first_s, as_json=as_json)
        except KeyboardInterrupt:
            pass
        finally:
            _conclude(driver.tally, as_json=as_json)


def _show(reading: Reading, t_s: float, *, as_json: bool) -> None:
    if as_json:
        rest = picked(reading, "length_mm", "status", "lost", "counter", "said", "t_uncertainty_s")
        echo(json_text({"t_s": round(t_s, 6), **rest}))
        return
    echo(f"{t_s:10.3f} s {_in_words(reading)}")


def _in_words(reading: Reading) -> str:
    length = f"{reading.length_mm:14.5f} mm" if reading.length_mm is not None else f"{'--':>14}   "
    lost = f"  ({reading.lost} lost before)" if reading.lost else ""
    said = f"  {reading.status}: {reading.said}" if reading.status != "ok" else ""
    return f"{length}{lost}{said}"


def _conclude(tally: Tally, *, as_json: bool) -> None:
    if as_json:
        totals = picked(tally, "readings", "lost", "doubtful", "garbage_bytes", "rejected", "reconnected")
        echo(json_text({"totals": totals, "provenance": provenance().data()}))
        return
    text = f"{tally.readings} readings, {tally.lost} lost, {tally.doubtful} doubtful, {tally.garbage_bytes} bytes not understood"
    if tally.rejected:
        text += f" ({', '.join(f'{count} by {reason}' for reason, count in sorted(tally.rejected.items()))})"
    echo(text + (f", for example {tally.garbage[:24].hex(' ')}" if tally.garbage else ""), err=True)


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
    say = (lambda _text: None) if as_json else echo
    readings, unread, lost, doubtful, unread_bytes = [], [], 0, 0, 0
    for row in replayed(protocol, read_byte_log(file), where=str(file)):
        one = row.reading
        if one is None:
            unread_bytes += len(row.raw)
            unread.append({"t_s": row.t_s, "bytes": row.raw.hex(" "), "why": row.why})
            say(f"{row.t_s:12.6f} s  not understood: {row.raw.hex(' ')}" + (f"  ({row.why})" if row.why else ""))
            continue
        lost += one.lost
        doubtful += one.status == DOUBTFUL
        readings.append({"t_s": row.t_s, "length_mm": one.length_mm, "status": one.status, "lost": one.lost})
        say(f"{row.t_s:12.6f} s {_in_words(one)}")
    if as_json:
        print_json({"readings": readings, "lost": lost, "doubtful": doubtful, "not_understood": unread})
    else:
        text = f"{len(readings)} readings, {lost} lost, {doubtful} doubtful, {unread_bytes} bytes not understood"
        echo(text, err=True)
