"""Drilling cycles as single moves [RS274/NGC 3.5.16; LinuxCNC, G81 to G89]."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

PECK_MM = 0.254
"""By how much a peck stays clear of the bottom of the one before, and G73 lifts: 0.01 inch [LinuxCNC]."""


PECKS = frozenset({73.0, 83.0})
"""Cycles that need Q."""


class Step(NamedTuple):
    """A part of a cycle.

    Attributes:
        what: `rapid` or `feed` to a depth, `dwell`, `stop` of the spindle, `turn` it again.
        depth: along the axis of the cycle, in machine coordinates [mm].
    """

    what: str
    depth: float = 0.0


class Depths(NamedTuple):
    """Numbers of a cycle along its axis, in machine coordinates [mm].

    Attributes:
        clear: R.
        bottom: Z, not above R.
        back: where it ends.
        peck: Q; 0 without pecks.
    """

    clear: float
    bottom: float
    back: float
    peck: float = 0.0


def cycle_steps(code: float, depths: Depths) -> Iterator[Step]:
    """Yield the steps of a cycle from the clear plane on."""
    if code in PECKS:
        yield from _pecks(depths, to_clear=code == 83.0)  # noqa: PLR2004 - the code
    else:
        yield Step("feed", depths.bottom)
    if code in {82.0, 86.0, 89.0}:
        yield Step("dwell")
    if code in {85.0, 89.0}:
        yield Step("feed", depths.clear if code == 85.0 else depths.back)  # noqa: PLR2004 - the code
    if code == 86.0:  # noqa: PLR2004 - the code
        yield Step("stop")
    if code != 89.0:  # noqa: PLR2004 - the code
        yield Step("rapid", depths.back)
    if code == 86.0:  # noqa: PLR2004 - the code
        yield Step("turn")


def _pecks(depths: Depths, *, to_clear: bool) -> Iterator[Step]:
    depth = depths.clear
    while depth - depths.bottom > depths.peck:
        depth -= depths.peck
        yield Step("feed", depth)
        if to_clear:
            yield Step("rapid", depths.clear)
        yield Step("rapid", depth + PECK_MM)
    yield Step("feed", depths.bottom)
