"""Declarations of a recorded run's columns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from dbbstation.computing.arrays import Floats

    Logged = Mapping[str, Floats]


class ColumnKind(StrEnum):
    """Kinds of columns by their use."""

    TIME = "time"
    """Used by cutting and by sources that act in time."""
    LENGTH = "length"
    """Used by every fit."""
    ANGLE = "angle"
    """Used by cutting instead of time."""
    TEMPERATURE = "temperature"
    """Used by sources that follow thermometers."""
    CURRENT = "current"
    """Used by the analysis of motor currents."""
    OTHER = "other"
    """Used by sources that request it by name."""


@dataclass(frozen=True)
class Column:
    """One numeric column.

    Attributes:
        decimals: number that the station writes.
        size: greatest plausible absolute value.
    """

    name: str
    kind: ColumnKind
    unit: str
    meaning: str
    decimals: int
    size: float
    of: str = ""


_DEGREES_OF_TURNS = 36_000.0
_SENSORS = ("bar", "jig", "machine", *(f"strut{i}" for i in range(1, 7)))
_PULL = "positive when it pulls the platform towards the base"

_DECLARED = (
    Column("t_s", ColumnKind.TIME, "s", "host time since the first sample, rising", 6, 1e6),
    Column(
        "t_uncertainty_s", ColumnKind.OTHER, "s", "standard uncertainty of t_s, of an instrument that is asked", 6, 1e3
    ),
    Column("length_mm", ColumnKind.LENGTH, "mm", "distance between the two ball centres, raw", 6, 1e4),
    Column(
        "theta_deg",
        ColumnKind.ANGLE,
        "deg",
        "commanded angle from +X towards +Y, for both directions",
        6,
        _DEGREES_OF_TURNS,
    ),
    *(
        Column(f"{one}_temp_c", ColumnKind.TEMPERATURE, "degC", f"temperature of the {one}", 3, 150.0, one)
        for one in _SENSORS
    ),
    *(
        Column(f"motor{i}_current_a", ColumnKind.CURRENT, "A", f"current of motor {i}, {_PULL}", 5, 1e3, f"motor{i}")
        for i in range(1, 7)
    ),
)

COLUMNS = {column.name: column for column in _DECLARED}
"""Every numeric column by name."""

TIME, LENGTH, THETA = "t_s", "length_mm", "theta_deg"
TIME_UNCERTAINTY = "t_uncertainty_s"
REQUIRED = (TIME, LENGTH)
STATUS = "status"
"""Column of the instrument's status; `STATUS_GOOD` or empty for a usable sample."""
STATUS_GOOD = "ok"
CRC = "crc"
"""Checksum of the line, always the last column."""
TEXTS = (STATUS, CRC)


def is_known(name: str) -> bool:
    """Return whether the format has this column."""
    return name in COLUMNS or name in TEXTS


class WithLogged:
    """Base of classes with logged columns: values by name, shape (n,)."""

    logged: Logged

    @property
    def temperature_degc(self) -> dict[str, Floats]:
        """Return temperatures by sensor (`bar`, `jig`, `machine`, `strut1` ... `strut6`), shape (n,) each [degC]."""
        return {COLUMNS[name].of: values for name, values in self.logged.items() if _is(name, ColumnKind.TEMPERATURE)}

    @property
    def motor_current_a(self) -> Floats | None:
        """Return the motors' currents, NaN for unlogged ones, shape (n, 6) [A]; None without any."""
        there = next((values for name, values in self.logged.items() if _is(name, ColumnKind.CURRENT)), None)
        if there is None:
            return None
        return np.column_stack(
            [self.logged.get(name, np.full(len(there), np.nan)) for name in _named(ColumnKind.CURRENT)]
        )


def each(logged: Logged, change: Callable[[Floats], Floats]) -> Logged:
    """Return every column changed by one function."""
    return {name: change(values) for name, values in logged.items()}


def temperatures(by_sensor: Logged) -> Logged:
    """Return temperatures by sensor, shape (n,) each [degC], as columns."""
    names = {COLUMNS[name].of: name for name in _named(ColumnKind.TEMPERATURE)}
    return {names[sensor]: values for sensor, values in by_sensor.items()}


def currents(current_a: Floats) -> Logged:
    """Return six motors' currents, shape (n, 6) [A], as columns."""
    return dict(zip(_named(ColumnKind.CURRENT), np.ascontiguousarray(current_a.T), strict=True))


def _is(name: str, kind: ColumnKind) -> bool:
    return name in COLUMNS and COLUMNS[name].kind is kind


def _named(kind: ColumnKind) -> list[str]:
    return [column.name for column in _DECLARED if column.kind is kind]
