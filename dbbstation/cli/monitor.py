"""`dbbstation instrument monitor`: live reading of an instrument."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.cli.declared import made
from dbbstation.cli.instrument_options import LineOptions, Spy, spying
from dbbstation.cli.output import echo, json_text
from dbbstation.cli.provenance import provenance
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
        row: dict[str, object] = {"t_s": round(t_s, 6), "length_mm": reading.length_mm, "status": reading.status}
        row |= {"lost": reading.lost, "counter": reading.counter, "said": reading.said}
        row |= {"t_uncertainty_s": reading.t_uncertainty_s}
        echo(json_text(row))
        return
    length = f"{reading.length_mm:14.5f} mm" if reading.length_mm is not None else f"{'--':>14}   "
    lost = f"  ({reading.lost} lost before)" if reading.lost else ""
    said = f"  {reading.status}: {reading.said}" if reading.status != "ok" else ""
    echo(f"{t_s:10.3f} s {length}{lost}{said}")


def _conclude(tally: Tally, *, as_json: bool) -> None:
    if as_json:
        totals: dict[str, object] = {
            "readings": tally.readings,
            "lost": tally.lost,
            "doubtful": tally.doubtful,
            "garbage_bytes": tally.garbage_bytes,
        }
        totals |= {"rejected": tally.rejected, "reconnected": tally.reconnected}
        echo(json_text({"totals": totals, "provenance": provenance().data()}))
        return
    text = f"{tally.readings} readings, {tally.lost} lost, {tally.doubtful} doubtful, {tally.garbage_bytes} bytes not understood"
    if tally.rejected:
        text += f" ({', '.join(f'{count} by {reason}' for reason, count in sorted(tally.rejected.items()))})"
    echo(text + (f", for example {tally.garbage[:24].hex(' ')}" if tally.garbage else ""), err=True)
