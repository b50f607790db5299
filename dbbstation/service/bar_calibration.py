"""The bar on its calibrator: live readings, averaged on request, and the facts that a person states."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from datetime import UTC, date, datetime
from typing import TYPE_CHECKING, get_args

import numpy as np
from pydantic import ValidationError

from dbbstation.computing.counted import uncounted
from dbbstation.errors import InputError, InstrumentError, StationError
from dbbstation.facts.quantities import USUAL_STROKE_MM, Quantity
from dbbstation.files.formats.bar import AFTER_MISREAD, BarFile, CalibratorSchema, write_bar
from dbbstation.plan.bar import USUAL_READINGS
from dbbstation.trace.reachable import Reachable
from dbbstation.trace.steady import steady

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from dbbstation.computing.counted import Counted
    from dbbstation.files.yaml.schema import Schema
    from dbbstation.instrument.driver import Instrument
    from dbbstation.instrument.reading import Reading
    from dbbstation.service.held_line import HeldLine
    from dbbstation.trace.steady import Steady


DRIFT = 2.0
"""Drift that is reported, in standard uncertainties: more than the expanded uncertainty (k = 2)."""


def read_on_calibrator(
    source: Instrument,
    count: int = USUAL_READINGS,
    resolution_um: float | None = None,
    progress: Counted = uncounted,
) -> Steady:
    """Return the mean of good readings, without readings that a resting bar cannot have.

    Args:
        resolution_um: display step; None: estimated from the readings.

    Raises:
        InstrumentError: the line failed, or too many readings are no length.
        ValueError: the resolution is unknown.
    """
    lengths: list[float] = []
    for reading in source.readings(2 * count):
        if reading.length_mm is not None and reading.status == "ok":
            lengths.append(reading.length_mm)
            progress(len(lengths), count)
        if len(lengths) == count:
            break
    else:
        what = f"only {len(lengths)} of {2 * count} readings are a length"
        raise InstrumentError(what, where=source.where, remedy="put the bar on the calibrator, check its cable")
    readings_mm = np.array(lengths)
    possible = Reachable.standing(readings_mm)
    return steady(readings_mm[possible], None if resolution_um is None else 1e-3 * resolution_um)


def bar_file(
    found: Steady, of_bar: Mapping[str, object], calibrator: Mapping[str, object], instrument: str, now: datetime
) -> BarFile:
    """Return the content of the bar's calibration file.

    Args:
        of_bar: serial number, temperature with uncertainty, expansion, as in `BarFile`.

    Raises:
        pydantic.ValidationError: a value that no such file may have.
        InstrumentError: the readings contradict this calibrator.
    """
    readings = {
        "instrument": instrument,
        "count": found.count,
        "mean_mm": found.mean_mm,
        "uncertainty_um": 1e3 * found.uncertainty_mm,
        "scatter_um": 1e3 * found.scatter_mm,
        "resolution_um": 1e3 * found.resolution_mm,
    }
    calibrated = now.replace(microsecond=0).isoformat().replace("+00:00", "Z")
    file = BarFile.model_validate(
        {
            "format": "dbb-bar/1",
            **of_bar,
            "calibrated": calibrated,
            "calibrator": dict(calibrator),
            "readings": readings,
        }
    )
    if file.misread:
        raise InstrumentError(file.misread, where=instrument, remedy=AFTER_MISREAD)
    return file


_TICK_S = 0.05


@dataclass(frozen=True)
class Calibrated:
    """Result of the calibration.

    Attributes:
        long_um: excess of the bar's reading.
    """

    path: Path
    long_um: float
    u_um: float
    drift_um: float
    drifted: bool


class BarCalibration:
    """Uses the instrument while the bar is on its calibrator; it must be closed in any case.

    Attributes:
        latest: None before a reading.
    """

    def __init__(self, line: HeldLine, count: int = USUAL_READINGS) -> None:
        self._line = line
        self.count = count
        self.latest: Reading | None = None
        self.failure: StationError | None = None
        self.found: Calibrated | None = None
        self.done = 0
        self._wanted: tuple[Mapping[str, object], Mapping[str, object], Path] | None = None
        self._stop = threading.Event()
        self._listen()

    @property
    def busy(self) -> bool:
        """Return whether readings are being averaged."""
        return self._wanted is not None and self._thread.is_alive()

    def begin(self, of_bar: Mapping[str, object], calibrator: Mapping[str, object], path: Path) -> None:
        """Average readings and write the file with stated facts as of `bar_file`, unless busy."""
        if not self.busy:
            self.failure, self.found, self.done = None, None, 0
            self._wanted = of_bar, calibrator, path
            if not self._thread.is_alive():
                self._listen()

    def close(self) -> None:
        """Give the instrument back."""
        self._stop.set()
        self._thread.join()

    def _listen(self) -> None:
        self._thread = threading.Thread(target=self._run, name="bar", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            with self._line.lent() as source:
                while not self._stop.wait(_TICK_S):
                    readings = source.drain()
                    self.latest = readings[-1] if readings else self.latest
                    if self._wanted is not None:
                        self.found = self._averaged(source, *self._wanted)
                        self._wanted = None
        except StationError as error:
            self.failure, self._wanted = error, None
        except _StoppedError:
            pass

    def _averaged(
        self, source: Instrument, of_bar: Mapping[str, object], calibrator: Mapping[str, object], path: Path
    ) -> Calibrated:
        try:
            found = read_on_calibrator(source, self.count, progress=self._progress)
            file = bar_file(found, of_bar, calibrator, self._line.protocol.name, datetime.now(UTC))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise InputError.of("bar", f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error
        except ValueError as error:
            what = f"{error}; `dbbstation bar --resolution-um` takes the last digit of the display"
            raise InputError.of("bar", what) from error
        write_bar(path, file)
        drifted = abs(found.drift_mm) > DRIFT * file.uncertainty_mm
        long_um = 1e3 * (found.mean_mm - file.length_mm)
        return Calibrated(path, long_um, 1e3 * file.uncertainty_mm, 1e3 * found.drift_mm, drifted)

    def _progress(self, done: int, _of: int) -> None:
        self.done = done
        if self._stop.is_set():
            raise _StoppedError


class _StoppedError(Exception):
    """The averaging was abandoned."""


USUAL_INTERVAL_YEARS = 3.0
"""Age above which a calibration is questioned. Laboratories recalibrate gauge blocks every one to three years [ISO 3650
leaves the interval to the user]."""

_RANGES: dict[str, tuple[type[Schema], str]] = {
    "calibrator_mm": (CalibratorSchema, "length_mm"),
    "calibrator_u_um": (CalibratorSchema, "uncertainty_um"),
    "temp_c": (BarFile, "temp_c"),
}
"""Format and key that define the range of each number."""

_DAYS_PER_YEAR = 365.25


def fault_of(
    name: str, text: str, reads_mm: float | None = None, stroke_mm: float | None = None, today: date | None = None
) -> str:
    """Return a typed text's fault, or an empty text."""
    if name == "certified" or (name == "valid_until" and text):
        return _fault_of_day(name, text, today or datetime.now().astimezone().date())
    if name not in _RANGES:
        return ""
    try:
        number = float(text.replace(",", "."))
    except ValueError:
        return f"`{text}` is no number"
    quantity = _quantity(*_RANGES[name])
    if not quantity.fits(number):
        return f"{number:g} {quantity.unit} is not plausible, expected {quantity.range}{quantity.guess(number)}"
    stroke = USUAL_STROKE_MM if stroke_mm is None else stroke_mm
    if name == "calibrator_mm" and reads_mm is not None and abs(reads_mm - number) > stroke:
        return f"the bar reads {reads_mm:.4f} mm: it does not stand on a calibrator of {number:.10g} mm"
    return ""


def doubt_of(name: str, text: str, today: date | None = None) -> str:
    """Return a doubt about a faultless text, or an empty text."""
    if name != "certified":
        return ""
    years = ((today or datetime.now().astimezone().date()) - date.fromisoformat(text)).days / _DAYS_PER_YEAR
    if years <= USUAL_INTERVAL_YEARS:
        return ""
    return f"the certificate of {text} is {int(years)} years old: is that the date on it, and does it still hold?"


def _fault_of_day(name: str, text: str, today: date) -> str:
    try:
        day = date.fromisoformat(text)
    except ValueError:
        return f"`{text}` is no date, expected such as 2026-11-20"
    if name == "valid_until":
        return (
            f"the certificate was valid until {text} only: the calibrator has to be certified anew"
            if day < today
            else ""
        )
    return f"the certificate of {text} is of the future" if day > today else ""


def _quantity(schema: type[Schema], key: str) -> Quantity:
    field = schema.model_fields[key]
    inside = [each for kind in get_args(field.annotation) for each in getattr(kind, "__metadata__", ())]
    return next(each for each in (*field.metadata, *inside) if isinstance(each, Quantity))
