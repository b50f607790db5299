"""Report or refuse a compensated program that exceeds the chord error or loses feed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from dbbstation.errors import StationError
from dbbstation.nc.compensate import Prefer

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.compensate import Compensation
    from dbbstation.nc.dialect import Dialect

KEPT = 1.01
"""Ratio of computed to programmed time at feed above which the loss is reported."""


def remarks_on(
    done: Compensation, asked_um: float, machine: Machine, dialect: Dialect, prefer: Prefer
) -> tuple[str, ...]:
    """Return a sentence each on an exceeded chord error, on time lost in short pieces, and on an uncorrected tilt."""
    said = [*done.toolpath.notes]
    if done.chord_um > asked_um:
        said.append(
            f"the path is kept within {up(done.chord_um)} µm, not within {asked_um:g} µm, at {done.toolpath.place(done.chord_line)}: the correction "
            "has a step or bends more than the shortest pieces follow"
        )
    if dialect.look_ahead is None:
        said.append(f"how far {dialect.name} looks ahead is not known: whether it keeps F was not checked")
    elif done.seconds > KEPT * done.nominal_seconds:
        said.append(
            f"about {done.seconds:.0f} s at feed, {done.nominal_seconds:.0f} as written, with {said_acceleration(machine)}"
        )
    if prefer is Prefer.POSITION_ONLY:
        said.append(
            f"A, B and C are not corrected: a tilt is left that is felt as {up(done.tilt_um)} µm 100 mm from the tip"
        )
    return tuple(said)


def check_kept(done: Compensation, asked_um: float, machine: Machine) -> None:
    """Refuse a program that exceeds the chord error or loses a feed, stating values that keep both.

    Raises:
        StationError: names the worst line.
    """
    if done.chord_um > asked_um:
        raise StationError(
            f"the path is kept within {up(done.chord_um)} µm here, not within {asked_um:g} µm",
            where=done.toolpath.place(done.chord_line),
            remedy=f"--chord-um {up(done.chord_um)} is kept everywhere; without --strict the program is written as it is",
        )
    if math.isfinite(done.slowest_mm_min):
        reached = math.floor(done.slowest_mm_min)
        raise StationError(
            f"the control reaches {f'F{reached}' if reached else 'no F'} here, with {said_acceleration(machine)}; the program takes about "
            f"{done.seconds:.0f} s at feed, {done.nominal_seconds:.0f} as written",
            where=done.toolpath.place(done.slowest_line),
            remedy=(f"F{reached} is kept everywhere; " if reached else "")
            + "without --strict the program is written as it is",
        )


def said_acceleration(machine: Machine) -> str:
    """Return the acceleration and its origin as text."""
    known = "of the machine file" if machine.acceleration_mm_s2 is not None else "assumed: the machine file has none"
    return f"the acceleration of {machine.planned_acceleration_mm_s2 / 1e3:g} m/s² ({known})"


def up(value: float) -> str:
    """Return a number with two digits, rounded up."""
    if value <= 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - 1e-9) * unit:.4g}"
