"""`dbbstation bar`: read the bar on its calibrator, and keep what it read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.instrument_options import chosen_protocol, instrument_options
from dbbstation.cli.number_types import Finite
from dbbstation.cli.output import echo
from dbbstation.plan.bar import STEEL_BAR_UM_M_K, USUAL_READINGS, USUAL_TEMP_UNCERTAINTY_K
from dbbstation.service.patience import driver_patience

if TYPE_CHECKING:
    from datetime import datetime

    from dbbstation.files.formats.bar import BarFile
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.trace.steady import Steady


@click.command()
@instrument_options(required=True)
@click.option("--serial-number", required=True, help="Serial number of the bar.")
@click.option("--calibrator-serial", "calibrator_serial", required=True, help="Serial number of the calibrator.")
@click.option(
    "--calibrator-mm", type=Finite(20, 2000), required=True, help="Its length on the certificate, at 20 degC."
)
@click.option(
    "--calibrator-u-um",
    type=Finite(0, 100),
    required=True,
    help="Standard uncertainty u of the calibrator's length (U/2).",
)
@click.option("--certified", required=True, metavar="YYYY-MM-DD", help="Date of the certificate.")
@click.option("--valid-until", metavar="YYYY-MM-DD", help="Last day on which it holds  [default: five years].")
@click.option("--certificate", default="", help="Number of the certificate, and who issued it.")
@click.option("--temp-c", type=Finite(-30, 80), required=True, help="Temperature of the bar [degC].")
@click.option(
    "--temp-u-k",
    type=Finite(0.001, 10),
    default=USUAL_TEMP_UNCERTAINTY_K,
    show_default=True,
    help="Standard uncertainty of that temperature [K].",
)
@click.option(
    "--expansion-um-m-k",
    type=Finite(0.01, 50),
    default=STEEL_BAR_UM_M_K,
    show_default="11.5, steel",
    help="Thermal expansion of the bar [µm/(m K)].",
)
@click.option(
    "--count", type=click.IntRange(20, 1_000_000), default=USUAL_READINGS, show_default=True, help="Readings."
)
@click.option(
    "--resolution-um", type=Finite(0.0001, 100), help="Last digit of the display  [default: as readings show]."
)
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), required=True, help="File of the bar.")
@click.option("--force", is_flag=True, help="Replace the file.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def bar(
    *,
    instrument: str,
    profile: str | None,
    zero_mm: float | None,
    port: str,
    baud: int | None,
    serial_number: str,
    calibrator_serial: str,
    calibrator_mm: float,
    calibrator_u_um: float,
    certified: str,
    valid_until: str | None,
    certificate: str,
    temp_c: float,
    temp_u_k: float,
    expansion_um_m_k: float,
    count: int,
    resolution_um: float | None,
    out: Path,
    force: bool,
    as_json: bool,
) -> None:
    """Read the bar on its calibrator and write what it read: the length that `measure --bar FILE` needs.

    Put the bar on the calibrator, a block of known length such as of Zerodur, and wait until it has the temperature of the
    shop. The readings are averaged. The bar's error is noted; recordings are never corrected. `calibrate` accounts for this error, its uncertainty and the bar's growth since.

    \b
    Examples:
      dbbstation bar --instrument heidenhain-nd281b --port /dev/ttyUSB0 --serial-number DBB-0042 --calibrator-serial ZB-17 \\
        --calibrator-mm 150.0003 --calibrator-u-um 0.25 --certified 2026-03-01 --temp-c 20.3 --out bar.yaml
      dbbstation check bar.yaml
    """  # noqa: D301 (click reads the escape)
    from datetime import UTC, datetime

    from dbbstation.cli.output import print_json
    from dbbstation.files.atomic import refuse_existing
    from dbbstation.files.formats.bar import write_bar
    from dbbstation.service.bar_reading import DRIFT

    refuse_existing(out, force=force)
    protocol = chosen_protocol(instrument, profile, zero_mm, bar_length_mm=calibrator_mm)
    found = _read(protocol, port, baud, count, resolution_um)
    file = _file(
        found,
        {
            "serial_number": serial_number,
            "temp_c": temp_c,
            "temp_uncertainty_k": temp_u_k,
            "expansion_um_m_k": expansion_um_m_k,
        },
        {
            "serial_number": calibrator_serial,
            "length_mm": calibrator_mm,
            "uncertainty_um": calibrator_u_um,
            "certified": certified,
            "valid_until": valid_until,
            "certificate": certificate,
        },
        instrument,
        datetime.now(UTC),
    )
    write_bar(out, file, force=force)
    long_um, u_um = 1e3 * (found.mean_mm - file.length_mm), 1e3 * file.uncertainty_mm
    if as_json:
        told = {"readings": found.count, "mean_mm": found.mean_mm, "scatter_um": 1e3 * found.scatter_mm}
        told |= {"reads_long_um": long_um, "standard_uncertainty_um": u_um, "drift_um": 1e3 * found.drift_mm}
        print_json({"bar": str(out), **told})
        return
    echo(f"{found.count} readings, mean {found.mean_mm:.5f} mm, scatter {1e3 * found.scatter_mm:.2f} µm")
    echo(f"the bar reads {long_um:+.2f} µm long on its calibrator, standard uncertainty {u_um:.2f} µm")
    if abs(found.drift_mm) > DRIFT * file.uncertainty_mm:
        echo(f"note: it drifted by {1e3 * found.drift_mm:+.2f} µm meanwhile: give it time to cool down", err=True)
    if fault := file.to_bar(None).certificate_fault(datetime.now(UTC).date()):
        echo(f"note: `measure` refuses this bar: {fault}", err=True)
    echo(f"{out}: `dbbstation measure --bar {out} …` takes it")


def _read(protocol: Protocol, port: str, baud: int | None, count: int, resolution_um: float | None) -> Steady:
    from dbbstation.instrument.driver import Instrument
    from dbbstation.service.bar_reading import read_on_calibrator

    with Instrument(protocol, port, baud=baud, **driver_patience(1.0)) as source:
        try:
            return read_on_calibrator(source, count, resolution_um)
        except ValueError as error:
            raise click.UsageError(f"{error}: say with --resolution-um what the display's last digit is") from error


def _file(
    found: Steady, of_bar: dict[str, object], calibrator: dict[str, object], instrument: str, now: datetime
) -> BarFile:
    from pydantic import ValidationError

    from dbbstation.service.bar_reading import bar_file

    try:
        return bar_file(found, of_bar, calibrator, instrument, now)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise click.UsageError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error
