"""Live readings of the bar on its calibrator, averaged on request."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pydantic import ValidationError

from dbbstation.errors import InputError, StationError
from dbbstation.files.formats.bar import write_bar
from dbbstation.plan.bar import STEEL_BAR_UM_M_K, USUAL_READINGS, USUAL_TEMP_UNCERTAINTY_K
from dbbstation.service.bar_reading import DRIFT, bar_file, read_on_calibrator

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.instrument.driver import Instrument
    from dbbstation.instrument.reading import Reading
    from dbbstation.service.held_line import HeldLine

_TICK_S = 0.05


@dataclass(frozen=True)
class Stated:
    """Facts of bar and calibrator that the operator states."""

    serial_number: str
    calibrator: str
    calibrator_mm: float
    calibrator_u_um: float
    certified: str
    temp_c: float
    valid_until: str = ""


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
        self._wanted: tuple[Stated, Path] | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bar", daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Return whether readings are being averaged."""
        return self._wanted is not None and self._thread.is_alive()

    def begin(self, stated: Stated, path: Path) -> None:
        """Average readings and write the file, unless busy."""
        if not self.busy:
            self.failure, self.found, self.done = None, None, 0
            self._wanted = stated, path
            if not self._thread.is_alive():
                self._thread = threading.Thread(target=self._run, name="bar", daemon=True)
                self._thread.start()

    def close(self) -> None:
        """Give the instrument back."""
        self._stop.set()
        self._thread.join()

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

    def _averaged(self, source: Instrument, stated: Stated, path: Path) -> Calibrated:
        try:
            found = read_on_calibrator(source, self.count, progress=self._progress)
            file = bar_file(
                found,
                {
                    "serial_number": stated.serial_number,
                    "temp_c": stated.temp_c,
                    "temp_uncertainty_k": USUAL_TEMP_UNCERTAINTY_K,
                    "expansion_um_m_k": STEEL_BAR_UM_M_K,
                },
                {
                    "serial_number": stated.calibrator,
                    "length_mm": stated.calibrator_mm,
                    "uncertainty_um": stated.calibrator_u_um,
                    "certified": stated.certified,
                    "valid_until": stated.valid_until or None,
                },
                self._line.protocol.name,
                datetime.now(UTC),
            )
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
