"""`dbbstation bar`: measure the bar on its calibrator, and keep its length."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from dbbstation.cli.declared import Answer, made
from dbbstation.cli.instrument_options import LineOptions
from dbbstation.cli.output import echo
from dbbstation.plan.bar import STEEL_BAR_UM_M_K, USUAL_READINGS, USUAL_TEMP_UNCERTAINTY_K
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from dbbstation.files.formats.bar import BarFile
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.trace.steady import Steady


@dataclass(frozen=True, kw_only=True)
class BarOptions:
    """Facts of the bar, by the keys of its file."""

    serial_number: Annotated[str, Option("Serial number of the bar.", flag="--bar-serial-number")]
    temp_c: Annotated[float, Option("Temperature of the bar [degC].", least=-30.0, most=80.0)]
    temp_uncertainty_k: Annotated[
        float,
        Option("Standard uncertainty of the bar's temperature [K].", least=0.001, most=10.0),
    ] = USUAL_TEMP_UNCERTAINTY_K
    expansion_um_m_k: Annotated[
        float,
        Option("Thermal expansion of the bar [µm/(m K)].", usual="11.5, steel", least=0.01, most=50.0),
    ] = STEEL_BAR_UM_M_K


@dataclass(frozen=True, kw_only=True)
class CalibratorOptions:
    """Facts of the calibrator."""

    calibrator_serial: Annotated[str, Option("Serial number of the calibrator.")]
    calibrator_mm: Annotated[
        float, Option("Length of the calibrator at 20 degC, from its certificate [mm].", least=20.0, most=2000.0)
    ]
    calibrator_u_um: Annotated[
        float, Option("Standard uncertainty u of the calibrator's length (U/2) [µm].", least=0.0, most=100.0)
    ]
    certified: Annotated[str, Option("Date of the certificate.", metavar="YYYY-MM-DD")]
    valid_until: Annotated[
        str | None, Option("Last day on which the certificate is valid  [default: five years].", metavar="YYYY-MM-DD")
    ] = None
    certificate: Annotated[str, Option("Number and issuer of the certificate.", flag="--calibrator-certificate")] = ""

    @property
    def data(self) -> dict[str, object]:
        """Return the calibrator's facts by the keys of the bar's file."""
        return {
            "serial_number": self.calibrator_serial,
            "length_mm": self.calibrator_mm,
            "uncertainty_um": self.calibrator_u_um,
            "certified": self.certified,
            "valid_until": self.valid_until,
            "certificate": self.certificate,
        }


@made()
def bar(
    line: LineOptions,
    of_bar: BarOptions,
    calibrator: CalibratorOptions,
    *,
    count: Annotated[int, Option("Number of readings.", least=20, most=1_000_000)] = USUAL_READINGS,
    resolution_um: Annotated[
        float | None,
        Option("Size of the display's last digit [µm]  [default: found from the readings].", least=0.0001, most=100.0),
    ] = None,
    out: Annotated[Path, replace(o.OUT, metavar="BAR.yaml")],
    force: o.Force = False,
) -> Answer:
    r"""Measure the bar's length on its calibrator and write the bar file that `measure --bar FILE` needs.

    Put the bar on the calibrator, a block of known length. Wait until the bar has the temperature of the shop. The
    command averages the readings. The file states the bar's error; recordings are never corrected. `calibrate` accounts
    for this error, its uncertainty and the bar's thermal growth since.

    \b
    Examples:
      dbbstation bar --instrument heidenhain-nd281b --port /dev/ttyUSB0 --bar-serial-number DBB-0042 --calibrator-serial ZB-17 \
        --calibrator-mm 150.0003 --calibrator-u-um 0.25 --certified 2026-03-01 --temp-c 20.3 --out bar.yaml
      dbbstation check bar.yaml
    """
    from dbbstation.files.atomic import refuse_existing
    from dbbstation.files.formats.bar import write_bar
    from dbbstation.service.bar_calibration import DRIFT

    refuse_existing(out, force=force)
    protocol = line.protocol(bar_length_mm=calibrator.calibrator_mm)
    found = _read(protocol, line.port, line.baud, count, resolution_um)
    file = _file(found, asdict(of_bar), calibrator.data, line.instrument, datetime.now(UTC))
    write_bar(out, file, force=force)
    long_um, u_um = 1e3 * (found.mean_mm - file.length_mm), 1e3 * file.uncertainty_mm
    told = {"readings": found.count, "mean_mm": found.mean_mm, "scatter_um": 1e3 * found.scatter_mm}
    told |= {"reads_long_um": long_um, "standard_uncertainty_um": u_um, "drift_um": 1e3 * found.drift_mm}

    def words() -> None:
        echo(f"{found.count} readings, mean {found.mean_mm:.5f} mm, scatter {1e3 * found.scatter_mm:.2f} µm")
        echo(f"the bar reads {long_um:+.2f} µm long on its calibrator, standard uncertainty {u_um:.2f} µm")
        if abs(found.drift_mm) > DRIFT * file.uncertainty_mm:
            echo(
                f"note: the reading drifted by {1e3 * found.drift_mm:+.2f} µm meanwhile: let the bar cool down",
                err=True,
            )
        if fault := file.to_bar(None).certificate_fault(datetime.now(UTC).date()):
            echo(f"note: `measure` refuses this bar: {fault}", err=True)
        echo(f"{out}: `dbbstation measure --bar {out} …` takes it")

    return Answer({"bar": str(out), **told}, words)


def _read(protocol: Protocol, port: str, baud: int | None, count: int, resolution_um: float | None) -> Steady:
    from dbbstation.instrument.driver import Instrument
    from dbbstation.service.bar_calibration import read_on_calibrator
    from dbbstation.service.held_line import driver_patience

    with Instrument(protocol, port, baud=baud, **driver_patience(1.0)) as source:
        try:
            return read_on_calibrator(source, count, resolution_um)
        except ValueError as error:
            raise click.UsageError(
                f"{error}: state the size of the display's last digit with --resolution-um"
            ) from error


def _file(
    found: Steady, of_bar: dict[str, object], calibrator: dict[str, object], instrument: str, now: datetime
) -> BarFile:
    from pydantic import ValidationError

    from dbbstation.service.bar_calibration import bar_file

    try:
        return bar_file(found, of_bar, calibrator, instrument, now)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise click.UsageError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error
