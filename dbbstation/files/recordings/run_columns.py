"""Columns of a run file: what they mean, how many decimals they carry, which values are plausible."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Column:
    """One numeric column.

    Attributes:
        unit: as printed.
        meaning: one line with the sign.
        decimals: as written by the station.
        size: greatest plausible absolute value, in that unit.
    """

    unit: str
    meaning: str
    decimals: int
    size: float


TIME = "t_s"
LENGTH = "length_mm"
THETA = "theta_deg"
STATUS = "status"
CRC = "crc"
SENSORS = ("bar", "jig", "machine", *(f"strut{i}" for i in range(1, 7)))
TEMPERATURES = {f"{sensor}_temp_c": sensor for sensor in SENSORS}
"""Temperature columns with the name of their sensor."""
CURRENTS = tuple(f"motor{i}_current_a" for i in range(1, 7))

_DEGREES_OF_TURNS = 36_000.0

COLUMNS = {
    TIME: Column("s", "host time since the first sample, rising", 6, 1e6),
    LENGTH: Column("mm", "distance between the two ball centres, raw", 6, 1e4),
    THETA: Column("deg", "commanded angle from +X towards +Y, for both directions", 6, _DEGREES_OF_TURNS),
    **{name: Column("degC", f"temperature of the {sensor}", 3, 150.0) for name, sensor in TEMPERATURES.items()},
    **{
        name: Column("A", f"current of motor {i + 1}, positive when it pulls the platform towards the base", 5, 1e3)
        for i, name in enumerate(CURRENTS)
    },
}
"""Every numeric column by name."""

REQUIRED = (TIME, LENGTH)
TEXTS = (STATUS, CRC)
STATUS_GOOD = "ok"
