"""Readings of a bar on its calibrator, and their file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import InstrumentError
from dbbstation.files.formats.bar import AFTER_MISREAD, BarFile
from dbbstation.plan.bar import USUAL_READINGS
from dbbstation.trace.reachable import Reachable
from dbbstation.trace.steady import steady

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from datetime import datetime

    from dbbstation.instrument.driver import Instrument
    from dbbstation.trace.steady import Steady

DRIFT = 2.0
"""Drift that is reported, in standard uncertainties: more than the expanded uncertainty (k = 2)."""


def read_on_calibrator(
    source: Instrument,
    count: int = USUAL_READINGS,
    resolution_um: float | None = None,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
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
