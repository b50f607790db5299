"""Drilling cycles as single moves [RS274/NGC 3.5.16; LinuxCNC, G81 to G89]."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from dbbstation.nc.rs274.blocks import TAPS, name
from dbbstation.nc.rs274.state import unknown_place, unplaced

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.nc.rs274.blocks import ProgramBlock
    from dbbstation.nc.rs274.state import ControlState, ModalCycle

PECK_MM = 0.254
"""Clearance of a peck from the bottom of the previous peck, and height by which G73 lifts: 0.01 inch [LinuxCNC]."""


PECKS, MOST_PECKS = frozenset({73.0, 83.0}), 10_000
"""Cycles that need Q, and their greatest number of pecks in one hole."""


class Step(NamedTuple):
    """A part of a cycle.

    Attributes:
        what: `rapid` or `feed` to a depth, `dwell`, or words of the spindle: `M5`, `M3`, `M4`, `M48`, `M49`.
        depth: along the axis of the cycle, in machine coordinates [mm].
    """

    what: str
    depth: float = 0.0


class Depths(NamedTuple):
    """Numbers of a cycle along its axis, in machine coordinates [mm].

    Attributes:
        clear: R.
        bottom: Z, not above R.
        peck: Q; 0 without pecks.
    """

    clear: float
    bottom: float
    back: float
    peck: float = 0.0


def depths_of(
    cycle: ModalCycle, code: float, block: ProgramBlock, state: ControlState, column: int, *, absolute: bool
) -> Depths:
    """Return the depths of a cycle, and remove the cycle's words from the block.

    Args:
        absolute: whether Z and R count from the origin (G90).

    Raises:
        BadLine: numbers are missing, or make no sense.
    """
    numbers, unit, offset = cycle.numbers, state.unit_mm, state.offset[2]
    for letter, scale in (("Z", unit), ("R", unit), ("Q", unit), ("P", 1.0)):
        if letter in block.words:
            numbers[letter] = scale * block.words.pop(letter).value
    cycle.dwell_s = numbers.get("P", cycle.dwell_s)
    lacking = {"Z", "R", *(["Q"] if code in PECKS else [])} - numbers.keys()
    if lacking:
        what = f"{name('G', code)} needs {' and '.join(sorted(lacking))}"
        raise block.fault(what, "give them in its line", column)
    unknown, up = unplaced(state.pose), cycle.begun_at
    if unknown or math.isnan(up):
        raise unknown_place(block, unknown or ["Z"])
    clear = numbers["R"] + (offset if absolute else up)
    bottom = numbers["Z"] + (offset if absolute else clear)
    if bottom > clear or (code in PECKS and numbers["Q"] <= 0.0):
        raise block.fault("a cycle goes down from R to Z, by a positive Q", "check R, Z and Q", column)
    if code in PECKS and (clear - bottom) / numbers["Q"] > MOST_PECKS:
        raise block.fault(f"more than {MOST_PECKS} pecks in one hole", "check Q", column)
    if cycle.to_clear is None and up > clear:
        what = "neither G98 nor G99 says how high a cycle ends, and controls differ in what they begin with"
        raise block.fault(what, "write G98 or G99 before it", column)
    return Depths(clear, bottom, clear if cycle.to_clear else max(up, clear), numbers.get("Q", 0.0))


def cycle_steps(code: float, depths: Depths, turning: str) -> Iterator[Step]:
    """Yield the steps of a cycle after the clear plane; `turning` is M3, M4 or empty."""
    if code in TAPS:
        back = TAPS[158.0 - code]
        yield from (Step("M49"), Step("feed", depths.bottom), Step("M5"), Step(back), Step("dwell"))
        yield from (Step("feed", depths.back), Step("M5"), Step(turning), Step("M48"))
        return
    if code in PECKS:
        yield from _pecks(depths, to_clear=code == 83.0)  # noqa: PLR2004 - the code
    else:
        yield Step("feed", depths.bottom)
    if code in {82.0, 86.0, 89.0}:
        yield Step("dwell")
    if code in {85.0, 89.0}:
        yield Step("feed", depths.clear if code == 85.0 else depths.back)  # noqa: PLR2004 - the code
    if code == 86.0 and turning:  # noqa: PLR2004 - the code
        yield Step("M5")
    if code != 89.0:  # noqa: PLR2004 - the code
        yield Step("rapid", depths.back)
    if code == 86.0 and turning:  # noqa: PLR2004 - the code
        yield Step(turning)


def _pecks(depths: Depths, *, to_clear: bool) -> Iterator[Step]:
    depth = depths.clear
    while depth - depths.bottom > depths.peck:
        depth -= depths.peck
        yield Step("feed", depth)
        if to_clear:
            yield Step("rapid", depths.clear)
        yield Step("rapid", depth + PECK_MM)
    yield Step("feed", depths.bottom)
